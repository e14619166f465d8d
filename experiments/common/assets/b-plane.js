
"use strict";
// Predicted misses of an engagement in space: the plane across the approach, y to the right and z up.

const LENGTHS = [["m", 1], ["km", 1e-3]];

const RECENT = 10;

/** The rectangle of predicted misses of each section, the bounding box of all, and the path of its centre. */
class BPlane {
  constructor(record, columns, host) {
    Object.assign(this, { record, columns });
    const { stroke, nearToFar, mark } = swatches;
    this.chart = new Chart(host, {
      caption: "Predicted misses across the approach (B-plane)",
      label: "Predicted misses in the plane across the approach",
      ratio: 0.85,
      legend: [
        ["rectangles of the sections (dark: near)", nearToFar],
        ["bounding box of all sections", stroke("set", { dash: [6, 3] })],
        [`path of its centre after each measurement (dark: last ${RECENT} steps)`, stroke("extra")],
        ["true predicted miss", mark("cross", "ink")],
        ["centre of the body", mark("plus", "quiet")],
        ["impulse", mark("dot", "impulse")],
        ...(record.radius_m === null ? [] : [[record.is_sphere ? "disc of the body" : "circle inside the body", (context) => {
          swatches.fill("quiet", 0.15)(context);
          stroke("quiet", { dash: [2, 2] })(context);
        }]]),
        ...(record.guaranteed_miss_m === null ? [] : [["circle: guaranteed miss \u03a6", stroke("extra", { dash: [8, 3] })]]),
      ],
      draw: () => this.draw(),
      tell: (x, y) => this.tell(x, y),
    });
    // The centre after the measurement of each step; none where no set is left.
    const [y, z] = columns.map((column) => column.record.predicted_miss_m);
    this.path = y.map((ends, step) => ends && [(ends[0] + ends[1]) / 2, (z[step][0] + z[step][1]) / 2]);
  }

  /** A rectangle [left, low, right, high] for each of the sections that are drawn, or for all, m. */
  rectangles(stage, all) {
    const [y, z] = this.columns.map((column) => {
      const sections = column.sectionsAt(stage);
      return column.missIntervals(all ? sections : column.chosen(sections));
    });
    return y.map(([left, right], k) => [left, z[k][0], right, z[k][1]]);
  }

  /** Limits in m, of all stages of the step, that panels share. */
  shareLimits(panels) {
    const all = panels.flatMap((panel) => {
      const { stage } = panel.columns[0];
      const stages = stage === PREDICTED ? [PREDICTED] : [BEFORE, MEASURED, IMPULSE];
      const [y, z] = panel.columns.map((column) => column.truth.miss);
      return [[0, 0, y, z], ...stages.flatMap((each) => panel.rectangles(each, true))];
    });
    let [x, y] = [0, 1].map((k) => all.flatMap((box) => [box[k], box[k + 2]]));
    // The circles of the body and of the guarantee are shown if they are not much greater than the rectangles.
    const size = Math.max(...x.map(Math.abs), ...y.map(Math.abs));
    const radii = panels.flatMap(({ record }) => [record.radius_m, record.guaranteed_miss_m]).filter((radius) => radius && radius < 5 * size);
    [x, y] = [x, y].map((values) => [...values, ...radii.flatMap((radius) => [-radius, radius])]);
    this.unit = unitFor(Math.max(...x, ...y) - Math.min(...x, ...y), LENGTHS);
    this.limits = [x, y].map((values) => limitsOf(values.map((value) => value * this.unit[1])));
  }

  draw() {
    const { chart, record, columns, unit: [name, factor] } = this;
    const { step, stage } = columns[0];
    chart.begin({
      x: this.limits[0], y: this.limits[1], xTitle: `predicted miss along y, ${name}`, yTitle: `predicted miss along z, ${name}`, equal: true,
    });
    const corners = ([left, low, right, high]) =>
      [[left, low], [right, low], [right, high], [left, high]].map((point) => this.place(point));
    if (record.radius_m !== null) {
      const disc = polygon(72, 0, record.radius_m).map((point) => this.place(point));
      chart.curve(disc, { fill: theme.colours.quiet, opacity: 0.15, closed: true });
      chart.curve(disc, { stroke: theme.colours.quiet, width: 1.3, dash: [2, 2] });
    }
    const all = this.rectangles(stage, true);
    for (const box of all) chart.curve(corners(box), { fill: theme.colours.set, opacity: 0.06, closed: true });
    const drawn = this.rectangles(stage, false);
    drawn.forEach((box, index) => {
      const colour = ramp(drawn.length > 1 ? index / (drawn.length - 1) : 0);
      chart.curve(corners(box), { stroke: colour, width: 1.3, closed: true });
    });
    if (all.length) {
      const box = [0, 1, 2, 3].map((k) => Math[k < 2 ? "min" : "max"](...all.map((each) => each[k])));
      chart.curve(corners(box), { stroke: theme.colours.set, width: 1.6, dash: [6, 3], closed: true });
    }
    const circle = (radius) => polygon(72, 0, radius).map((point) => this.place(point));
    if (record.guaranteed_miss_m) chart.curve(circle(record.guaranteed_miss_m), { stroke: theme.colours.extra, width: 1.6, dash: [8, 3] });
    const last = stage === BEFORE ? step : step + 1;
    const path = this.path.slice(0, last).filter((point) => point).map((point) => this.place(point));
    chart.curve(path, { stroke: theme.colours.grid, width: 1.8 });
    chart.curve(path.slice(-RECENT), { stroke: theme.colours.extra, width: 1.8 });
    record.modulus_m_s.slice(0, last).forEach((modulus, index) => {
      if (modulus > 0 && this.path[index]) chart.point(...this.place(this.path[index]), "dot", theme.colours.impulse, 2.5);
    });
    if (path.length) chart.point(...path[path.length - 1], "dot", theme.colours.extra);
    chart.point(0, 0, "plus", theme.colours.quiet);
    chart.point(...this.place(columns.map((column) => column.truth.miss)), "cross", theme.colours.ink);
    chart.end();
    if (!all.length) chart.text("no section is left", chart.width / 2, 26);
    chart.describe(columns.map((column) => column.missLines(step)[1]).join(", "));
  }

  place([y, z]) {
    return [y * this.unit[1], z * this.unit[1]];
  }

  tell(px, py) {
    const { chart, columns, unit } = this;
    const miss = columns.map((column) => column.truth.miss);
    const [x, y] = this.place(miss);
    if (Math.hypot(chart.across(x) - px, chart.up(y) - py) < 9) {
      return ["true predicted miss", ...columns.map(({ along }, k) => `${along.trim()} ${shown(miss[k], "m")}`)];
    }
    const [atY, atZ] = chart.under(px, py).map((value) => value / unit[1]);
    const sections = columns[0].chosen(columns[0].sections);
    const under = this.rectangles(columns[0].stage, false).map((box, index) => ({ box, section: sections[index] }))
      .filter(({ box }) => box[0] <= atY && atY <= box[2] && box[1] <= atZ && atZ <= box[3]);
    if (!under.length) return null;
    const size = ({ box }) => (box[2] - box[0]) * (box[3] - box[1]);
    const { box, section } = under.reduce((best, each) => (size(each) < size(best) ? each : best));
    return [
      `section at x = ${shown(section.range / 1e3, "km")} (${shown(section.label / 1e3, "km")} at t = 0)`,
      ...columns.map(({ along }, k) => `predicted miss${along} from ${shown(box[k])} to ${shown(box[k + 2], "m")}`),
    ];
  }
}
