// Voxel grids as columns in parallel projection, drawn from the farthest to the nearest.

import { fitted, HUES, shaded, theme } from "./colours.js";

const STRETCH = 1.4; // of heights, on top of the voxels' own stretched shape
const FIELD = 32;

function unpack(heights) {
  return Uint8Array.from(atob(heights.data), (letter) => letter.charCodeAt(0));
}

export function drawGrid(canvas, heights, name, view) {
  if (!canvas || !canvas.clientWidth) return;
  canvas.redraw = () => drawGrid(canvas, heights, name, view);
  const [pen, width, height] = fitted(canvas);
  const scale = Math.min(width / 45, height / (44 * Math.sin(view.tilt) + 6));
  const project = projection(view, scale, width / 2, height / 2 + 2 * scale);
  drawTable(pen, project);
  if (!heights) return;
  const [sizeX, sizeY] = heights.size;
  const counts = unpack(heights);
  const level = (x, y) => (x < 0 || y < 0 || x >= sizeX || y >= sizeY ? 0 : counts[x * sizeY + y]);
  for (const [x, y] of backToFront(sizeX, sizeY, view.angle)) {
    if (level(x, y)) drawColumn(pen, project, x, y, level, HUES[name], view.angle);
  }
}

// x runs down the picture and y to the right, as the camera sees the table.
function projection(view, scale, centreX, centreY) {
  const [cosine, sine] = [Math.cos(view.angle), Math.sin(view.angle)];
  const [lift, flat] = [Math.cos(view.tilt), Math.sin(view.tilt)];
  return (x, y, z) => {
    const [right, down] = [y - FIELD / 2, x - FIELD / 2];
    const across = cosine * right - sine * down;
    const along = sine * right + cosine * down;
    return [centreX + scale * across, centreY + scale * (flat * along - lift * STRETCH * z)];
  };
}

function polygon(pen, points, fill, stroke) {
  pen.beginPath();
  points.forEach(([x, y], index) => (index ? pen.lineTo(x, y) : pen.moveTo(x, y)));
  pen.closePath();
  if (fill) {
    pen.fillStyle = fill;
    pen.fill();
  }
  pen.strokeStyle = stroke ?? fill;
  pen.lineWidth = 0.6;
  pen.stroke();
}

function drawTable(pen, project) {
  const corners = [[0, 0], [0, FIELD], [FIELD, FIELD], [FIELD, 0]];
  polygon(pen, corners.map(([x, y]) => project(x, y, 0)), theme("table"), theme("line"));
}

function* backToFront(sizeX, sizeY, angle) {
  const alongX = Math.cos(angle) >= 0;
  const alongY = Math.sin(angle) >= 0;
  for (let i = 0; i < sizeX; i += 1) {
    for (let j = 0; j < sizeY; j += 1) yield [alongX ? i : sizeX - 1 - i, alongY ? j : sizeY - 1 - j];
  }
}

function drawColumn(pen, project, x, y, level, hue, angle) {
  const top = level(x, y);
  const nearX = Math.cos(angle) >= 0 ? 1 : 0;
  const nearY = Math.sin(angle) >= 0 ? 1 : 0;
  side(pen, project, top, level(x - 1 + 2 * nearX, y), [[x + nearX, y], [x + nearX, y + 1]], shaded(hue, 0.72));
  side(pen, project, top, level(x, y - 1 + 2 * nearY), [[x, y + nearY], [x + 1, y + nearY]], shaded(hue, 0.55));
  const corners = [[x, y], [x, y + 1], [x + 1, y + 1], [x + 1, y]];
  polygon(pen, corners.map(([i, j]) => project(i, j, top)), shaded(hue, 1 + Math.min(top, 8) * 0.055));
}

function side(pen, project, top, beside, [[x0, y0], [x1, y1]], colour) {
  if (beside >= top) return;
  polygon(pen, [project(x0, y0, top), project(x1, y1, top), project(x1, y1, beside), project(x0, y0, beside)], colour);
}

// All three grids turn together: drag one of them.
export class Turntable {
  constructor(names, onTurn) {
    this.angle = -0.5;
    this.tilt = 0.75;
    for (const name of names) {
      const canvas = document.getElementById(`grid-${name}`);
      canvas.onpointerdown = (event) => canvas.setPointerCapture(event.pointerId);
      canvas.onpointermove = (event) => {
        if (!event.buttons) return;
        this.angle -= event.movementX * 0.01;
        this.tilt = Math.min(1.5, Math.max(0.25, this.tilt + event.movementY * 0.01));
        onTurn();
      };
    }
  }
}
