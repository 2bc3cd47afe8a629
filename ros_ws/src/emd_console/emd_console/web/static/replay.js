// A recorded motion, to be played and stepped through.

import { RobotScene } from "./robot.js";

const VALUES = 7; // of a pose

export class Replay {
  constructor({ number }) {
    this.scene = new RobotScene();
    [this.seek, this.play] = ["seek", "play"].map((name) => document.getElementById(name));
    this.output = document.getElementById("moment");
    this.index = 0;
    this.started = null;
    this.load(number);
  }

  async load(number) {
    const answer = await fetch(`/examples/${number}/replay.json`);
    if (!answer.ok) {
      this.output.textContent = await answer.text();
      return;
    }
    this.motion = await answer.json();
    const bytes = Uint8Array.from(atob(this.motion.poses), (letter) => letter.charCodeAt(0));
    this.poses = new Float32Array(bytes.buffer);
    this.seek.max = this.motion.times.length - 1;
    this.seek.oninput = () => {
      this.pause();
      this.show(Number(this.seek.value));
    };
    this.play.onclick = () => (this.started === null ? this.start() : this.pause());
    document.getElementById("back").onclick = () => this.step(-1);
    document.getElementById("forth").onclick = () => this.step(1);
    this.scene.build(this.motion);
    this.show(0);
    await this.scene.begin();
  }

  get last() {
    return this.motion.times.length - 1;
  }

  show(index) {
    this.index = Math.min(Math.max(index, 0), this.last);
    const row = this.motion.shapes.length * VALUES;
    this.scene.pose(this.poses.subarray(this.index * row, (this.index + 1) * row));
    this.seek.value = this.index;
    const time = this.motion.times[this.index];
    const begun = this.motion.phases.filter(([begin]) => begin <= time);
    const phase = begun.length ? begun[begun.length - 1][1] : "";
    this.output.textContent = `${time.toFixed(1)} of ${this.motion.times[this.last].toFixed(1)} s ${phase}`;
  }

  step(by) {
    this.pause();
    this.show(this.index + by);
  }

  start() {
    if (this.index === this.last) this.index = 0;
    this.started = performance.now() - 1e3 * this.motion.times[this.index];
    this.play.textContent = "Pause";
    this.tick();
  }

  pause() {
    this.started = null;
    this.play.textContent = "Play";
  }

  tick() {
    if (this.started === null) return;
    const now = (performance.now() - this.started) / 1e3;
    let index = this.index;
    while (index < this.last && this.motion.times[index + 1] <= now) index += 1;
    this.show(index);
    if (index === this.last) this.pause();
    else requestAnimationFrame(() => this.tick());
  }
}
