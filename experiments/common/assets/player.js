
"use strict";
// Time: a slider, play and pause, and the keys space, arrows, home and end.

class Player {
  /** `frames`: how many; `coarse`: how many make a step; `name(frame)`: what stands beside the slider. */
  constructor({ frames, coarse = 1, name, draw, speeds = [1, 2, 5, 10, 30], speed = 5 }) {
    Object.assign(this, { frames, coarse, name, draw, speed, frame: 0, drawn: 0, playing: false });
    this.button = element("button", { type: "button", click: () => this.toggle() }, "Play");
    this.slider = element("input", {
      type: "range", min: 0, max: frames - 1, step: 1, value: 0, "aria-label": "Time",
      input: () => { this.pause(); this.show(Number(this.slider.value)); },
    });
    this.output = element("output", {});
    const jump = (text, label, by) =>
      element("button", { type: "button", "aria-label": label, title: label, click: () => { this.pause(); this.show(this.frame + by); } }, text);
    document.body.append(element("div", { class: "player", role: "group", "aria-label": "Playback" },
      this.button, jump("\u2039", "One back", -1), jump("\u203a", "One on", 1), this.slider, this.output,
      choice("Steps/s", speeds.map((each) => [each, String(each)]), speed, (chosen) => { this.speed = Number(chosen); })));
    document.addEventListener("keydown", (event) => this.key(event));
    this.show(0);
    // The canvases get their sizes, and draw, at the end of the first frame.
    requestAnimationFrame(() => requestAnimationFrame(() => performance.mark("first-draw")));
  }

  /** Another number of frames a step; goes to the first of a step. */
  count(coarse, steps, step) {
    Object.assign(this, { coarse, frames: coarse * steps });
    this.slider.max = this.frames - 1;
    this.show(coarse * step);
  }

  show(frame) {
    this.frame = Math.min(this.frames - 1, Math.max(0, frame));
    this.slider.value = this.frame;
    const name = this.name(this.frame);
    this.output.textContent = name;
    this.slider.setAttribute("aria-valuetext", name);
    this.draw(this.frame);
    this.drawn += 1;
  }

  key(event) {
    const at = event.target;
    if (event.ctrlKey || event.altKey || event.metaKey || /^(SELECT|TEXTAREA)$/.test(at.tagName)) return;
    if (at.tagName === "INPUT" && at !== this.slider) return;
    if (at.tagName === "BUTTON" && event.key === " ") return; // a button is pressed by it already
    const moves = {
      ArrowRight: this.frame + (event.shiftKey ? this.coarse : 1),
      ArrowLeft: this.frame - (event.shiftKey ? this.coarse : 1),
      PageUp: this.frame + this.coarse,
      PageDown: this.frame - this.coarse,
      Home: 0,
      End: this.frames - 1,
    };
    if (event.key === " ") this.toggle();
    else if (event.key in moves) {
      this.pause();
      this.show(moves[event.key]);
    } else return;
    event.preventDefault();
  }

  toggle() {
    if (this.playing) this.pause();
    else this.play();
  }

  pause() {
    this.playing = false;
    this.button.textContent = "Play";
  }

  play() {
    this.playing = true;
    this.button.textContent = "Pause";
    if (this.frame === this.frames - 1) this.show(0);
    let [before, owed] = [performance.now(), 0];
    const next = (now) => {
      if (!this.playing) return;
      owed += Math.max(0, (now - before) / 1000) * this.speed * this.coarse;
      before = now;
      const steps = Math.floor(owed);
      owed -= steps;
      if (steps) this.show(this.frame + steps);
      if (this.frame === this.frames - 1) this.pause();
      else requestAnimationFrame(next);
    };
    requestAnimationFrame(next);
  }
}
