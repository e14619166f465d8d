
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
  const impulse = stage === IMPULSE ? record.impulse_m_s[at] : 0;
  const miss = record.true_predicted_miss_m[at] - (impulse * range) / record.closing_speed_m_s;
  return { rate: record.true_rate_rad_s[at] - impulse / range, angle: record.true_angle_rad[at], range, miss };
}

const swatches = {
  stroke: (colour, look = {}) => (context) =>
    drawPath(context, [[1, 6], [21, 6]], { stroke: theme.colours[colour], width: 2, ...look }),
  nearToFar: (context) => [0, 1, 2].forEach((k) =>
    drawPath(context, [[1, 2 + 4 * k], [21, 2 + 4 * k]], { stroke: ramp(1 - k / 2), width: 2 })),
  fill: (colour, opacity) => (context) =>
    drawPath(context, [[1, 1], [21, 1], [21, 11], [1, 11]], { fill: theme.colours[colour], opacity, closed: true }),
  mark: (kind, colour) => (context) => drawMark(context, 11, 6, kind, theme.colours[colour], 4),
};

/** The panels of one lateral axis of a record; `record` has the values of that axis. */
class Column {
  constructor(record, hosts) {
    const { along } = record;
    Object.assign(this, { record, along, sets: new Sets({ ...record.sections, ...record.outlines }), step: 0, stage: BEFORE });
    const { stroke, nearToFar, fill, mark } = swatches;
    this.plane = new Chart(hosts.plane, {
      caption: `Sections of the set: line-of-sight rate \u03c9 and angle \u03b1${along}`,
      label: `Sections of the information set in the plane of rate and angle${along}`,
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
    this.scene = new Scene(hosts.scene, {
      caption: `The same set over the range x${along && `: rate and angle${along}`}`,
      label: `The information set in three dimensions: rate, angle and range${along}`,
      ratio: 0.8,
      legend: [
        ["sections", nearToFar],
        ["true state and its range", mark("cross", "ink")],
        ["ranges allowed by the range meter", stroke("measured", { dash: [5, 3] })],
      ],
      draw: () => this.drawScene(),
      tell: (x, y) => this.tellScene(x, y),
    });
    this.miss = new Chart(hosts.miss, {
      caption: `Predicted miss${along} without further impulses`,
      label: `Predicted-miss interval${along} against time`,
      ratio: along ? 0.45 : 0.3,
      legend: [
        ["interval over the set", fill("set", 0.35)],
        ["true predicted miss", stroke("ink", { dash: [6, 3] })],
      ],
      draw: () => this.drawMiss(),
      tell: (x) => stepUnder(this.miss, record, x, (step) => this.missLines(step)),
    });
    this.impulses = new Chart(hosts.impulses, {
      caption: `Impulses${along}`,
      label: `Impulses${along} against time`,
      ratio: along ? 0.36 : 0.22,
      legend: [["impulse k", stroke("impulse")], ["limit of an impulse", stroke("line", { dash: [5, 3] })]],
      draw: () => this.drawImpulses(),
      tell: (x) => stepUnder(this.impulses, record, x, (step) => this.impulseLines(step)),
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
      x: rates,
      y: angles,
      xTitle: `line-of-sight rate \u03c9${this.along}, ${rateUnit[0]}`,
      yTitle: `line-of-sight angle \u03b1${this.along}, ${angleUnit[0]}`,
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
    miss.begin({ x: span, y: missLimits, xTitle: "time t, s", yTitle: `predicted miss${this.along}, m`, yScale: symlog(10) });
    for (const [points, opacity] of [[known, 0.12], [known.filter(([, , index]) => index <= this.step), 0.35]]) {
      const [lower, upper] = [0, 1].map((end) => points.map(([time, ends]) => [time, ends[end]]));
      miss.area(lower, upper, { fill: theme.colours.set, opacity });
      if (opacity > 0.2) [lower, upper].forEach((bound) => miss.curve(bound, { stroke: theme.colours.set, width: 1.3 }));
    }
    miss.level(0, { stroke: theme.colours.line, width: 1 });
    miss.curve(record.time_s.map((time, index) => [time, record.true_predicted_miss_m[index]]).slice(0, this.step + 1),
      { stroke: theme.colours.ink, width: 1.4, dash: [6, 3] });
    markNow(miss, record.time_s[this.step]);
    miss.describe(this.missLines(this.step).join(", "));
  }

  drawImpulses() {
    const { impulses, record } = this;
    const limit = record.greatest_impulse_m_s;
    impulses.begin({ x: span, y: [-1.15 * limit, 1.15 * limit], xTitle: "time t, s", yTitle: `k${this.along}, m/s` });
    impulses.level(0, { stroke: theme.colours.line, width: 1 });
    for (const side of [-limit, limit]) impulses.level(side, { stroke: theme.colours.line, width: 1, dash: [5, 3] });
    drawStems(impulses, record.time_s, record.impulse_m_s, this.step);
    markNow(impulses, record.time_s[this.step]);
    impulses.describe(this.impulseLines(this.step).join(", "));
  }

  missLines(step) {
    const { record } = this;
    const ends = record.predicted_miss_m[step];
    return [
      `t = ${shown(record.time_s[step], "s")}`,
      ends ? `predicted miss${this.along} from ${shown(ends[0], "m")} to ${shown(ends[1], "m")}` : "no set is left",
      `true predicted miss${this.along} ${shown(record.true_predicted_miss_m[step], "m")}`,
    ];
  }

  impulseLines(step) {
    const { record } = this;
    return [
      `t = ${shown(record.time_s[step], "s")}`,
      `impulse${this.along} ${shown(record.impulse_m_s[step], "m/s")}`,
      `budget left ${shown(record.budget_left_m_s[step], "m/s")}`,
    ];
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
    return [`${this.record.measured_name} ${shown(measured * angleUnit[1], angleUnit[0])}`,
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

  /** Predicted-miss intervals of the sections at the present stage, m: z + V x/e -+ nu/2 (x/e)^2, equations (13), (14). */
  missIntervals(sections) {
    const { closing_speed_m_s: e, disturbance_m_s2: nu } = this.record;
    return sections.map(({ range, box, miss }) => {
      const drift = (nu / 2) * (range / e) ** 2;
      return miss ?? [(box[0] * range ** 2) / e - drift, (box[2] * range ** 2) / e + drift];
    });
  }
}

/** Impulses as lines from zero; those after the present step are pale. */
function drawStems(chart, times, impulses, step) {
  impulses.forEach((impulse, index) => {
    if (impulse === 0) return;
    const look = { stroke: index <= step ? theme.colours.impulse : theme.colours.grid, width: 1.6 };
    chart.curve([[times[index], 0], [times[index], impulse]], look);
  });
}

/** The line of the present time; ends the drawing of a chart over time. */
function markNow(chart, time) {
  chart.upright(time, time, { stroke: theme.colours.quiet, width: 1, dash: [2, 2] });
  chart.end();
}

/** Lines about the step under the pointer in a chart over time. */
function stepUnder(chart, record, x, lines) {
  if (x < chart.left - 5 || x > chart.right + 5) return null;
  return lines(nearest(record.time_s, chart.under(x, 0)[0]));
}

/** One record: the panels of its lateral axes, what they have in common, and its table of numbers. */
class Engagement {
  constructor(record, host) {
    this.record = record;
    const spatial = record.axes.length > 1;
    const { stroke } = swatches;
    const cell = (attributes = {}) => {
      const made = element("div", attributes);
      host.append(made);
      return made;
    };
    cell({ class: "whole" }).append(
      element("h2", {}, record.title), element("p", {}, record.outcome), element("p", {}, record.facts));
    // In a plane: plane and scene side by side, all else below. In space: y and z side by side.
    const planes = record.axes.map(() => cell());
    const across = spatial ? cell() : null;
    const table = spatial ? cell() : null;
    const scenes = record.axes.map(() => cell());
    const courses = spatial ? record.axes.map(() => cell()) : [];
    const low = cell({ class: "whole" });
    this.numbers = element("table", { class: spatial ? "wide" : "", "aria-label": `Numbers at this time: ${record.title}` });
    (table ?? low).append(element("figure", {}, element("figcaption", {}, "Numbers at this time"), this.numbers));
    this.columns = record.axes.map((axis, k) => {
      const [plane, scene, course] = [planes[k], scenes[k], courses[k] ?? low];
      return new Column({ ...record, ...axis }, { plane, scene, miss: course, impulses: course });
    });
    this.joint = spatial ? [new BPlane(record, this.columns, across)] : [];
    const overTime = (caption, label, legend, draw) => {
      const chart = new Chart(low, {
        caption, label, ratio: 0.2, legend, draw: () => draw(chart),
        tell: (x) => stepUnder(chart, record, x, (step) => this.impulseLines(step)),
      });
      return chart;
    };
    this.courses = [
      ...(spatial ? [overTime("Impulse modulus", "Modulus of the impulse against time",
        [["modulus of the impulse vector", stroke("impulse")], ["limit of an impulse", stroke("line", { dash: [5, 3] })]],
        (chart) => this.drawModulus(chart))] : []),
      overTime("Budget left", "Impulse budget left against time", [["budget left", stroke("extra")]],
        (chart) => this.drawBudget(chart)),
    ];
  }

  show(frame) {
    for (const column of this.columns) column.show(frame);
    this.step = this.columns[0].step;
  }

  draw() {
    for (const column of this.columns) {
      column.plane.draw();
      column.scene.draw();
    }
    for (const panel of this.joint) panel.chart.draw();
    // What is drawn over time does not change with the stage.
    if (this.step !== this.drawnStep) {
      for (const panel of [...this.columns.flatMap(({ miss, impulses }) => [miss, impulses]), ...this.courses]) panel.draw();
    }
    this.drawnStep = this.step;
    fillTable(this.numbers, this.rows());
  }

  drawModulus(chart) {
    const { record } = this;
    const limit = record.greatest_impulse_m_s;
    chart.begin({ x: span, y: [0, 1.15 * limit], xTitle: "time t, s", yTitle: "|k|, m/s" });
    chart.level(limit, { stroke: theme.colours.line, width: 1, dash: [5, 3] });
    drawStems(chart, record.time_s, record.modulus_m_s, this.step);
    markNow(chart, record.time_s[this.step]);
    chart.describe(this.impulseLines(this.step).join(", "));
  }

  drawBudget(chart) {
    const { record } = this;
    chart.begin({ x: span, y: [0, 1.06 * record.budget_m_s], xTitle: "time t, s", yTitle: "left, m/s" });
    let left = record.budget_m_s;
    const stairs = record.time_s.flatMap((time, index) => {
      const before = left;
      left = record.budget_left_m_s[index];
      return [[time, before, index], [time, left, index]];
    });
    chart.curve(stairs, { stroke: theme.colours.grid, width: 2 });
    chart.curve(stairs.filter(([, , index]) => index <= this.step), { stroke: theme.colours.extra, width: 2 });
    markNow(chart, record.time_s[this.step]);
    chart.describe(this.impulseLines(this.step).join(", "));
  }

  impulseLines(step) {
    const { record, columns } = this;
    const [time, ...impulses] = columns.flatMap((column, k) => column.impulseLines(step).slice(k ? 1 : 0, 2));
    const modulus = columns.length > 1 ? [`impulse modulus ${shown(record.modulus_m_s[step], "m/s")}`] : [];
    return [time, ...impulses, ...modulus, `budget left ${shown(record.budget_left_m_s[step], "m/s")}`];
  }

  /** The numbers of the moment, for those who read rather than look. */
  rows() {
    const { record, step, columns } = this;
    const along = (name, text) => columns.map((column) => [`${name}${column.along}`, text(column)]);
    const scaled = (value, factor, unit) => shown(value && value * factor, unit);
    return [
      ["time", shown(record.time_s[step], "s")],
      ...columns.map(({ record: of }) => [of.measured_name, scaled(of.measured_angle_rad[step], 1e3, "mrad")]),
      ...(record.range_error_relative === null ? [] : [["measured range", scaled(record.measured_range_m[step], 1e-3, "km")]]),
      ...(record.rate_error_rad_s === null ? [] : along("measured rate",
        (column) => scaled(column.record.measured_rate_rad_s[step], 1e6, "µrad/s"))),
      ...along("true angle", ({ truth }) => shown(truth.angle * 1e3, "mrad")),
      ...along("true rate", ({ truth }) => shown(truth.rate * 1e6, "µrad/s")),
      ["true range", shown(columns[0].truth.range / 1e3, "km")],
      ...along("predicted miss", (column) => column.missLines(step)[1].replace(`predicted miss${column.along} `, "")),
      ...along("true predicted miss", (column) => shown(column.record.true_predicted_miss_m[step], "m")),
      ...along("impulse", (column) => shown(column.record.impulse_m_s[step], "m/s")),
      ...(columns.length > 1 ? [["impulse modulus", shown(record.modulus_m_s[step], "m/s")]] : []),
      ["budget left", shown(record.budget_left_m_s[step], "m/s")],
      ["sections", String(columns[0].sections.length)],
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
  const ends = DATA.records.flatMap((record) => record.axes.flatMap((axis) => axis.predicted_miss_m.filter((each) => each).flat()));
  const greatest = Math.max(10, ...ends.map(Math.abs));
  return [-2 * greatest, 2 * greatest];
})();

const main = document.getElementById("main");
const host = element("div", { class: DATA.records.length > 1 ? "columns" : "columns single" });
const engagements = DATA.records.map((record) => {
  const section = element("section");
  host.append(section);
  return new Engagement(record, section);
});
const columns = engagements.flatMap((engagement) => engagement.columns);

const player = new Player({
  frames: 4 * times.length,
  coarse: 4,
  name: (frame) => `t = ${timeAndStage(frame)[0]} s, ${STAGES[timeAndStage(frame)[1]]}`,
  draw: (frame) => {
    for (const engagement of engagements) engagement.show(frame);
    for (const axis of new Set(columns.map((column) => column.record.axis))) {
      const same = columns.filter((column) => column.record.axis === axis);
      const together = levelled(same);
      for (const column of same) column.limits = options.own ? levelled([column]) : together;
    }
    const joint = engagements.flatMap((engagement) => engagement.joint);
    for (const panel of joint) panel.shareLimits(options.own ? [panel] : joint);
    for (const engagement of engagements) engagement.draw();
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
    ...(engagements.length > 1 ? [choice("Axes", [["", "the same for both"], ["1", "each its own"]], "", pick("own"))] : [])),
  host,
  element("p", {}, "Keys: space plays and pauses; left and right go a stage on, with Shift a step; Home and End go to the ends."),
);
