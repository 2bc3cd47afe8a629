// The lowest predicted loss of the search as it falls, on a logarithmic scale.

import { fitted, HUES, theme } from "./colours.js";

const LEFT = 52;
const BOTTOM = 22;

export function drawCurve(canvas, { losses, running }) {
  if (!canvas || !canvas.clientWidth) return;
  const [pen, width, height] = fitted(canvas);
  pen.font = "12px system-ui, sans-serif";
  pen.fillStyle = theme("muted");
  if (losses.length < 2) {
    pen.fillText(running ? "the search begins" : "No search yet.", 12, 24);
    return;
  }
  const values = losses.map(([, loss]) => Math.log10(Math.max(loss, 1e-7)));
  const [low, high] = [Math.min(...values) - 0.05, Math.max(...values) + 0.05];
  const last = losses[losses.length - 1][0];
  const x = (iteration) => LEFT + (width - LEFT - 16) * (iteration / last);
  const y = (value) => 12 + (height - 12 - BOTTOM) * ((high - value) / (high - low));
  drawAxes(pen, width, height, low, high, y, last);
  pen.beginPath();
  losses.forEach(([iteration], index) => {
    if (index) pen.lineTo(x(iteration), y(values[index]));
    else pen.moveTo(x(iteration), y(values[index]));
  });
  pen.strokeStyle = HUES.predicted;
  pen.lineWidth = 2.5;
  pen.stroke();
  pen.fillStyle = theme("ink");
  const best = losses[losses.length - 1][1];
  pen.fillText(`${best.toFixed(4)} after ${last} iterations${running ? ", searching" : ""}`, LEFT + 12, 24);
}

function drawAxes(pen, width, height, low, high, y, last) {
  pen.strokeStyle = theme("line");
  pen.lineWidth = 1;
  for (const share of [0, 0.5, 1]) {
    const value = low + share * (high - low);
    pen.beginPath();
    pen.moveTo(LEFT, y(value));
    pen.lineTo(width - 16, y(value));
    pen.stroke();
    pen.fillText((10 ** value).toPrecision(2), 8, y(value) + 4);
  }
  pen.fillText("0", LEFT, height - 6);
  pen.textAlign = "right";
  pen.fillText(`${last} iterations`, width - 16, height - 6);
  pen.textAlign = "left";
}
