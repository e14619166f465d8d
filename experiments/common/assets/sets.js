
"use strict";
// Sections of information sets as they travel in the page.

// Equal to STEPS_OF_A_BOX of interception/page.py.
const STEPS_OF_A_BOX = 65535;

/** The sets of a record. A set predicted from a step is that before the measurement of the next step, if the page has both. */
class Sets {
  constructor(packed) {
    this.starts = counts(packed.starts);
    this.labels = floats(packed.labels_m);
    this.ranges = floats(packed.ranges_m);
    this.boxes = floats(packed.boxes);
    this.misses = floats(packed.predicted_miss_m);
    this.counts = counts(packed.counts);
    this.vertices = new Uint16Array(bytes(packed.vertices).buffer);
    this.first = new Uint32Array(this.counts.length + 1);
    this.counts.forEach((count, index) => { this.first[index + 1] = this.first[index] + count; });
    // The states of step i: 3 i before its measurement, 3 i + 1 after it, 3 i + 2 predicted from it.
    this.states = counts(packed.states);
    // Intervals of the predicted miss are those of measured sections alone.
    this.missOf = new Map();
    for (let step = 0, next = 0; 3 * step < this.states.length; step++) {
      const state = this.states[3 * step + 1];
      for (let index = this.starts[state]; index < this.starts[state + 1]; index++) this.missOf.set(index, next++);
    }
  }

  /** The minimum and the maximum lateral coordinate alpha x of the measured set of each step, m; null without sections. */
  extents() {
    return Array.from({ length: this.states.length / 3 }, (_, step) => {
      const state = this.states[3 * step + 1];
      let ends = null;
      for (let index = this.starts[state]; index < this.starts[state + 1]; index++) {
        const [low, high] = [1, 3].map((k) => this.boxes[4 * index + k] * this.ranges[index]);
        ends = ends ? [Math.min(ends[0], low), Math.max(ends[1], high)] : [low, high];
      }
      return ends;
    });
  }

  /** The sections of a state, in rising order of range; box and points are (omega, alpha) in SI units. */
  state(number) {
    if (this.cached?.number === number) return this.cached.sections;
    const sections = [];
    for (let index = this.starts[number]; index < this.starts[number + 1]; index++) sections.push(this.section(index));
    this.cached = { number, sections };
    return sections;
  }

  section(index) {
    const box = Array.from(this.boxes.subarray(4 * index, 4 * index + 4));
    const [width, height] = [(box[2] - box[0]) / STEPS_OF_A_BOX, (box[3] - box[1]) / STEPS_OF_A_BOX];
    const points = [];
    for (let vertex = this.first[index]; vertex < this.first[index + 1]; vertex++) {
      points.push([box[0] + width * this.vertices[2 * vertex], box[1] + height * this.vertices[2 * vertex + 1]]);
    }
    const miss = this.missOf.get(index);
    return {
      label: this.labels[index],
      range: this.ranges[index],
      box,
      points,
      miss: miss === undefined ? null : [this.misses[2 * miss], this.misses[2 * miss + 1]],
    };
  }
}

/** The same sections after an impulse k: omega becomes omega - k/x. */
function shifted(sections, impulse) {
  return sections.map((section) => {
    const by = impulse / section.range;
    const [left, low, right, high] = section.box;
    return {
      ...section,
      box: [left - by, low, right - by, high],
      points: section.points.map(([omega, alpha]) => [omega - by, alpha]),
      miss: null,
    };
  });
}

/** Up to so many sections, evenly over the range, the first and the last included. */
function chosenOf(sections, most) {
  if (sections.length <= most) return sections;
  if (most === 1) return [sections[Math.floor(sections.length / 2)]];
  const [first, last] = [sections[0].range, sections[sections.length - 1].range];
  const ranges = sections.map((section) => section.range);
  const wanted = Array.from({ length: most }, (_, k) => nearest(ranges, first + ((last - first) * k) / (most - 1)));
  return [...new Set(wanted)].map((index) => sections[index]);
}
