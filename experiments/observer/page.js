"use strict";
// The sets of an observer: one step in the plane of two states, and the bounds of every state against time.

const main = document.getElementById("main");
const top_ = element("div", { class: "columns" });
const graphs = element("div", { class: "columns" });
main.append(top_, graphs);
let frame = 0;

const centres = DATA.steps.some((step) => step.centre);
const points = (step) => [...step.sets.flat(), ...(step.state ? [step.state] : [])];

/** Limits of a state over all steps. */
function stateLimits(index) {
  return limitsOf(DATA.steps.flatMap(({ lower, upper, state }) =>
    [...(lower ? [lower[index], upper[index]] : []), ...(state ? [state[index]] : [])]));
}

/** Return the numbers of the present step. */
function rows(step) {
  return [
    ["step", String(step.k)],
    ...DATA.names.map((name, index) => [name,
      step.lower ? `${shown(step.lower[index])} to ${shown(step.upper[index])}` : "no state is possible"]),
    ...(centres ? DATA.names.map((name, index) => [`centre: ${name}`, step.centre ? shown(step.centre[index]) : "none"])
      : []),
    ...(step.state ? DATA.names.map((name, index) => [`true state: ${name}`, shown(step.state[index])]) : []),
    ...step.measured.map((value, index) => [`y${index + 1}`, value === null ? "missing" : shown(value)]),
    ...step.inputs.map((value, index) => [`u${index + 1}`, shown(value)]),
  ];
}

const charts = [];
const plane = DATA.names.length === 2;
if (plane) {
  const legend = [
    ["possible states", (context) => drawPath(context, [[1, 1], [21, 1], [21, 11], [1, 11]],
      { fill: theme.colours.set, opacity: 0.35, stroke: theme.colours.line, width: 1, closed: true })],
    ["previous step", (context) => drawPath(context, [[1, 1], [21, 1], [21, 11], [1, 11]],
      { stroke: theme.colours.quiet, width: 1, dash: [3, 3], closed: true })],
  ];
  if (DATA.steps.some((step) => step.smoothed.length)) {
    legend.push(["with later measurements", (context) => drawPath(context, [[1, 1], [21, 1], [21, 11], [1, 11]],
      { stroke: theme.colours.measured, width: 1.5, closed: true })]);
  }
  if (DATA.steps[0].state) legend.push(["true state", (context) => drawMark(context, 11, 6, "cross", theme.colours.ink, 4)]);
  charts.push(new Chart(top_, {
    caption: "Set of the present step",
    label: "Plane of both states",
    ratio: 0.8,
    legend,
    draw(chart) {
      const step = DATA.steps[frame];
      const before = DATA.steps[Math.max(0, frame - 1)];
      const near = [...points(step), ...points(before)];
      const [x, y] = [0, 1].map((axis) => limitsOf(near.map((point) => point[axis]), 0.15));
      chart.begin({ x, y, xTitle: DATA.names[0], yTitle: DATA.names[1] });
      for (const set of frame ? before.sets : []) {
        chart.curve(set, { stroke: theme.colours.quiet, width: 1, dash: [3, 3], closed: true });
      }
      for (const set of step.sets) {
        chart.curve(set, { fill: theme.colours.set, opacity: 0.35, stroke: theme.colours.line, closed: true });
      }
      for (const set of step.smoothed) {
        chart.curve(set, { stroke: theme.colours.measured, width: 1.5, closed: true });
      }
      if (step.state) chart.point(...step.state, "cross", theme.colours.ink);
      chart.end();
      chart.describe(rows(step).map((row) => row.join(" ")).join(", "));
    },
    tell(x, y) {
      const [u, v] = charts[0].under(x, y);
      return [`${DATA.names[0]}: ${shown(u)}`, `${DATA.names[1]}: ${shown(v)}`];
    },
  }));
}
const stroke = (look) => (context) => drawPath(context, [[1, 6], [21, 6]], look);
const boundsLegend = [
  ["possible states", (context) => drawPath(context, [[1, 1], [21, 1], [21, 11], [1, 11]],
    { fill: theme.colours.set, opacity: 0.35, stroke: theme.colours.line, width: 1, closed: true })],
  ...(DATA.steps.some((step) => step.later)
    ? [["with later measurements", stroke({ stroke: theme.colours.measured, width: 1.5, dash: [4, 2] })]] : []),
  ...(DATA.steps[0].state ? [["true state", stroke({ stroke: theme.colours.ink, width: 1.5 })]] : []),
  ...(DATA.empty_from !== null
    ? [["no state is possible from this step on", stroke({ stroke: theme.colours.impulse, width: 2 })]] : []),
  ...(DATA.proved_at !== null
    ? [["a wrong measurement is proved", stroke({ stroke: theme.colours.impulse, width: 1, dash: [2, 2] })]] : []),
  ["present step", stroke({ stroke: theme.colours.quiet, width: 1.5 })],
];
const numbers = element("table", { "aria-label": "Numbers of this step", "aria-live": "polite" });
top_.append(element("figure", {}, element("figcaption", {}, "Numbers of the present step"), numbers));

DATA.names.forEach((name, index) => {
  const y = stateLimits(index);
  const known = DATA.steps.map((step, k) => [step, DATA.time[k]]).filter(([step]) => step.lower);
  const chart = new Chart(graphs, {
    caption: name,
    label: `Bounds of ${name} against time`,
    legend: boundsLegend,
    draw(drawn) {
      drawn.begin({ x: limitsOf(DATA.time, 0.01), y, xTitle: DATA.time_title, yTitle: name });
      drawn.area(known.map(([step, at]) => [at, step.lower[index]]), known.map(([step, at]) => [at, step.upper[index]]),
        { fill: theme.colours.set, opacity: 0.35, stroke: theme.colours.line, width: 1 });
      const states = DATA.steps.map((step, k) => [DATA.time[k], step.state]).filter(([, state]) => state);
      const later = DATA.steps.map((step, k) => [DATA.time[k], step.later]).filter(([, ends]) => ends);
      for (const end of [0, 1]) {
        drawn.curve(later.map(([at, ends]) => [at, ends[end][index]]),
          { stroke: theme.colours.measured, width: 1, dash: [4, 2] });
      }
      if (DATA.empty_from !== null) {
        const empty = DATA.time[DATA.empty_from];
        drawn.upright(empty, empty, { stroke: theme.colours.impulse, width: 2 });
      }
      if (DATA.proved_at !== null) {
        const proved = DATA.time[DATA.proved_at];
        drawn.upright(proved, proved, { stroke: theme.colours.impulse, width: 1, dash: [2, 2] });
      }
      drawn.curve(states.map(([at, state]) => [at, state[index]]), { stroke: theme.colours.ink, width: 1.5 });
      const now = DATA.time[frame];
      drawn.upright(now, now, { stroke: theme.colours.quiet, width: 1.5 });
      drawn.end();
      drawn.describe(rows(DATA.steps[frame]).map((row) => row.join(" ")).join(", "));
    },
    tell(x) {
      const k = nearest(DATA.time, chart.under(x, 0)[0]);
      const { lower, upper } = DATA.steps[k];
      return [`step ${DATA.steps[k].k}`, lower ? `${shown(lower[index])} to ${shown(upper[index])}` : "no state is possible"];
    },
  });
  charts.push(chart);
});

const player = new Player({
  frames: DATA.steps.length,
  name: (k) => `step ${DATA.steps[k].k}`,
  draw(k) {
    frame = k;
    fillTable(numbers, rows(DATA.steps[k]));
    charts.forEach((chart) => chart.draw());
  },
});
