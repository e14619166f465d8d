
"use strict";
// Three dimensions seen from a side: a box with named axes, turned by dragging or by buttons.

class Scene extends Canvas {
  constructor(host, options) {
    super(host, options);
    this.turnBy(0, 0);
    const turn = (name, text, ...by) =>
      element("button", { type: "button", "aria-label": name, title: name, click: () => this.turnBy(...by) }, text);
    this.figure.append(element("div", { class: "turn" },
      turn("Turn left", "\u2190", -0.15, 0), turn("Turn right", "\u2192", 0.15, 0),
      turn("Tilt up", "\u2191", 0, 0.12), turn("Tilt down", "\u2193", 0, -0.12)));
    let from = null;
    this.canvas.addEventListener("pointerdown", (event) => {
      from = event;
      this.canvas.setPointerCapture(event.pointerId);
    });
    this.canvas.addEventListener("pointermove", (event) => {
      if (!from) return;
      this.turnBy((event.clientX - from.clientX) * 0.01, (event.clientY - from.clientY) * 0.01);
      from = event;
    });
    for (const name of ["pointerup", "pointercancel"]) this.canvas.addEventListener(name, () => { from = null; });
  }

  turnBy(azimuth, elevation) {
    this.azimuth = (this.azimuth ?? -0.75) + azimuth;
    this.elevation = Math.min(1.5, Math.max(-1.5, (this.elevation ?? 0.42) + elevation));
    this.draw();
  }

  /** Begin a drawing: limits and titles of three axes, the third upright; lengths relative to each other. */
  begin(limits, titles, lengths = [1, 1, 1]) {
    Object.assign(this, { limits, lengths });
    const across = Math.hypot(lengths[0], lengths[1]);
    const tall = Math.cos(this.elevation) * lengths[2] + Math.abs(Math.sin(this.elevation)) * across;
    this.size = Math.min((this.width - 80) / across, (this.height - 90) / tall);
    this.clear();
    const corners = [-0.5, 0.5];
    const place = (axis, along, a, b) => {
      const at = [a, b];
      at.splice(axis, 0, along);
      return this.seen(at.map((share, k) => share * lengths[k]));
    };
    titles.forEach((title, axis) => {
      const edges = corners.flatMap((a) => corners.map((b) => [a, b]));
      for (const [a, b] of edges) {
        this.path([place(axis, -0.5, a, b), place(axis, 0.5, a, b)], { stroke: theme.colours.grid, width: 1 });
      }
      // Name the edge that stands clear of the box: the lowest, or for the upright axis the leftmost.
      const clear = (edge) => { const [x, y] = place(axis, 0, ...edge); return axis === 2 ? -x : y; };
      const [a, b] = edges.reduce((best, edge) => (clear(edge) > clear(best) ? edge : best));
      const [low, high] = limits[axis];
      const outward = place(axis, 0, a, b);
      const away = axis === 2 ? [-1, 0] : [Math.sign(outward[0] - this.width / 2) * 0.5, 1];
      for (const value of ticks(low, high, 3)) {
        const [x, y] = place(axis, (value - low) / (high - low) - 0.5, a, b);
        this.path([[x, y], [x + 4 * away[0], y + 4 * away[1]]], { stroke: theme.colours.line, width: 1 });
        this.text(tickText(value), x + 8 * away[0], y + 13 * away[1], { align: axis === 2 ? "right" : "center" });
      }
      this.path([place(axis, -0.5, a, b), place(axis, 0.5, a, b)], { stroke: theme.colours.line, width: 1 });
      if (axis === 2) this.text(title, 10, this.height / 2, { turn: -Math.PI / 2, colour: theme.colours.ink });
      else this.text(title, outward[0] + 56 * away[0], outward[1] + 33, { colour: theme.colours.ink });
    });
  }

  /** Where a point of the box of side `lengths` about the origin is seen: across, down, and how near. */
  seen([x, y, z]) {
    const [ca, sa, ce, se] = [Math.cos(this.azimuth), Math.sin(this.azimuth), Math.cos(this.elevation), Math.sin(this.elevation)];
    const [across, away] = [ca * x - sa * y, sa * x + ca * y];
    return [
      this.width / 2 + 14 + this.size * across,
      this.height / 2 - 12 - this.size * (ce * z - se * away),
      -ce * away - se * z,
    ];
  }

  at(point) {
    return this.seen(point.map((value, axis) => {
      const [low, high] = this.limits[axis];
      return ((value - low) / (high - low) - 0.5) * this.lengths[axis];
    }));
  }

  curve(points, look) {
    this.path(points.map((point) => this.at(point)), look);
  }
}
