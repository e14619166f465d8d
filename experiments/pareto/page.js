
"use strict";
// The encounter: the user drags the meeting in the plane of its first two free components; costs and paths follow.

let point = DATA.point.slice();

/** Return the excess of a craft, its cost minus that of its own cheapest meeting: |R (p - p*)|^2. */
function excessOf({ root, ideal }, meeting) {
  const apart = meeting.map((value, index) => value - ideal[index]);
  return root.reduce((sum, row) => sum + row.reduce((dot, value, index) => dot + value * apart[index], 0) ** 2, 0);
}

const costOf = (craft, meeting) => craft.ideal_cost_squared + excessOf(craft, meeting);
const groupLoss = (meeting) => DATA.craft.reduce((sum, craft) => sum + craft.weight * excessOf(craft, meeting), 0);

/** Return the meetings with the same cost for a craft, an ellipse around its ideal, if two components are free. */
function equalCosts(craft, meeting) {
  const [[a, b], [, d]] = craft.root;
  const radius = Math.sqrt(excessOf(craft, meeting));
  return Array.from({ length: 97 }, (_, k) => {
    const [u, v] = [radius * Math.cos((2 * Math.PI * k) / 96), radius * Math.sin((2 * Math.PI * k) / 96)];
    return [craft.ideal[0] + (u - (b * v) / d) / a, craft.ideal[1] + v / d];
  });
}

/** Return a meeting as a point of the plane; with one free component, a point of a line. */
const flat = (meeting) => [meeting[0], meeting[1] ?? 0];

const plane = {
  limits: (() => {
    const points = [...DATA.craft.map(({ ideal }) => ideal), ...DATA.selections.map((selection) => selection.point)].map(flat);
    return [0, 1].map((axis) => limitsOf(points.map((at) => at[axis]), 0.35));
  })(),

  draw(chart) {
    const [first, second] = DATA.free;
    chart.begin({
      x: plane.limits[0], y: plane.limits[1], equal: second?.unit === first.unit,
      xTitle: `${first.name} of the meeting, ${first.unit}`, yTitle: second ? `${second.name} of the meeting, ${second.unit}` : "",
    });
    if (DATA.pareto_hull) {
      chart.curve(DATA.pareto_hull, { fill: theme.colours.set, opacity: 0.18, stroke: theme.colours.line, width: 1, closed: true });
    }
    for (const optimal of DATA.pareto_points) {
      const [x, y] = flat(optimal);
      chart.path([[chart.across(x) - 1, chart.up(y)], [chart.across(x) + 1, chart.up(y)]], { stroke: theme.colours.line, width: 2 });
    }
    DATA.craft.forEach((craft, index) => {
      const colour = colourOf(index);
      if (DATA.free.length === 2) chart.curve(equalCosts(craft, point), { stroke: colour, width: 1.3, dash: lookOf(index).dash });
      chart.point(...flat(craft.ideal), lookOf(index).mark, colour);
    });
    for (const selection of DATA.selections) chart.point(...flat(selection.point), "cross", theme.colours.quiet);
    chart.point(...flat(point), "diamond", theme.colours.ink);
    chart.end();
    chart.describe(rows().map((row) => row.join(" ")).join(", "));
  },

  tell(x, y) {
    const chart = panel;
    const near = [
      ...DATA.craft.map(({ name, ideal }) => [`cheapest meeting of ${name}`, ideal]),
      ...DATA.selections.map((selection) => [selection.name, selection.point]),
      ["meeting", point],
    ].filter(([, at]) => Math.hypot(chart.across(flat(at)[0]) - x, chart.up(flat(at)[1]) - y) < 10);
    return near.length ? near.flatMap(([name, at]) => [name, ...DATA.free.map((component, k) => `${component.name} = ${shown(at[k], component.unit)}`)]) : null;
  },
};

/** Return the numbers of the current meeting. */
function rows() {
  return [
    ...DATA.free.map(({ name, unit }, index) => [`${name} of the meeting`, shown(point[index], unit)]),
    ["group loss", shown(groupLoss(point), "m\u00b2/s\u00b3")],
    ...DATA.craft.flatMap((craft) => [
      [`J\u00b2 of ${craft.name}`, shown(costOf(craft, point), "m\u00b2/s\u00b3")],
      [`excess of ${craft.name}`, shown(excessOf(craft, point), "m\u00b2/s\u00b3")],
    ]),
  ];
}

const main = document.getElementById("main");
const inputs = DATA.free.map(({ name, unit }, index) => {
  const input = element("input", { type: "number", step: "any", input: () => {
    if (input.value !== "" && Number.isFinite(Number(input.value))) moveTo(point.map((value, k) => (k === index ? Number(input.value) : value)), input);
  } });
  return { input, label: element("label", {}, `${name}, ${unit} `, input) };
});
const top_ = element("div", { class: "columns" });
const costs = element("table", { "aria-label": "Costs of this meeting", "aria-live": "polite" });
const panel = new Chart(top_, {
  caption: "Meeting (drag to move)",
  label: "Plane of the meetings",
  ratio: 0.8,
  legend: [
    ["meeting", (context) => drawMark(context, 11, 6, "diamond", theme.colours.ink, 4)],
    ["Pareto-optimal meetings", (context) => drawPath(context, [[1, 1], [21, 1], [21, 11], [1, 11]],
      { fill: theme.colours.set, opacity: 0.25, stroke: theme.colours.line, width: 1, closed: true })],
    ...DATA.craft.slice(0, 8).map(({ name }, index) => lookKey(`cheapest meeting of ${name}, and curve of equal cost`, index)),
    ["other choices", (context) => drawMark(context, 11, 6, "cross", theme.colours.quiet, 4)],
  ],
  draw: plane.draw,
  tell: plane.tell,
});
const side = element("figure", {}, element("figcaption", {}, "Costs of this meeting"), costs);
top_.append(side);
main.append(
  element("div", { class: "choices" }, ...inputs.map(({ label }) => label),
    choice("Go to", [["", "\u2026"], ...DATA.selections.map(({ name }, index) => [String(index), name]),
      ...DATA.craft.map(({ name }, index) => [String(DATA.selections.length + index), `cheapest meeting of ${name}`])], "", (value) => {
      const points = [...DATA.selections.map((selection) => selection.point), ...DATA.craft.map(({ ideal }) => ideal)];
      if (value !== "") moveTo(points[Number(value)].slice());
    })),
  top_,
);
const { player, panels } = buildMotion(main);

/** Change the meeting and update costs, paths and drawings; `typed` is the input field of the change, if any. */
function moveTo(meeting, typed = null) {
  point = meeting;
  const at = (base, slope) => base.map((value, axis) => value + slope[axis].reduce((sum, factor, k) => sum + factor * point[k], 0));
  for (const viewer of panels) {
    const { view } = viewer;
    view.tracks.forEach((track, index) => {
      const craft = DATA.craft[index];
      track.points = craft.path_base_m.map((base, moment) => at(base, craft.path_slope[moment]));
    });
    view.marks[0].point = at(DATA.meeting_base_m, DATA.opening);
    viewer.fit();
  }
  inputs.forEach(({ input }, index) => { if (input !== typed) input.value = Number(point[index].toPrecision(8)); });
  fillTable(costs, rows());
  panel.draw();
  player.show(player.frame);
}

panel.canvas.style.touchAction = "none";
panel.canvas.style.cursor = "grab";
for (const name of ["pointerdown", "pointermove"]) {
  panel.canvas.addEventListener(name, (event) => {
    if (name === "pointerdown") panel.canvas.setPointerCapture(event.pointerId);
    if (!panel.canvas.hasPointerCapture(event.pointerId)) return;
    const box = panel.canvas.getBoundingClientRect();
    const [x, y] = panel.under(event.clientX - box.left, event.clientY - box.top);
    moveTo(point.map((value, index) => [x, y][index] ?? value));
  });
}
moveTo(point);
