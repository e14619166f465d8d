
"use strict";
// A plane drawn on a canvas: axes, curves, polygons, marks, and what lies under the pointer.

const FONT = '12px system-ui, "DejaVu Sans", sans-serif';

/** Round values between two limits, about so many; and how a value is written beside an axis. */
function ticks(low, high, about) {
  const rough = (high - low) / Math.max(1, about);
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = power * [1, 2, 5, 10].find((each) => each * power >= rough * 0.999);
  const found = [];
  for (let index = Math.ceil(low / step - 1e-9); index * step <= high + 1e-9 * step; index++) found.push(index * step);
  return found.map((value) => (Math.abs(value) < 1e-9 * step ? 0 : value));
}

const tickText = (value) =>
  shown(value, "", Math.abs(value) >= 1e5 || (value !== 0 && Math.abs(value) < 1e-3) ? 3 : 8);

/** Limits a little wider than the values; never of no width. */
function limitsOf(values, margin = 0.06) {
  let [low, high] = [Infinity, -Infinity];
  for (const value of values) {
    if (value < low) low = value;
    if (value > high) high = value;
  }
  if (low > high) return [-1, 1];
  const room = margin * (high - low) || 0.05 * Math.abs(high) || 1e-6;
  return [low - room, high + room];
}

/** Equal steps near zero and a decade a step beyond: for values of either sign over many decades. */
const symlog = (threshold) => ({
  forward: (value) => (Math.abs(value) <= threshold
    ? value / threshold
    : Math.sign(value) * (1 + Math.log10(Math.abs(value) / threshold))),
  ticks(low, high) {
    const largest = Math.ceil(Math.max(Math.abs(low), Math.abs(high)) - 1);
    const powers = Array.from({ length: Math.max(1, largest) }, (_, index) => threshold * 10 ** index)
      .filter((_, index) => index % Math.ceil(largest / 3) === 0);
    return [...powers.map((power) => -power).reverse(), 0, ...powers];
  },
});

/** Positive values, a decade a step. */
const LOGARITHMIC = {
  forward: (value) => Math.log10(Math.max(value, 1e-12)),
  ticks(low, high) {
    const [first, last] = [Math.ceil(low), Math.floor(high)];
    return Array.from({ length: Math.max(0, last - first + 1) }, (_, index) => 10 ** (first + index))
      .filter((_, index) => index % Math.ceil((last - first + 1) / 5) === 0);
  },
};

/** A canvas in a figure: sized to its place, redrawn when that changes, with a tip under the pointer. */
class Canvas {
  constructor(host, { caption, label, ratio = 0.62, legend = [], draw, tell }) {
    this.label = label;
    this.ratio = ratio;
    this.canvas = element("canvas", { role: "img", "aria-label": label });
    this.context = this.canvas.getContext("2d");
    this.figure = element("figure", {}, element("figcaption", {}, caption), this.canvas);
    if (legend.length) this.figure.append(element("ul", { class: "legend" }, ...legend.map((each) => this.key(each))));
    host.append(this.figure);
    this.draw = () => { if (this.width > 0) draw(this); };
    this.canvas.addEventListener("pointermove", (event) => {
      const box = this.canvas.getBoundingClientRect();
      tip.show(tell(event.clientX - box.left, event.clientY - box.top), event);
    });
    for (const name of ["pointerleave", "pointercancel"]) this.canvas.addEventListener(name, () => tip.show(null));
    new ResizeObserver(() => this.resize()).observe(this.canvas);
    theme.listeners.push(() => { this.keys.forEach((paint) => paint()); this.draw(); });
  }

  keys = [];

  /** An entry of the legend: a swatch drawn as the thing itself, and its name. */
  key([text, paint]) {
    const swatch = element("canvas", { width: 44, height: 24, "aria-hidden": "true" });
    const context = swatch.getContext("2d");
    this.keys.push(() => {
      context.setTransform(2, 0, 0, 2, 0, 0);
      context.clearRect(0, 0, 22, 12);
      paint(context);
    });
    this.keys[this.keys.length - 1]();
    return element("li", {}, swatch, text);
  }

  resize() {
    const scale = devicePixelRatio || 1;
    const width = this.canvas.clientWidth;
    const height = Math.round(Math.min(520, Math.max(190, width * this.ratio)));
    if (width === this.width && scale === this.scale) return;
    Object.assign(this, { width, height, scale });
    this.canvas.style.height = `${height}px`;
    this.canvas.width = Math.round(width * scale);
    this.canvas.height = Math.round(height * scale);
    this.draw();
  }

  /** What is read out in place of the picture. */
  describe(text) {
    this.canvas.setAttribute("aria-label", `${this.label}. ${text}`);
  }

  clear() {
    this.context.setTransform(this.scale, 0, 0, this.scale, 0, 0);
    this.context.clearRect(0, 0, this.width, this.height);
    this.context.font = FONT;
    this.context.lineJoin = "round";
  }

  text(text, x, y, { align = "center", baseline = "middle", colour = theme.colours.quiet, turn = 0 } = {}) {
    const { context } = this;
    context.save();
    context.translate(x, y);
    context.rotate(turn);
    Object.assign(context, { textAlign: align, textBaseline: baseline, fillStyle: colour });
    context.fillText(text, 0, 0);
    context.restore();
  }

  /** Draw a path of points on the screen, filled, stroked or both. */
  path(points, { stroke, fill, width = 1.5, dash = [], closed = false, opacity = 1 }) {
    if (!points.length) return;
    drawPath(this.context, points, { stroke, fill, width, dash, closed, opacity });
  }

  mark(x, y, kind, colour, filled = false, size = 5) {
    drawMark(this.context, x, y, kind, colour, size, filled);
  }
}

function drawPath(context, points, { stroke, fill, width = 1.5, dash = [], closed = false, opacity = 1 }) {
  context.beginPath();
  points.forEach(([x, y], index) => (index ? context.lineTo(x, y) : context.moveTo(x, y)));
  if (closed) context.closePath();
  if (fill) {
    Object.assign(context, { fillStyle: fill, globalAlpha: opacity });
    context.fill();
    context.globalAlpha = 1;
  }
  if (stroke) {
    Object.assign(context, { strokeStyle: stroke, lineWidth: width });
    context.setLineDash(dash);
    context.stroke();
    context.setLineDash([]);
  }
}

/** The outline of a regular polygon whose first corner is at an angle in degrees, clockwise from the right. */
const polygon = (corners, from, size = 1.35) => [...Array(corners + 1).keys()].map((corner) => {
  const angle = (from / 180 + 2 * corner / corners) * Math.PI;
  return [size * Math.cos(angle), size * Math.sin(angle)];
});

/** A mark with a halo: cross or plus, or an outline, filled or not. */
function drawMark(context, x, y, kind, colour, size = 5, filled = false) {
  const shapes = {
    cross: [[[-1, -1], [1, 1]], [[-1, 1], [1, -1]]],
    square: [[[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]]],
    diamond: [[[0, -1.3], [1.3, 0], [0, 1.3], [-1.3, 0], [0, -1.3]]],
    plus: [[[-1.3, 0], [1.3, 0]], [[0, -1.3], [0, 1.3]]],
    triangle: [polygon(3, -90)],
    nabla: [polygon(3, 90)],
    pentagon: [polygon(5, -90)],
    dot: [polygon(12, 0, 1)],
  };
  const lines = shapes[kind].map((line) => line.map(([u, v]) => [x + size * u, y + size * v]));
  const closed = kind !== "cross" && kind !== "plus";
  for (const line of lines) drawPath(context, line, { stroke: theme.colours.panel, width: 5 });
  for (const line of lines) drawPath(context, line, { stroke: colour, width: 2, fill: closed && (filled ? colour : theme.colours.panel) });
}

/** A plane with axes: a drawing begins with `begin` and ends with `end`; between them all is in the axes' units. */
class Chart extends Canvas {
  /** Begin a drawing: limits of both axes, their titles, ticks across (pairs of value and text), whether one unit is as long across as up. */
  begin({ x, y, xTitle, yTitle, yScale = null, xTicks = null, equal = false }) {
    const { context } = this;
    Object.assign(this, { left: 62, right: this.width - 12, top: 10, bottom: this.height - 40, yScale });
    if (equal) [x, y] = this.evened(x, y);
    const [low, high] = yScale ? y.map(yScale.forward) : y;
    Object.assign(this, { x, low, high });
    this.clear();
    const { left, right, top, bottom } = this;
    context.fillStyle = theme.colours.paper;
    context.fillRect(left, top, right - left, bottom - top);
    let clear = -Infinity;
    for (const [value, text] of xTicks ?? ticks(...x, (right - left) / 75).map((each) => [each, tickText(each)])) {
      const at = this.across(value);
      this.path([[at, top], [at, bottom]], { stroke: theme.colours.grid, width: 1 });
      if (xTicks && (at < clear || at > right - 14)) continue;
      this.text(text, at, bottom + 13);
      clear = at + 48;
    }
    const levels = yScale ? yScale.ticks(low, high) : ticks(...y, (bottom - top) / 45);
    for (const value of levels) {
      const at = this.up(value);
      if (at < top - 1 || at > bottom + 1) continue;
      this.path([[left, at], [right, at]], { stroke: theme.colours.grid, width: 1 });
      this.text(tickText(value), left - 6, at, { align: "right" });
    }
    this.text(xTitle, (left + right) / 2, this.height - 9, { colour: theme.colours.ink });
    this.text(yTitle, 10, (top + bottom) / 2, { colour: theme.colours.ink, turn: -Math.PI / 2 });
    context.save();
    context.beginPath();
    context.rect(left, top, right - left, bottom - top);
    context.clip();
  }

  end() {
    this.context.restore();
    const { left, right, top, bottom } = this;
    this.path([[left, top], [right, top], [right, bottom], [left, bottom]], { stroke: theme.colours.line, width: 1, closed: true });
  }

  /** Limits grown so that a unit is as long across as up. */
  evened(x, y) {
    const scale = Math.max((x[1] - x[0]) / (this.right - this.left), (y[1] - y[0]) / (this.bottom - this.top));
    const grow = ([low, high], length) => {
      const middle = (low + high) / 2;
      return [middle - (scale * length) / 2, middle + (scale * length) / 2];
    };
    return [grow(x, this.right - this.left), grow(y, this.bottom - this.top)];
  }

  across(value) {
    return this.left + ((value - this.x[0]) / (this.x[1] - this.x[0])) * (this.right - this.left);
  }

  up(value) {
    const at = this.yScale ? this.yScale.forward(value) : value;
    return this.bottom - ((at - this.low) / (this.high - this.low)) * (this.bottom - this.top);
  }

  at(points) {
    return points.map(([x, y]) => [this.across(x), this.up(y)]);
  }

  /** The values under a place on the screen (linear axes). */
  under(px, py) {
    return [
      this.x[0] + ((px - this.left) / (this.right - this.left)) * (this.x[1] - this.x[0]),
      this.low + ((this.bottom - py) / (this.bottom - this.top)) * (this.high - this.low),
    ];
  }

  curve(points, look) {
    this.path(this.at(points), look);
  }

  area(lower, upper, look) {
    this.path(this.at([...lower, ...upper.slice().reverse()]), { ...look, closed: true });
  }

  /** What lies between two values across; a line where they are one. */
  upright(from, to, look) {
    const [left, right, top, bottom] = [this.across(from), this.across(to), this.top - 2, this.bottom + 2];
    this.path([[left, top], [right, top], [right, bottom], [left, bottom]], { ...look, closed: true });
  }

  /** What lies between two values up; a line where they are one. */
  band(from, to, look) {
    const [low, high, left, right] = [this.up(from), this.up(to), this.left - 2, this.right + 2];
    this.path([[left, low], [right, low], [right, high], [left, high]], { ...look, closed: true });
  }

  level(y, look) {
    this.path([[this.left, this.up(y)], [this.right, this.up(y)]], look);
  }

  point(x, y, kind, colour, size = 5) {
    this.mark(this.across(x), this.up(y), kind, colour, false, size);
  }
}

/** Index of the value nearest to one wanted. */
function nearest(values, wanted) {
  let best = 0;
  values.forEach((value, index) => {
    if (Math.abs(value - wanted) < Math.abs(values[best] - wanted)) best = index;
  });
  return best;
}

/** Whether a point lies in a polygon. */
function inside(points, x, y) {
  let found = false;
  for (let i = 0, j = points.length - 1; i < points.length; j = i++) {
    const [[xi, yi], [xj, yj]] = [points[i], points[j]];
    if (yi > y !== yj > y && x < xi + ((y - yi) * (xj - xi)) / (yj - yi)) found = !found;
  }
  return found;
}
