// The page's live side: one socket, whose pictures and sections are handed to who draws them.

import { Camera } from "./camera.js";
import { drawCurve } from "./curve.js";
import { drawGrid, Turntable } from "./voxels.js";
import { RobotScene } from "./robot.js";
import { bindKeys } from "./keys.js";
import { bindTabs, drawFolds, drawNodes, drawStatus } from "./texts.js";

const PICTURE = 1;
const POSES = 2;

class Page {
  constructor(data) {
    this.sections = {};
    this.camera = new Camera();
    this.robot = new RobotScene(data.scene);
    this.turn = new Turntable(["now", "predicted", "goal"], () => this.drawGrids());
    for (const [name, heights] of Object.entries(data.gallery)) {
      drawGrid(document.getElementById(`goal-${name}`), heights, "goal", { angle: -0.6, tilt: 0.9 });
    }
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
    this.robot.recolour();
    for (const canvas of document.querySelectorAll(".goal canvas")) canvas.redraw?.();
  }
}

function connect(page) {
  const scheme = location.protocol === "https:" ? "wss" : "ws";
  const socket = new WebSocket(`${scheme}://${location.host}/live`);
  socket.binaryType = "blob";
  socket.onmessage = async (event) => {
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
    }
  };
  socket.onclose = () => {
    drawStatus({ lost: true });
    setTimeout(() => connect(page), 1000);
  };
}

function whenThere(selector, then) {
  if (document.querySelector(selector)) then();
  else setTimeout(() => whenThere(selector, then), 20);
}

bindKeys();
if (window.EMD) {
  whenThere("#folds", () => connect((window.page = new Page(window.EMD))));
} else {
  whenThere("#status", () => (document.getElementById("status").textContent = "recordings"));
}
