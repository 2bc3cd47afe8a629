// What is drawn on the camera's picture, and what the operator draws.

import { ARROW, HEM, LESSON } from "./colours.js";

const CLICK = 6; // pixels; a shorter drag is a click
const STEP = 8;
const HANDLE = 18; // pixels around a handle in which it is taken

export class Camera {
  constructor(picture) {
    this.picture = picture;
    picture.moveTo(document.getElementById("picture-place"));
    picture.onSize = (width, height) => this.resize(width, height);
    this.canvas = document.getElementById("overlay");
    this.overlay = null;
    this.drawing = null;
    this.turning = null;
    this.cross = null;
    this.from = null;
    this.button = document.getElementById("teach");
    this.button.onclick = () => this.setTeaching(!this.teaching);
    this.resize(picture.canvas.width, picture.canvas.height);
    this.bindPointer();
    this.canvas.addEventListener("keydown", (event) => this.onKey(event));
  }

  get teaching() {
    return this.button.getAttribute("aria-pressed") === "true";
  }

  setTeaching(value) {
    this.button.setAttribute("aria-pressed", String(value));
    this.canvas.classList.toggle("teaching", value);
    this.cross = value ? [this.canvas.width / 2, this.canvas.height / 2] : null;
    this.from = null;
    if (value) this.canvas.focus({ preventScroll: true });
    this.draw();
  }

  resize(width, height) {
    [this.canvas.width, this.canvas.height] = [width, height];
    this.draw();
  }

  take(overlay) {
    this.overlay = overlay;
    this.draw();
  }

  at(event) {
    const box = this.canvas.getBoundingClientRect();
    const x = ((event.clientX - box.left) / box.width) * this.canvas.width;
    const y = ((event.clientY - box.top) / box.height) * this.canvas.height;
    return [x, y];
  }

  bindPointer() {
    const canvas = this.canvas;
    canvas.onpointerdown = (event) => {
      if (!this.teaching || event.button) return;
      canvas.setPointerCapture(event.pointerId);
      const hand = this.handleAt(this.at(event));
      if (hand >= 0) this.turning = { hand, to: this.at(event) };
      else this.drawing = [this.at(event), this.at(event)];
    };
    canvas.onpointermove = (event) => {
      if (this.turning) this.turning.to = this.at(event);
      else if (this.drawing) this.drawing[1] = this.at(event);
      else return;
      this.draw();
    };
    canvas.onpointerup = () => {
      const [drawn, turned] = [this.drawing, this.turning];
      this.drawing = this.turning = null;
      if (drawn) this.send(...drawn);
      if (turned) emitEvent("teach_turn", { hand: turned.hand, points: [turned.to] });
    };
    canvas.onpointercancel = () => (this.drawing = this.turning = null);
  }

  // The hand whose handle is at a point, or -1.
  handleAt([x, y]) {
    const hands = this.overlay?.lesson.hands ?? [];
    return hands.findIndex((ends) => ends && Math.hypot(ends[0][0] - x, ends[0][1] - y) < HANDLE);
  }

  send(from, to) {
    if (Math.hypot(to[0] - from[0], to[1] - from[1]) < CLICK) {
      emitEvent("teach_hand", { points: [from] });
    } else {
      emitEvent("teach_drag", { points: [from, to] });
    }
    this.draw();
  }

  onKey(event) {
    const moves = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
    if (!this.cross) return;
    if (event.key in moves) {
      const step = event.shiftKey ? 1 : STEP;
      const limit = [this.canvas.width - 1, this.canvas.height - 1];
      this.cross = this.cross.map((value, axis) =>
        Math.min(limit[axis], Math.max(0, value + step * moves[event.key][axis])),
      );
    } else if (event.key === "Enter") {
      this.mark();
    } else {
      return;
    }
    event.preventDefault();
    this.draw();
  }

  // By keys: Enter at the grasp, Enter at the release; Enter again without moving adds a hand.
  mark() {
    if (this.from) {
      this.send(this.from, this.cross);
      this.from = null;
    } else {
      this.from = [...this.cross];
    }
  }

  draw() {
    const pen = this.canvas.getContext("2d");
    pen.clearRect(0, 0, this.canvas.width, this.canvas.height);
    pen.lineCap = pen.lineJoin = "round";
    const shown = this.overlay;
    if (shown) {
      for (const outline of shown.outlines) line(pen, [...outline, outline[0]], HEM, 2.5);
      shown.arrows.forEach((hands, step) => hands.forEach((ends) => arrow(pen, ends, ARROW, `${step + 1}`)));
      this.drawLesson(pen, shown.lesson);
      if (shown.check) drawCheck(pen, shown.check, shown.lesson.hands);
      this.drawHands(pen, shown.lesson.hands);
    }
    if (this.drawing) arrow(pen, this.drawing, LESSON);
    if (this.from) arrow(pen, [this.from, this.cross], LESSON);
    if (this.cross) drawCross(pen, this.cross);
  }

  // Whence each hand comes; the handle at the tail turns it.
  drawHands(pen, hands) {
    hands.forEach((ends, hand) => {
      if (!ends) return;
      const tail = this.turning?.hand === hand ? this.turning.to : ends[0];
      arrow(pen, [tail, ends[1]], HEM);
      if (this.teaching) handle(pen, tail);
    });
  }

  drawLesson(pen, { grasps, release }) {
    if (!release) return;
    const move = [release[0] - grasps[0][0], release[1] - grasps[0][1]];
    for (const [x, y] of grasps) arrow(pen, [[x, y], [x + move[0], y + move[1]]], LESSON);
  }
}

function handle(pen, [x, y]) {
  pen.beginPath();
  pen.arc(x, y, 8, 0, 2 * Math.PI);
  pen.fillStyle = "#fff";
  pen.fill();
  pen.strokeStyle = HEM;
  pen.lineWidth = 4;
  pen.stroke();
}

function line(pen, points, colour, width, dash = []) {
  for (const [style, more] of [["rgb(0 0 0 / 55%)", 2.5], [colour, 0]]) {
    pen.beginPath();
    points.forEach(([x, y], index) => (index ? pen.lineTo(x, y) : pen.moveTo(x, y)));
    pen.setLineDash(dash);
    pen.strokeStyle = style;
    pen.lineWidth = width + more;
    pen.stroke();
  }
  pen.setLineDash([]);
}

function arrow(pen, [from, to], colour, label = "") {
  const angle = Math.atan2(to[1] - from[1], to[0] - from[0]);
  const wing = (turn) => [to[0] - 16 * Math.cos(angle + turn), to[1] - 16 * Math.sin(angle + turn)];
  line(pen, [from, to], colour, 4);
  line(pen, [wing(0.45), to, wing(-0.45)], colour, 4);
  disc(pen, from, colour, label);
}

function disc(pen, [x, y], colour, label) {
  pen.beginPath();
  pen.arc(x, y, label ? 10 : 6, 0, 2 * Math.PI);
  pen.fillStyle = colour;
  pen.fill();
  pen.strokeStyle = "rgb(0 0 0 / 70%)";
  pen.lineWidth = 1.5;
  pen.stroke();
  if (!label) return;
  pen.fillStyle = "#000";
  pen.font = "bold 13px system-ui, sans-serif";
  pen.textAlign = "center";
  pen.fillText(label, x, y + 4.5);
}

// An arm's name stands on the side of its hem that the hand does not come from.
function drawCheck(pen, { arms, hems, paths }, hands) {
  for (const path of paths) line(pen, path, "#ffffff", 2, [6, 6]);
  hems.forEach(([x, y], index) => {
    pen.strokeStyle = "#fff";
    pen.lineWidth = 2.5;
    pen.strokeRect(x - 7, y - 7, 14, 14);
    pen.font = "bold 14px system-ui, sans-serif";
    pen.lineWidth = 3;
    pen.strokeStyle = "#000";
    pen.textAlign = "center";
    const [tail] = hands[index];
    const away = Math.hypot(x - tail[0], y - tail[1]) || 1;
    const at = [x + (32 * (x - tail[0])) / away, y + (24 * (y - tail[1])) / away + 5];
    pen.strokeText(arms[index], ...at);
    pen.fillStyle = "#fff";
    pen.fillText(arms[index], ...at);
  });
}

function drawCross(pen, [x, y]) {
  line(pen, [[x - 12, y], [x + 12, y]], "#ffffff", 1.5);
  line(pen, [[x, y - 12], [x, y + 12]], "#ffffff", 1.5);
}
