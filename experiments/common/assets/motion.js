
"use strict";
// Moving craft: paths in space and in planes, reachable sets, and curves over time.

// Marks of moving points; those of fixed points are diamond, plus and cross.
const LOOKS = [
  { colour: "set", dash: [], mark: "dot" },
  { colour: "impulse", dash: [6, 3], mark: "square" },
  { colour: "extra", dash: [2, 2], mark: "triangle" },
  { colour: "measured", dash: [8, 2, 2, 2], mark: "nabla" },
  { colour: "ink", dash: [1, 3], mark: "pentagon" },
];
/** The look of a track; marks of later rounds are filled, with the colours in another order. */
const lookOf = (index) => {
  const [round, place] = [Math.floor(index / LOOKS.length), index % LOOKS.length];
  return { ...LOOKS[(place + round) % LOOKS.length], mark: LOOKS[place].mark, filled: round > 0 };
};
const colourOf = (index) => theme.colours[lookOf(index).colour];

/** An entry of a legend for a look: its line and its mark. */
const lookKey = (name, index) => [name, (context) => {
  drawPath(context, [[1, 6], [21, 6]], { stroke: colourOf(index), width: 2, dash: lookOf(index).dash });
  drawMark(context, 11, 6, lookOf(index).mark, colourOf(index), 3, lookOf(index).filled);
}];

let chosen = null; // index of the choice shown; null shows all of them
const isShown = ({ choice }) => chosen === null || choice === null || choice === undefined || choice === chosen;

/** A view of paths: in space, or in the plane of two of its axes. */
class View {
  constructor(host, view, clock) {
    Object.assign(this, { view, clock, frame: 0 });
    const named = view.tracks.filter((track, index) => view.tracks.findIndex(({ name }) => name === track.name) === index);
    const options = {
      caption: view.caption,
      label: view.caption,
      ratio: 0.82,
      legend: [
        ...named.map((track) => lookKey(track.name, track.look)),
        ...view.marks.filter(({ name }) => name).map(({ name, kind }) =>
          [name, (context) => drawMark(context, 11, 6, kind, theme.colours.ink, 4)]),
        ...(view.sets ? [[view.sets.name, (context) => drawPath(context, [[1, 1], [21, 1], [21, 11], [1, 11]],
          { fill: theme.colours.set, stroke: theme.colours.set, width: 1, opacity: 0.25, closed: true })]] : []),
      ],
      draw: () => this.draw(),
      tell: (x, y) => this.tell(x, y),
    };
    this.panel = view.plane ? new Chart(host, options) : new Scene(host, options);
    this.axes = view.plane ?? [0, 1, 2];
    this.fit();
  }

  /** Set the limits of the axes so that everything fits. */
  fit() {
    const { view } = this;
    this.limits = this.axes.map((axis) => limitsOf([
      ...view.tracks.flatMap(({ points }) => points.map((point) => point[axis])),
      ...view.marks.map(({ point }) => point[axis]),
      ...(view.sets?.faces ?? []).flat().flatMap((face) => face.map((point) => point[view.plane ? this.axes.indexOf(axis) : axis])),
    ].map((value) => value * view.unit[1])));
  }

  /** Return the position on the screen of a point in SI units. */
  place(point) {
    const scaled = this.axes.map((axis) => point[axis] * this.view.unit[1]);
    return this.view.plane ? [this.panel.across(scaled[0]), this.panel.up(scaled[1])] : this.panel.at(scaled);
  }

  draw() {
    const { panel, view, limits, axes } = this;
    const titles = axes.map((axis) => `${view.axes[axis]}, ${view.unit[0]}`);
    if (view.plane) {
      panel.begin({ x: limits[0], y: limits[1], xTitle: titles[0], yTitle: titles[1], equal: view.equal });
    } else {
      const spans = limits.map(([low, high]) => high - low);
      const lengths = view.equal ? spans.map((span) => Math.max(0.35, span / Math.max(...spans))) : [1, 1, 0.85];
      panel.begin(limits, titles, lengths);
    }
    if (view.sets) this.drawSets();
    for (const track of view.tracks.filter(isShown)) {
      const seen = track.points.map((point) => this.place(point));
      panel.path(seen, { stroke: theme.colours.line, width: 1, dash: lookOf(track.look).dash });
      panel.path(seen.slice(0, this.frame + 1), { stroke: colourOf(track.look), width: 2, dash: lookOf(track.look).dash });
    }
    for (const { point, kind } of view.marks) panel.mark(...this.place(point).slice(0, 2), kind, theme.colours.ink);
    for (const track of view.tracks.filter(isShown)) {
      const at = this.place(track.points[Math.min(this.frame, track.points.length - 1)]);
      panel.mark(at[0], at[1], lookOf(track.look).mark, colourOf(track.look), lookOf(track.look).filled);
    }
    if (view.plane) panel.end();
  }

  /** Draw the sets of all times faintly and the set of the present time clearly. */
  drawSets() {
    const { view, panel } = this;
    const now = view.sets.of_frame[this.frame];
    view.sets.faces.forEach((faces, index) => {
      const look = { fill: theme.colours.set, opacity: index === now ? 0.18 : 0.04, closed: true,
        stroke: index === now ? theme.colours.set : (faces.length > 12 ? null : theme.colours.line), width: index === now ? 1.2 : 0.5 };
      for (const face of faces) {
        panel.path(face.map((point) => (view.plane
          ? [panel.across(point[0] * view.unit[1]), panel.up(point[1] * view.unit[1])]
          : panel.at(point.map((value) => value * view.unit[1])))), look);
      }
    });
  }

  tell(x, y) {
    const { view, clock } = this;
    let best = [14, null, 0];
    for (const track of view.tracks.filter(isShown)) {
      track.points.forEach((point, index) => {
        const [px, py] = this.place(point);
        const apart = Math.hypot(px - x, py - y) + (index === this.frame ? -4 : 0);
        if (apart < best[0]) best = [apart, track, index];
      });
    }
    const [, track, index] = best;
    if (!track) return null;
    return [track.name, `t = ${clock(index)}`, ...view.axes.map((name, axis) =>
      `${name} = ${shown(track.points[index][axis] * view.unit[1], view.unit[0])}`)];
  }
}

/** A graph of curves over time. */
class Graph {
  constructor(host, graph, clock) {
    Object.assign(this, { graph, clock, frame: 0 });
    this.panel = new Chart(host, {
      caption: graph.caption,
      label: graph.caption,
      ratio: 0.36,
      legend: graph.curves.map((curve) => lookKey(curve.name, curve.look)),
      draw: () => this.draw(),
      tell: (x) => this.tell(x),
    });
    const [, factor] = graph.unit;
    this.limits = limitsOf([...graph.curves.flatMap(({ values }) => values.map((value) => value * factor)),
      ...graph.levels.map((value) => value * factor), ...(graph.band ?? []).flat().map((value) => value * factor)], 0.08);
    this.times = DATA.time_s.map((time) => time * DATA.time_factor);
    this.span = limitsOf(this.times, 0.02);
  }

  draw() {
    const { panel, graph, times } = this;
    panel.begin({ x: this.span, y: this.limits, xTitle: `time, ${DATA.time_unit}`, yTitle: `${graph.title}${graph.unit[0] ? `, ${graph.unit[0]}` : ""}` });
    const at = (values) => values.flatMap((value, index) => [
      ...(graph.stairs && index ? [[times[index], values[index - 1] * graph.unit[1]]] : []), [times[index], value * graph.unit[1]]]);
    if (graph.band) {
      panel.area(at(graph.band.map(([low]) => low)), at(graph.band.map(([, high]) => high)), { fill: theme.colours.set, opacity: 0.15 });
    }
    for (const level of graph.levels) panel.level(level * graph.unit[1], { stroke: theme.colours.line, width: 1.2, dash: [5, 3] });
    for (const curve of graph.curves.filter(isShown)) {
      panel.curve(at(curve.values), { stroke: colourOf(curve.look), width: 1.8, dash: lookOf(curve.look).dash });
    }
    panel.upright(times[this.frame], times[this.frame], { stroke: theme.colours.quiet, width: 1, dash: [2, 2] });
    panel.end();
    panel.describe(this.rows(this.frame).map((row) => row.join(" ")).join(", "));
  }

  rows(frame) {
    const { graph } = this;
    const named = ({ name }) => (name.startsWith(graph.title) ? name : `${graph.title}, ${name}`);
    return graph.curves.filter(isShown).map((curve) => [named(curve), shown(curve.values[frame] * graph.unit[1], graph.unit[0])]);
  }

  tell(x) {
    const { panel } = this;
    if (x < panel.left - 5 || x > panel.right + 5) return null;
    const frame = nearest(this.times, panel.under(x, 0)[0]);
    return [`t = ${this.clock(frame)}`, ...this.rows(frame).map((row) => row.join(": "))];
  }
}

/** Build the page of `DATA`: its views, graphs, table of numbers, and the time slider. */
function buildMotion(main) {
  const clock = (frame) => shown(DATA.time_s[frame] * DATA.time_factor, DATA.time_unit);
  const host = element("div", { class: "columns" });
  const panels = [
    ...DATA.views.map((view) => new View(host, view, clock)),
    ...DATA.graphs.map((graph) => new Graph(host, graph, clock)),
  ];
  const numbers = element("table", { "aria-label": "Numbers at this time" });
  const built = new Player({
    frames: DATA.time_s.length,
    name: (frame) => `t = ${clock(frame)}`,
    speeds: DATA.speeds,
    speed: DATA.speeds[1],
    draw: (frame) => {
      for (const each of panels) {
        each.frame = frame;
        each.panel.draw();
      }
      fillTable(numbers, [["time", clock(frame)], ...panels.flatMap((each) => (each.rows ? each.rows(frame) : []))]);
    },
  });
  if (DATA.choices.length > 1) {
    const names = [["", "all"], ...DATA.choices.map((name, index) => [String(index), name])];
    main.append(element("div", { class: "choices" }, choice("Control", names, "", (value) => {
      chosen = value === "" ? null : Number(value);
      built.show(built.frame);
    })));
  }
  main.append(host);
  if (DATA.graphs.length) main.append(element("figure", {}, element("figcaption", {}, "Numbers at this time"), numbers));
  main.append(
    element("p", {}, "Keys: Space starts and pauses; the left and right arrows move by one step; Home and End jump to the ends."));
  return { player: built, panels };
}
