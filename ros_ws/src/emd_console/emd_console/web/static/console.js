// The page's live side: what the socket of early.js brings is handed to who draws it.

import { Camera } from "./camera.js";
import { drawCurve } from "./curve.js";
import { drawGrid, Turntable } from "./voxels.js";
import { Replay } from "./replay.js";
import { RobotScene } from "./robot.js";
import { bindKeys } from "./keys.js";
import { bindTabs, drawFolds, drawNodes, drawStatus } from "./texts.js";

const NO_CAMERA = 3000; // milliseconds after which the robot is drawn without a picture

class Page {
  constructor(data, picture) {
    this.sections = {};
    this.camera = new Camera(picture);
    this.robot = new RobotScene();
    this.turn = new Turntable(["now", "predicted", "goal"], () => this.drawGrids());
    for (const [name, heights] of Object.entries(data.gallery)) {
      drawGrid(document.getElementById(`goal-${name}`), heights, "goal", { angle: -0.6, tilt: 0.9 });
    }
    setTimeout(() => this.robot.begin(), NO_CAMERA);
    bindTabs(() => this.drawCurve());
    new ResizeObserver(() => this.redraw()).observe(document.body);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.redraw());
    new MutationObserver(() => this.redraw()).observe(document.body, { attributeFilter: ["class"] });
  }

  lost() {
    drawStatus({ lost: true });
  }

  take(name, value) {
    this.sections[name] = value;
    if (name === "status") drawStatus(value);
    if (name === "nodes") drawNodes(value);
    if (name === "folds") drawFolds(value);
    if (name === "overlay") this.camera.take(value);
    if (name === "grids") this.drawGrids();
    if (name === "search") this.drawCurve();
    if (name === "robot") this.robot.build(value);
  }

  drawGrids() {
    const grids = this.sections.grids;
    if (!grids) return;
    for (const name of ["now", "predicted", "goal"]) {
      drawGrid(document.getElementById(`grid-${name}`), grids[name], name, this.turn);
    }
    const note = (name, text) => (document.getElementById(`note-${name}`).textContent = text);
    note("predicted", grids.steps > 1 ? `after ${grids.steps} steps` : "");
    note("goal", grids.goal_title);
  }

  drawCurve() {
    if (this.sections.search) drawCurve(document.getElementById("curve"), this.sections.search);
  }

  redraw() {
    this.drawGrids();
    this.drawCurve();
    this.robot.redraw();
    for (const canvas of document.querySelectorAll(".goal canvas")) canvas.redraw?.();
  }
}

// Gives a promise of an element that the framework will build.
function whenThere(selector) {
  return new Promise((resolve) => {
    const look = () => document.querySelector(selector) && (watch.disconnect(), resolve());
    const watch = new MutationObserver(look);
    watch.observe(document.body, { childList: true, subtree: true });
    look();
  });
}

bindKeys();
if (window.EMD) {
  whenThere("#folds").then(() => live.attach((window.page = new Page(window.EMD, live.picture))));
} else {
  if (window.REPLAY) whenThere("#replay").then(() => (window.page = new Replay(window.REPLAY)));
  whenThere("#status").then(() => (document.getElementById("status").textContent = window.PAGE));
}
