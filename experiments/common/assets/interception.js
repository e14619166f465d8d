
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
  if (stage === PREDICTED) {
    return { rate: record.next_rate_rad_s[step], angle: record.next_angle_rad[step], range: record.next_range_m[step],
      miss: record.next_predicted_miss_m[step] };
  }
  const range = record.true_range_m[step];
  const impulse = stage === IMPULSE ? record.impulse_m_s[step] : 0;
  const miss = record.true_predicted_miss_m[step] - (impulse * range) / record.closing_speed_m_s;
  return { rate: record.true_rate_rad_s[step] - impulse / range, angle: record.true_angle_rad[step], range, miss };
}

const DURATIONS = [["d", 86400], ["h", 3600], ["min", 60], ["s", 1]];
const TICKS_S = [864000, 86400, 21600, 3600, 600, 60, 10, 1, 0.1];

/** A time in the maximum unit of which it has exactly one or at least two. */
function durationText(seconds) {
  const [name, unit] = DURATIONS.find(([, size]) => seconds === size || seconds >= 2 * size) ?? ["s", 1];
  return shown(seconds / unit, name, 3);
}

/** The position of a time on a time axis: linear, or logarithmic in the time before the nominal arrival. */
function timePlace(record, time) {
  return DATA.counts_down ? -Math.log10(Math.max(record.arrival_s - time, record.min_to_go_s)) : time;
}
for (const record of DATA.records) record.places = record.time_s.map((time) => timePlace(record, time));

/** What time axes have in common. */
const timeAxis = () => (DATA.counts_down
  ? { x: span, xTitle: "time before the nominal arrival", xTicks: spanTicks }
  : { x: span, xTitle: "time t, s" });

/** A time of a record as text. */
function timeText(record, time) {
  const text = `t = ${shown(time, "s")}`;
  const left = record.arrival_s - time;
  return DATA.counts_down && left > 0 ? `${text} (${durationText(left)} before arrival)` : text;
}

/** Lines at the times of the schedule: images and cut-off. */
function drawMarks(chart, record) {
  for (const [name, text, before] of record.marks) {
    const at = timePlace(record, record.arrival_s - before);
    chart.upright(at, at, { stroke: theme.colours.line, width: 1, dash: [2, 3] });
    chart.text(`${name}, ${text}`, chart.across(at) - 7, chart.top + 4, { align: "right", turn: -Math.PI / 2 });
  }
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
        ...(this.record.range_error_relative === null
          ? []
          : [["ranges allowed by the range sensor", stroke("measured", { dash: [5, 3] })]]),
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
        ...(record.members.length ? [
          ["without a class of images", stroke("quiet", { width: 1 })],
          ["without suspected images", stroke("extra", { width: 1.6 })],
          ["refuted by the next image", mark("cross", "impulse")],
        ] : []),
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
    const states = this.sets.states.subarray(3 * this.step, 3 * this.step + 3);
    if (stage === IMPULSE) return shifted(this.sets.state(states[1]), this.record.impulse_m_s[this.step]);
    return this.sets.state(states[{ [BEFORE]: 0, [MEASURED]: 1, [PREDICTED]: 2 }[stage]]);
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
      yTitle: `line-of-sight angle α${this.along}, ${angleUnit[0]}`,
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
      const centre = this.centreAt(angle, range);
      plane.band(...[-1, 1].map((sign) => place([0, centre + sign * this.errorAt(range)])[1]), look);
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
    const known = record.places.map((place, index) => [place, record.predicted_miss_m[index], index]).filter(([, ends]) => ends);
    miss.begin({ ...timeAxis(), y: missLimits, yTitle: `predicted miss${this.along}, m`, yScale: symlog(10) });
    drawMarks(miss, record);
    for (const [points, opacity] of [[known, 0.12], [known.filter(([, , index]) => index <= this.step), 0.35]]) {
      const [lower, upper] = [0, 1].map((end) => points.map(([time, ends]) => [time, ends[end]]));
      miss.area(lower, upper, { fill: theme.colours.set, opacity });
      if (opacity > 0.2) [lower, upper].forEach((bound) => miss.curve(bound, { stroke: theme.colours.set, width: 1.3 }));
    }
    this.drawMembers();
    miss.level(0, { stroke: theme.colours.line, width: 1 });
    miss.curve(record.places.map((place, index) => [place, record.true_predicted_miss_m[index]]).slice(0, this.step + 1),
      { stroke: theme.colours.ink, width: 1.4, dash: [6, 3] });
    markNow(miss, record.places[this.step]);
    miss.describe(this.missLines(this.step).join(", "));
  }

  /** The intervals of the members of a set that allows for wrong images, up to the present step. */
  drawMembers() {
    const { miss, record, step: now } = this;
    const { quiet, extra, impulse } = theme.colours;
    for (const { steps, predicted_miss_m: ends, leaves_out_class: ofClass, refuted } of record.members) {
      const look = ofClass ? { stroke: quiet, width: 1 } : { stroke: extra, width: 1.6 };
      const shownSteps = steps.filter((step) => step <= now);
      for (const end of [0, 1]) {
        miss.curve(shownSteps.map((step, index) => [record.places[step], ends[index][end]]), look);
        const last = steps.length - 1;
        if (refuted && steps[last] < now) miss.point(record.places[steps[last]], ends[last][end], "cross", impulse, 4);
      }
    }
  }

  drawImpulses() {
    const { impulses, record } = this;
    const limit = record.max_impulse_m_s;
    const shownTo = impulseSpan(record);
    impulses.begin({ ...timeAxis(), y: [-1.15 * shownTo, 1.15 * shownTo], yTitle: `k${this.along}, m/s` });
    drawMarks(impulses, record);
    impulses.level(0, { stroke: theme.colours.line, width: 1 });
    for (const side of [-limit, limit]) impulses.level(side, { stroke: theme.colours.line, width: 1, dash: [5, 3] });
    drawStems(impulses, record, record.fired_m_s, this.step);
    markNow(impulses, record.places[this.step]);
    impulses.describe(this.impulseLines(this.step).join(", "));
  }

  missLines(step) {
    const { record } = this;
    return [
      timeText(record, record.time_s[step]),
      this.missText(record.predicted_miss_m[step]),
      ...(record.wrong_image_proved_s !== null && record.time_s[step] >= record.wrong_image_proved_s
        ? [`a wrong image is proved at ${shown(record.wrong_image_proved_s, "s")}`] : []),
      `true predicted miss${this.along} ${shown(record.true_predicted_miss_m[step], "m")}`,
    ];
  }

  missText(ends) {
    return ends ? `predicted miss${this.along} from ${shown(ends[0], "m")} to ${shown(ends[1], "m")}` : "no set is left";
  }

  /** The predicted-miss interval at the present stage. */
  missNow() {
    if (this.stage === MEASURED) return this.record.predicted_miss_m[this.step];
    const intervals = this.missIntervals(this.sections);
    return intervals.length ? [Math.min(...intervals.map(([low]) => low)), Math.max(...intervals.map(([, high]) => high))] : null;
  }

  impulseLines(step) {
    const { record } = this;
    return [
      timeText(record, record.time_s[step]),
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
    if (this.stage !== MEASURED || measured === null) return null;
    if (Math.abs(y / angleUnit[1] - this.centreAt(measured, truth.range)) > error) return null;
    return [`${this.record.measured_name} ${shown(measured * angleUnit[1], angleUnit[0])}`,
      `error at most ${shown(error * angleUnit[1], angleUnit[0])} at x = ${shown(truth.range / 1e3, "km")}`];
  }

  /** The angle of the centre of the body at a range, from the measured one: the set subtracts a known offset. */
  centreAt(measured, range) {
    return Math.atan(Math.tan(measured) - this.record.image_shift_m / range);
  }

  errorAt(range) {
    const { angle_error_rad: atZero, angle_error_slope_rad_m: slope, centroid_error_m: centroid } = this.record;
    return atZero + slope * range + (centroid && centroid / Math.max(range, centroid));
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

/** Maximum number of impulses that have a dot at their end. */
const MAX_DOTS = 60;

/** All impulses of the flight as lines from zero; those after the present step are pale. */
function drawStems(chart, record, impulses, step) {
  const places = record.fired_s.map((time) => timePlace(record, time));
  impulses.forEach((impulse, index) => {
    if (impulse === 0) return;
    const look = { stroke: record.fired_s[index] <= record.time_s[step] ? theme.colours.impulse : theme.colours.grid, width: 1.6 };
    chart.curve([[places[index], 0], [places[index], impulse]], look);
    if (impulses.length <= MAX_DOTS) chart.point(places[index], impulse, "dot", look.stroke, 2);
  });
}

/** The maximum impulse of an axis: the limit of the engine, unless all impulses are much smaller. */
function impulseSpan({ fired_modulus_m_s: moduli, max_impulse_m_s: limit }) {
  const maximum = Math.max(0, ...moduli);
  return maximum > 0 && maximum < 0.2 * limit ? maximum : limit;
}

/** The line of the present time; ends the drawing of a chart over time. */
function markNow(chart, place) {
  chart.upright(place, place, { stroke: theme.colours.quiet, width: 1, dash: [2, 2] });
  chart.end();
}

/** Lines about the step under the pointer in a chart over time. */
function stepUnder(chart, record, x, lines) {
  if (x < chart.left - 5 || x > chart.right + 5) return null;
  return lines(nearest(record.places, chart.under(x, 0)[0]));
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
    this.projections = courses.map((course, k) => new Projection(this.columns[k], course));
    this.joint = spatial ? [new BPlane(record, this.columns, across)] : [];
    const overTime = (caption, label, legend, draw, lines = (step) => this.impulseLines(step), ratio = 0.2) => {
      const chart = new Chart(low, {
        caption, label, ratio, legend, draw: () => draw(chart), tell: (x) => stepUnder(chart, record, x, lines),
      });
      return chart;
    };
    this.corridor = corridorOf(this.columns);
    this.courses = [
      overTime("Possible miss", "Possible miss against time", [
        ["possible miss without further impulses", swatches.fill("set", 0.35)],
        ["after an impulse that centres the set", stroke("set", { dash: [6, 3] })],
        ["miss of the true state", stroke("ink", { width: 1.2 })],
        ...(record.guaranteed_miss_m === null ? [] : [["guaranteed miss \u03a6", stroke("extra", { dash: [8, 3] })]]),
        ...(record.radius_m === null ? [] : [[record.is_sphere ? "radius of the body" : "circle inside the body", stroke("quiet", { dash: [2, 2] })]]),
      ], (chart) => this.drawCorridor(chart), (step) => this.corridorLines(step), 0.3),
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
    this.stage = this.columns[0].stage;
  }

  draw() {
    for (const column of this.columns) {
      column.plane.draw();
      column.scene.draw();
    }
    for (const panel of this.joint) panel.chart.draw();
    // What is drawn over time does not change with the stage.
    if (this.step !== this.drawnStep) {
      const columns = this.columns.flatMap(({ miss, impulses }) => [miss, impulses]);
      for (const panel of [...columns, ...this.projections.map(({ chart }) => chart), ...this.courses]) panel.draw();
    }
    this.drawnStep = this.step;
    fillTable(this.numbers, this.rows());
  }

  /** The possible miss of the set, that after an impulse that centres it, and that of the true state. */
  drawCorridor(chart) {
    const { record, step, corridor: { maximum, centred, truth } } = this;
    const levels = [record.guaranteed_miss_m, record.radius_m].filter((level) => level);
    const values = [...maximum, ...truth, ...levels].filter((value) => value);
    const floor = Math.max(Math.min(...values, ...centred.filter((value) => value)), 1e-3 * Math.min(...levels, ...centred.filter((value) => value)), 1e-3);
    chart.begin({ ...timeAxis(), y: [0.5 * floor, 2 * Math.max(...values, floor)], yTitle: "miss, m", yScale: LOGARITHMIC });
    const at = (course, last) => course.map((value, index) => [record.places[index], value]).slice(0, last).filter(([, value]) => value !== null);
    for (const [last, opacity] of [[maximum.length, 0.12], [step + 1, 0.35]]) {
      const upper = at(maximum, last);
      chart.area(upper.map(([place]) => [place, 0.1 * floor]), upper, { fill: theme.colours.set, opacity });
    }
    chart.curve(at(maximum), { stroke: theme.colours.set, width: 1.3 });
    chart.curve(at(centred), { stroke: theme.colours.set, width: 1.3, dash: [6, 3] });
    chart.curve(at(truth), { stroke: theme.colours.ink, width: 1.2 });
    if (record.guaranteed_miss_m !== null) chart.level(record.guaranteed_miss_m, { stroke: theme.colours.extra, width: 1.6, dash: [8, 3] });
    if (record.radius_m !== null) chart.level(record.radius_m, { stroke: theme.colours.quiet, width: 1.3, dash: [2, 2] });
    drawMarks(chart, record);
    markNow(chart, record.places[step]);
    chart.describe(this.corridorLines(step).join(", "));
  }

  corridorLines(step) {
    const { record, corridor: { maximum, centred, truth } } = this;
    return [
      timeText(record, record.time_s[step]),
      `possible miss ${shown(maximum[step], "m")}`,
      `after an impulse that centres the set ${shown(centred[step], "m")}`,
      `true predicted miss ${shown(truth[step], "m")}`,
    ];
  }

  drawModulus(chart) {
    const { record } = this;
    const limit = record.max_impulse_m_s;
    chart.begin({ ...timeAxis(), y: [0, 1.15 * impulseSpan(record)], yTitle: "|k|, m/s" });
    drawMarks(chart, record);
    chart.level(limit, { stroke: theme.colours.line, width: 1, dash: [5, 3] });
    drawStems(chart, record, record.fired_modulus_m_s, this.step);
    markNow(chart, record.places[this.step]);
    chart.describe(this.impulseLines(this.step).join(", "));
  }

  drawBudget(chart) {
    const { record } = this;
    chart.begin({ ...timeAxis(), y: [0, 1.06 * record.budget_m_s], yTitle: "left, m/s" });
    drawMarks(chart, record);
    let left = record.budget_m_s;
    const stairs = record.places.flatMap((place, index) => {
      const before = left;
      left = record.budget_left_m_s[index];
      return [[place, before, index], [place, left, index]];
    });
    chart.curve(stairs, { stroke: theme.colours.grid, width: 2 });
    chart.curve(stairs.filter(([, , index]) => index <= this.step), { stroke: theme.colours.extra, width: 2 });
    markNow(chart, record.places[this.step]);
    chart.describe(this.impulseLines(this.step).join(", "));
  }

  impulseLines(step) {
    const { record, columns } = this;
    const [time, ...impulses] = columns.flatMap((column, k) => column.impulseLines(step).slice(k ? 1 : 0, 2));
    const modulus = columns.length > 1 ? [`impulse modulus ${shown(record.modulus_m_s[step], "m/s")}`] : [];
    return [time, ...impulses, ...modulus, `budget left ${shown(record.budget_left_m_s[step], "m/s")}`];
  }

  /** The numbers of the present stage. Values of a later stage are "not yet". */
  rows() {
    const { record, step, stage, columns } = this;
    const along = (name, text) => columns.map((column) => [`${name}${column.along}`, text(column)]);
    const scaled = (value, factor, unit) => (stage === BEFORE ? "not yet" : shown(value && value * factor, unit));
    const given = (value) => (stage < IMPULSE ? "not yet" : shown(value, "m/s"));
    const left = record.budget_left_m_s[step] + (stage < IMPULSE ? record.modulus_m_s[step] : 0);
    return [
      ["time", shown(record.time_s[step], "s")],
      ...(DATA.counts_down ? [["time before the nominal arrival", shown(record.arrival_s - record.time_s[step], "s")]] : []),
      ...columns.map(({ record: of }) => [of.measured_name, scaled(of.measured_angle_rad[step], 1e3, "mrad")]),
      ...(record.range_error_relative === null ? [] : [["measured range", scaled(record.measured_range_m[step], 1e-3, "km")]]),
      ...(record.rate_error_rad_s === null ? [] : along("measured rate",
        (column) => scaled(column.record.measured_rate_rad_s[step], 1e6, "µrad/s"))),
      ...along("true angle", ({ truth }) => shown(truth.angle * 1e3, "mrad")),
      ...along("true rate", ({ truth }) => shown(truth.rate * 1e6, "µrad/s")),
      ["true range", shown(columns[0].truth.range / 1e3, "km")],
      ...along("predicted miss", (column) => column.missText(column.missNow()).replace(`predicted miss${column.along} `, "")),
      ...along("true predicted miss", ({ truth }) => shown(truth.miss, "m")),
      ...along("impulse", (column) => given(column.record.impulse_m_s[step])),
      ...(columns.length > 1 ? [["impulse modulus", given(record.modulus_m_s[step])]] : []),
      ["budget left", shown(left, "m/s")],
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

/** Over the steps: the maximum possible miss, that after an impulse that centres the set, and that of the true state, m. */
function corridorOf(columns) {
  const across = (values) => (values.includes(null) ? null : Math.hypot(...values));
  const course = (of) => columns[0].record.time_s.map((_, step) => across(columns.map(({ record }) => of(record, step))));
  // The set is complete until its nearest section leaves at the range threshold.
  const interval = (of) => ({ predicted_miss_m: misses, complete_steps: last }, step) =>
    (step < last && misses[step] ? of(misses[step]) : null);
  return {
    maximum: course(interval(([low, high]) => Math.max(Math.abs(low), Math.abs(high)))),
    centred: course(interval(([low, high]) => (high - low) / 2)),
    truth: course(({ true_predicted_miss_m: misses }, step) => misses[step]),
  };
}

const span = limitsOf(DATA.records.flatMap(({ places }) => places), 0.015);
const spanTicks = TICKS_S.map((tick) => [-Math.log10(tick), durationText(tick)]).filter(([at]) => at >= span[0] && at <= span[1]);
const missLimits = (() => {
  const ends = DATA.records.flatMap((record) => record.axes.flatMap((axis) => axis.predicted_miss_m.filter((each) => each).flat()));
  const maximum = Math.max(10, ...ends.map(Math.abs));
  return [-2 * maximum, 2 * maximum];
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
  name: (frame) => {
    const [time, stage] = timeAndStage(frame);
    const left = DATA.counts_down && DATA.records[0].arrival_s - time;
    return `t = ${time} s${left > 0 ? ` (${durationText(left)} before arrival)` : ""}, ${STAGES[stage]}`;
  },
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
