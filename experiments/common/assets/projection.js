
"use strict";
// The approach in the plane of the distance and one lateral axis.

/** The lateral coordinate of the true body and of the set over the distance, both seen from the spacecraft. */
class Projection {
  constructor(column, host) {
    const { record, along } = column;
    const { axis } = record;
    this.column = column;
    const { stroke, fill, mark } = swatches;
    this.chart = new Chart(host, {
      caption: `Approach in the plane (x, ${axis})`,
      label: `Position of the body${along} over its distance`,
      ratio: 0.45,
      legend: [
        ["set after each measurement", fill("set", 0.35)],
        ["true position", stroke("ink", { width: 1.4 })],
        ["impulse", mark("dot", "impulse")],
      ],
      draw: () => this.draw(),
      tell: (x) => this.tell(x),
    });
    this.places = record.true_range_m.map((range) => -Math.log10(range));
    const tangent = (of, step) => Math.tan(of.true_angle_rad[step]);
    this.truth = record.true_range_m.map((range, step) =>
      (range * tangent(record, step)) / Math.sqrt(1 + record.axes.reduce((sum, each) => sum + tangent(each, step) ** 2, 0)));
    this.extents = column.sets.extents();
    const maximum = Math.max(10, ...this.truth.map(Math.abs), ...this.extents.flatMap((ends) => (ends ? ends.map(Math.abs) : [])));
    this.limits = [-2 * maximum, 2 * maximum];
  }

  draw() {
    const { chart, places, truth, extents, column: { record, step } } = this;
    const x = limitsOf(places, 0.02);
    const xTicks = Array.from({ length: 14 }, (_, index) => 10 ** (12 - index)).map((metres) => [-Math.log10(metres), shown(metres / 1e3)])
      .filter(([at]) => at >= x[0] && at <= x[1]);
    chart.begin({ x, y: this.limits, xTitle: "distance, km", yTitle: `${record.axis}, m`, yScale: symlog(10), xTicks });
    const known = extents.map((ends, index) => [places[index], ends, index]).filter(([, ends]) => ends);
    for (const [points, opacity] of [[known, 0.12], [known.filter(([, , index]) => index <= step), 0.35]]) {
      const [lower, upper] = [0, 1].map((end) => points.map(([place, ends]) => [place, ends[end]]));
      chart.area(lower, upper, { fill: theme.colours.set, opacity });
    }
    chart.level(0, { stroke: theme.colours.line, width: 1 });
    chart.curve(places.map((place, index) => [place, truth[index]]), { stroke: theme.colours.ink, width: 1.4 });
    record.modulus_m_s.forEach((modulus, index) => {
      if (modulus > 0 && index <= step) chart.point(places[index], truth[index], "dot", theme.colours.impulse, 2.5);
    });
    chart.upright(places[step], places[step], { stroke: theme.colours.quiet, width: 1, dash: [2, 2] });
    chart.end();
    chart.describe(this.lines(step).join(", "));
  }

  lines(step) {
    const { column: { record, along }, truth, extents } = this;
    const ends = extents[step];
    return [
      timeText(record, record.time_s[step]),
      `distance ${shown(record.true_range_m[step] / 1e3, "km")}`,
      `true position${along} ${shown(truth[step], "m")}`,
      ends ? `set from ${shown(ends[0], "m")} to ${shown(ends[1], "m")}` : "no set is left",
    ];
  }

  tell(x) {
    const { chart } = this;
    return x < chart.left - 5 || x > chart.right + 5 ? null : this.lines(nearest(this.places, chart.under(x, 0)[0]));
  }
}
