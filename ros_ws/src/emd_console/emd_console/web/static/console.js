// The page's live side: one socket, whose pictures and sections are handed to who draws them.

import { Camera } from "./camera.js";
import { drawCurve } from "./curve.js";
import { drawGrid, Turntable } from "./voxels.js";
import { Replay } from "./replay.js";
import { RobotScene } from "./robot.js";
import { bindKeys } from "./keys.js";
import { bindTabs, drawFolds, drawNodes, drawStatus } from "./texts.js";

const PICTURE = 1;
const POSES = 2;
const NO_CAMERA = 3000; // milliseconds after which the robot is drawn without a picture

class Page {
  constructor(data) {
    this.sections = {};
    this.camera = new Camera();
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

// The socket is opened before the framework has built the page; what comes meanwhile waits.
function connect(built) {
  const scheme = location.protocol === "https:" ? "wss" : "ws";
  const socket = new WebSocket(`${scheme}://${location.host}/live`);
  socket.binaryType = "blob";
  socket.onmessage = async (event) => {
    const page = await built;
    if (typeof event.data === "string") {
      for (const [name, value] of Object.entries(JSON.parse(event.data))) page.take(name, value);
      return;
    }
    const kind = new Uint8Array(await event.data.slice(0, 1).arrayBuffer())[0];
    if (kind === POSES) {
      page.robot.pose(new Float32Array(await event.data.slice(1).arrayBuffer()));
    } else if (kind === PICTURE) {
      await page.camera.show(event.data.slice(1, event.data.size, "image/jpeg"));
      if (socket.readyState === WebSocket.OPEN) socket.send("next");
      page.robot.begin();
    }
  };
  socket.onclose = async () => {
    await built;
    drawStatus({ lost: true });
    setTimeout(() => connect(built), 1000);
  };
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
  connect(whenThere("#folds").then(() => (window.page = new Page(window.EMD))));
} else {
  if (window.REPLAY) whenThere("#replay").then(() => (window.page = new Replay(window.REPLAY)));
  whenThere("#status").then(() => (document.getElementById("status").textContent = window.PAGE));
}
