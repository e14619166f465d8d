
"use strict";
// The replay of one engagement, or of two side by side.

const STAGES = ["before the measurement", "after the measurement", "after the impulse", "after the prediction"];
const BEFORE = 0;
const MEASURED = 1;
const IMPULSE = 2;
const PREDICTED = 3;

const options = { sections: 7, single: null, stage: null, own: null };
const times = [...new Set(DATA.records.flatMap((record) => record.time_s))].sort((a, b) => a - b);

/** The time and the stage of a frame: four frames a step, or one where a single stage is looked at. */
function timeAndStage(frame) {
  return options.stage === null ? [times[Math.floor(frame / 4)], frame % 4] : [times[frame], options.stage];
}

/** Which step of a record, and which stage of it, a frame shows; after its end, the end. */
function moment(record, frame) {
  const [time, stage] = timeAndStage(frame);
  let step = record.time_s.length - 1;
  if (record.time_s[step] < time) return { step, stage: PREDICTED };
  while (step > 0 && record.time_s[step] > time) step -= 1;
  return { step, stage };
}

/** Values of the truth at a moment, SI: after the impulse its rate is less by k/x. */
function truthAt(record, { step, stage }) {
  const at = stage === PREDICTED ? Math.min(step + 1, record.time_s.length - 1) : step;
  const range = record.true_range_m[at];
  const rate = record.true_rate_rad_s[at] - (stage === IMPULSE ? record.impulse_m_s[at] / range : 0);
  return { rate, angle: record.true_angle_rad[at], range };
}

/** One record: its panels and its table of numbers. */
class Column {
  constructor(record, host) {
    Object.assign(this, { record, sets: new Sets(record.sets), step: 0, stage: BEFORE });
    const half = element("div");
    const other = element("div");
    const low = element("div", { class: "whole" });
    host.append(element("div", { class: "whole" }, element("h2", {}, record.title), element("p", {}, record.outcome),
      element("p", {}, record.facts)), half, other, low);
    const stroke = (colour, look = {}) => (context) =>
      drawPath(context, [[1, 6], [21, 6]], { stroke: theme.colours[colour], width: 2, ...look });
    const nearToFar = (context) => [0, 1, 2].forEach((k) =>
      drawPath(context, [[1, 2 + 4 * k], [21, 2 + 4 * k]], { stroke: ramp(1 - k / 2), width: 2 }));
    const fill = (colour, opacity) => (context) =>
      drawPath(context, [[1, 1], [21, 1], [21, 11], [1, 11]], { fill: theme.colours[colour], opacity, closed: true });
    const mark = (kind, colour) => (context) => drawMark(context, 11, 6, kind, theme.colours[colour], 4);
    this.plane = new Chart(half, {
      caption: "Sections of the set: line-of-sight rate \u03c9 and angle \u03b1",
      label: "Sections of the information set in the plane of rate and angle",
      ratio: 0.8,
      legend: [
        ["sections (lowest line: the nearest one)", nearToFar],
        ["before the measurement", stroke("quiet", { dash: [3, 3], width: 1.2 })],
        ["truth", mark("cross", "ink")],
        ["states allowed by the measurement", fill("measured", 0.3)],
      ],
      draw: () => this.drawPlane(),
      tell: (x, y) => this.tellPlane(x, y),
    });
    this.scene = new Scene(other, {
      caption: "The same set over the range x",
      label: "The information set in three dimensions: rate, angle and range",
      ratio: 0.8,
      legend: [
        ["sections", nearToFar],
        ["true state and its range", mark("cross", "ink")],
        ["ranges allowed by the range meter", stroke("measured", { dash: [5, 3] })],
      ],
      draw: () => this.drawScene(),
      tell: (x, y) => this.tellScene(x, y),
    });
    this.numbers = element("table", { "aria-label": `Numbers at this time: ${record.title}` });
    low.append(element("figure", {}, element("figcaption", {}, "Numbers at this time"), this.numbers));
    this.miss = new Chart(low, {
      caption: "Predicted miss without further impulses",
      label: "Predicted-miss interval against time",
      ratio: 0.3,
      legend: [
        ["interval over the set", fill("set", 0.35)],
        ["true predicted miss", stroke("ink", { dash: [6, 3] })],
      ],
      draw: () => this.drawMiss(),
      tell: (x) => this.tellTime(x, (step) => this.missLines(step)),
    });
    this.impulses = new Chart(low, {
      caption: "Impulses",
      label: "Impulses against time",
      ratio: 0.22,
      legend: [["impulse k", stroke("impulse")], ["limit of an impulse", stroke("line", { dash: [5, 3] })]],
      draw: () => this.drawImpulses(),
      tell: (x) => this.tellTime(x, (step) => this.impulseLines(step)),
    });
    this.budget = new Chart(low, {
      caption: "Budget left",
      label: "Impulse budget left against time",
      ratio: 0.2,
      legend: [["budget left", stroke("extra")]],
      draw: () => this.drawBudget(),
      tell: (x) => this.tellTime(x, (step) => this.impulseLines(step)),
    });
  }

  show(frame) {
    Object.assign(this, moment(this.record, frame));
    this.sections = this.sectionsAt(this.stage);
    this.ghost = this.stage === MEASURED ? this.sectionsAt(BEFORE) : [];
    this.truth = truthAt(this.record, this);
  }

  /** All sections at a stage of the present step. */
  sectionsAt(stage) {
    if (stage === IMPULSE) return shifted(this.sets.state(2 * this.step + 1), this.record.impulse_m_s[this.step]);
    return this.sets.state(2 * this.step + { [BEFORE]: 0, [MEASURED]: 1, [PREDICTED]: 2 }[stage]);
  }

  /** The sections that are drawn, or the one singled out. */
  chosen(sections) {
    if (options.single === null || !sections.length) return chosenOf(sections, options.sections);
    return [sections[Math.min(sections.length - 1, Math.max(0, options.single))]];
  }

  /** Limits of rate and angle over all stages of the step, so that what a stage changes is seen to change. */
  extents() {
    const wanted = this.stage === PREDICTED ? [PREDICTED] : [BEFORE, MEASURED, IMPULSE];
    const boxes = wanted.flatMap((stage) => this.chosen(this.sectionsAt(stage)).map((section) => section.box));
    return {
      rates: [...boxes.flatMap((box) => [box[0], box[2]]), this.truth.rate],
      angles: [...boxes.flatMap((box) => [box[1], box[3]]), this.truth.angle],
    };
  }

  drawPlane() {
    const { plane, truth, record } = this;
    const { rates, angles, rateUnit, angleUnit } = this.limits;
    plane.begin({
      x: rates, y: angles, xTitle: `line-of-sight rate \u03c9, ${rateUnit[0]}`, yTitle: `line-of-sight angle \u03b1, ${angleUnit[0]}`,
    });
    const place = ([rate, angle]) => [rate * rateUnit[1], angle * angleUnit[1]];
    const drawn = this.chosen(this.sections);
    if (this.stage === MEASURED) this.drawBands(drawn, place);
    for (const section of this.chosen(this.ghost)) {
      plane.curve(section.points.map(place), { stroke: theme.colours.quiet, width: 1.1, dash: [3, 3], closed: true });
    }
    drawn.forEach((section, index) => {
      const colour = ramp(drawn.length > 1 ? index / (drawn.length - 1) : 0);
      plane.curve(section.points.map(place), { stroke: colour, fill: colour, opacity: 0.07, width: 1.6, closed: true });
      if (section.points.length < 3) plane.point(...place(section.points[0]), "dot", colour);
    });
    plane.point(...place([truth.rate, truth.angle]), "cross", theme.colours.ink);
    plane.end();
    if (!drawn.length) plane.text("no section is left", plane.width / 2, 26);
    plane.describe(`${STAGES[this.stage]} at ${record.time_s[this.step]} s: ${this.sections.length} sections`);
  }

  /** The band of angles, and of rates, that the measurement allows at the nearest and farthest section drawn. */
  drawBands(drawn, place) {
    const { plane, record, step } = this;
    const [angle, rate] = [record.measured_angle_rad[step], record.measured_rate_rad_s[step]];
    const ends = drawn.length > 1 ? [drawn[0], drawn[drawn.length - 1]] : drawn;
    const look = { fill: theme.colours.measured, opacity: 0.13, stroke: theme.colours.measured, width: 1, closed: true };
    for (const { range } of angle === null ? [] : ends) {
      plane.band(...[-1, 1].map((sign) => place([0, angle + sign * this.errorAt(range)])[1]), look);
    }
    if (rate !== null) {
      plane.upright(...[-1, 1].map((sign) => place([rate + sign * record.rate_error_rad_s, 0])[0]), look);
    }
  }

  drawScene() {
    const { scene, record, truth, step } = this;
    const { rates, angles, ranges, rateUnit, angleUnit } = this.limits;
    const place = (rate, angle, range) => [rate * rateUnit[1], range / 1e3, angle * angleUnit[1]];
    scene.begin([rates, ranges, angles], [`\u03c9, ${rateUnit[0]}`, "range x, km", `\u03b1, ${angleUnit[0]}`], [1, 1.25, 0.85]);
    const drawn = this.chosen(this.sections);
    const order = drawn.map((section, index) => [section, drawn.length > 1 ? index / (drawn.length - 1) : 0]);
    const depth = ([section]) => scene.at(place(...section.points[0], section.range))[2];
    order.sort((one, two) => depth(one) - depth(two));
    for (const [section, share] of order) {
      const outline = section.points.map(([rate, angle]) => place(rate, angle, section.range));
      scene.curve(outline, { stroke: ramp(share), fill: ramp(share), opacity: 0.16, width: 1.4, closed: true });
    }
    const measured = record.measured_range_m[step];
    if (measured !== null && this.stage === MEASURED) {
      for (const range of [measured / (1 + record.range_error_relative), measured / (1 - record.range_error_relative)]) {
        if (range / 1e3 < ranges[0] || range / 1e3 > ranges[1]) continue;
        const frame = [[0, 0], [1, 0], [1, 1], [0, 1]].map(([a, b]) => [rates[a], range / 1e3, angles[b]]);
        scene.curve(frame, { stroke: theme.colours.measured, dash: [5, 3], width: 1.3, closed: true });
      }
    }
    const at = place(truth.rate, truth.angle, truth.range);
    scene.curve([at, [at[0], at[1], angles[0]]], { stroke: theme.colours.ink, width: 1, dash: [2, 3] });
    scene.mark(...scene.at(at).slice(0, 2), "cross", theme.colours.ink);
    scene.describe(`${this.sections.length} sections over ranges from ${shown(ranges[0], "km")} to ${shown(ranges[1], "km")}`);
  }

  drawMiss() {
    const { miss, record } = this;
    const known = record.time_s.map((time, index) => [time, record.predicted_miss_m[index], index]).filter(([, ends]) => ends);
    miss.begin({ x: span, y: missLimits, xTitle: "time t, s", yTitle: "predicted miss, m", yScale: symlog(10) });
    for (const [points, opacity] of [[known, 0.12], [known.filter(([, , index]) => index <= this.step), 0.35]]) {
      const [lower, upper] = [0, 1].map((end) => points.map(([time, ends]) => [time, ends[end]]));
      miss.area(lower, upper, { fill: theme.colours.set, opacity });
      if (opacity > 0.2) [lower, upper].forEach((bound) => miss.curve(bound, { stroke: theme.colours.set, width: 1.3 }));
    }
    miss.level(0, { stroke: theme.colours.line, width: 1 });
    miss.curve(record.time_s.map((time, index) => [time, record.true_predicted_miss_m[index]]).slice(0, this.step + 1),
      { stroke: theme.colours.ink, width: 1.4, dash: [6, 3] });
    this.now(miss);
    miss.describe(this.missLines(this.step).join(", "));
  }

  drawImpulses() {
    const { impulses, record } = this;
    const limit = record.greatest_impulse_m_s;
    impulses.begin({ x: span, y: [-1.15 * limit, 1.15 * limit], xTitle: "time t, s", yTitle: "k, m/s" });
    impulses.level(0, { stroke: theme.colours.line, width: 1 });
    for (const side of [-limit, limit]) impulses.level(side, { stroke: theme.colours.line, width: 1, dash: [5, 3] });
    record.impulse_m_s.forEach((impulse, index) => {
      if (impulse === 0) return;
      const look = { stroke: index <= this.step ? theme.colours.impulse : theme.colours.grid, width: 1.6 };
      impulses.curve([[record.time_s[index], 0], [record.time_s[index], impulse]], look);
    });
    this.now(impulses);
    impulses.describe(this.impulseLines(this.step).join(", "));
  }

  drawBudget() {
    const { budget, record } = this;
    budget.begin({ x: span, y: [0, 1.06 * record.budget_m_s], xTitle: "time t, s", yTitle: "left, m/s" });
    let left = record.budget_m_s;
    const stairs = record.time_s.flatMap((time, index) => {
      const before = left;
      left = record.budget_left_m_s[index];
      return [[time, before, index], [time, left, index]];
    });
    budget.curve(stairs, { stroke: theme.colours.grid, width: 2 });
    budget.curve(stairs.filter(([, , index]) => index <= this.step), { stroke: theme.colours.extra, width: 2 });
    this.now(budget);
    budget.describe(this.impulseLines(this.step).join(", "));
  }

  /** The line of the present time; ends the drawing of a chart over time. */
  now(chart) {
    const time = this.record.time_s[this.step];
    chart.upright(time, time, { stroke: theme.colours.quiet, width: 1, dash: [2, 2] });
    chart.end();
  }

  missLines(step) {
    const { record } = this;
    const ends = record.predicted_miss_m[step];
    return [
      `t = ${shown(record.time_s[step], "s")}`,
      ends ? `predicted miss from ${shown(ends[0], "m")} to ${shown(ends[1], "m")}` : "no set is left",
      `true predicted miss ${shown(record.true_predicted_miss_m[step], "m")}`,
    ];
  }

  impulseLines(step) {
    const { record } = this;
    return [
      `t = ${shown(record.time_s[step], "s")}`,
      `impulse ${shown(record.impulse_m_s[step], "m/s")}`,
      `budget left ${shown(record.budget_left_m_s[step], "m/s")}`,
    ];
  }

  tellTime(x, lines) {
    const { miss, record } = this;
    if (x < miss.left - 5 || x > miss.right + 5) return null;
    return lines(nearest(record.time_s, miss.under(x, 0)[0]));
  }

  tellPlane(px, py) {
    const { plane, truth } = this;
    const { rateUnit, angleUnit } = this.limits;
    const at = [plane.across(truth.rate * rateUnit[1]), plane.up(truth.angle * angleUnit[1])];
    if (Math.hypot(at[0] - px, at[1] - py) < 9) return this.truthLines();
    const [x, y] = plane.under(px, py);
    const found = this.chosen(this.sections).filter(({ points }) => inside(points, x / rateUnit[1], y / angleUnit[1]));
    const area = ({ box }) => (box[2] - box[0]) * (box[3] - box[1]);
    if (found.length) return this.sectionLines(found.reduce((best, each) => (area(each) < area(best) ? each : best)));
    const error = this.errorAt(truth.range);
    const measured = this.record.measured_angle_rad[this.step];
    if (this.stage !== MEASURED || measured === null || Math.abs(y / angleUnit[1] - measured) > error) return null;
    return [`measured angle ${shown(measured * angleUnit[1], angleUnit[0])}`,
      `error at most ${shown(error * angleUnit[1], angleUnit[0])} at x = ${shown(truth.range / 1e3, "km")}`];
  }

  errorAt(range) {
    return this.record.angle_error_rad + this.record.angle_error_slope_rad_m * range;
  }

  tellScene(px, py) {
    const { scene, truth } = this;
    const { rateUnit, angleUnit } = this.limits;
    const place = (rate, angle, range) => scene.at([rate * rateUnit[1], range / 1e3, angle * angleUnit[1]]);
    const at = place(truth.rate, truth.angle, truth.range);
    if (Math.hypot(at[0] - px, at[1] - py) < 9) return this.truthLines();
    const near = this.chosen(this.sections).filter((section) =>
      inside(section.points.map((point) => place(...point, section.range)), px, py));
    const depth = (section) => place(...section.points[0], section.range)[2];
    return near.length ? this.sectionLines(near.reduce((best, each) => (depth(each) > depth(best) ? each : best))) : null;
  }

  truthLines() {
    const { rateUnit, angleUnit } = this.limits;
    const { rate, angle, range } = this.truth;
    return [
      "truth",
      `\u03c9 = ${shown(rate * rateUnit[1], rateUnit[0])}`,
      `\u03b1 = ${shown(angle * angleUnit[1], angleUnit[0])}`,
      `x = ${shown(range / 1e3, "km")}`,
    ];
  }

  sectionLines({ label, range, box, points, miss }) {
    const { rateUnit, angleUnit } = this.limits;
    return [
      `section at x = ${shown(range / 1e3, "km")} (${shown(label / 1e3, "km")} at t = 0)`,
      `\u03c9 from ${shown(box[0] * rateUnit[1])} to ${shown(box[2] * rateUnit[1], rateUnit[0])}`,
      `\u03b1 from ${shown(box[1] * angleUnit[1])} to ${shown(box[3] * angleUnit[1], angleUnit[0])}`,
      ...(miss ? [`predicted miss from ${shown(miss[0])} to ${shown(miss[1], "m")}`] : []),
      `${points.length} vertices`,
    ];
  }

  /** The numbers of the moment, for those who read rather than look. */
  rows() {
    const { record, step, truth } = this;
    const [, interval, trueMiss] = this.missLines(step);
    return [
      ["time", shown(record.time_s[step], "s")],
      ["measured angle", shown(record.measured_angle_rad[step] && record.measured_angle_rad[step] * 1e3, "mrad")],
      ...(record.range_error_relative === null ? [] : [
        ["measured range", shown(record.measured_range_m[step] && record.measured_range_m[step] / 1e3, "km")]]),
      ...(record.rate_error_rad_s === null ? [] : [
        ["measured rate", shown(record.measured_rate_rad_s[step] && record.measured_rate_rad_s[step] * 1e6, "\u00b5rad/s")]]),
      ["true angle", shown(truth.angle * 1e3, "mrad")],
      ["true rate", shown(truth.rate * 1e6, "\u00b5rad/s")],
      ["true range", shown(truth.range / 1e3, "km")],
      ["predicted miss", interval.replace("predicted miss ", "")],
      ["true predicted miss", trueMiss.replace("true predicted miss ", "")],
      ["impulse", shown(record.impulse_m_s[step], "m/s")],
      ["budget left", shown(record.budget_left_m_s[step], "m/s")],
      ["sections", String(this.sections.length)],
    ];
  }
}

/** Limits and units that columns share, so that side by side compares like with like. */
function levelled(columns) {
  const extents = columns.map((column) => column.extents());
  const rates = extents.flatMap((each) => each.rates);
  const angles = extents.flatMap((each) => each.angles);
  const size = (values) => Math.max(...values) - Math.min(...values) || Math.abs(values[0]);
  const [rateUnit, angleUnit] = [unitFor(size(rates), RATES), unitFor(size(angles), ANGLES)];
  const ranges = columns.flatMap((column) => [...column.sections.map(({ range }) => range / 1e3), column.truth.range / 1e3]);
  return {
    rateUnit,
    angleUnit,
    rates: limitsOf(rates.map((value) => value * rateUnit[1])),
    angles: limitsOf(angles.map((value) => value * angleUnit[1])),
    ranges: limitsOf(ranges, 0.02),
  };
}

const span = limitsOf(times, 0.015);
const missLimits = (() => {
  const ends = DATA.records.flatMap((record) => record.predicted_miss_m.filter((each) => each).flat());
  const greatest = Math.max(10, ...ends.map(Math.abs));
  return [-2 * greatest, 2 * greatest];
})();

const main = document.getElementById("main");
const host = element("div", { class: DATA.records.length > 1 ? "columns" : "columns single" });
const columns = DATA.records.map((record) => {
  const section = element("section");
  host.append(section);
  return new Column(record, section);
});

const player = new Player({
  frames: 4 * times.length,
  coarse: 4,
  name: (frame) => `t = ${timeAndStage(frame)[0]} s, ${STAGES[timeAndStage(frame)[1]]}`,
  draw: (frame) => {
    columns.forEach((column) => column.show(frame));
    const together = levelled(columns);
    for (const column of columns) column.limits = options.own ? levelled([column]) : together;
    for (const column of columns) {
      column.plane.draw();
      column.scene.draw();
      // What is drawn over time does not change with the stage.
      if (column.step !== column.drawnStep) for (const panel of [column.miss, column.impulses, column.budget]) panel.draw();
      column.drawnStep = column.step;
      fillTable(column.numbers, column.rows());
    }
  },
});

const pick = (name) => (value) => {
  options[name] = value === "" ? null : Number(value);
  player.show(player.frame);
};
main.append(
  element("div", { class: "choices" },
    choice("Sections drawn", [["1", "1"], ["3", "3"], ["5", "5"], ["7", "7"], ["11", "11"], ["1000", "all"]], "7", pick("sections")),
    choice("Alone", [["", "none"], ...Array.from({ length: 40 }, (_, k) => [String(k), `section ${k + 1}`])], "", pick("single")),
    choice("Stages of a step", [["", "all four in turn"], ...STAGES.map((name, k) => [String(k), name])], "", (value) => {
      const time = times.indexOf(timeAndStage(player.frame)[0]);
      options.stage = value === "" ? null : Number(value);
      player.count(options.stage === null ? 4 : 1, times.length, time);
    }),
    ...(columns.length > 1 ? [choice("Axes", [["", "the same for both"], ["1", "each its own"]], "", pick("own"))] : [])),
  host,
  element("p", {}, "Keys: space plays and pauses; left and right go a stage on, with Shift a step; Home and End go to the ends."),
);
