// Colours that colour-blind people can tell (Okabe and Ito), and the theme's own.

export const HUES = { now: "#0072b2", predicted: "#e69f00", goal: "#009e73" };
export const ARROW = "#e69f00";
export const HEM = "#56b4e9";
export const LESSON = "#cc79a7";

export function theme(name) {
  return getComputedStyle(document.body).getPropertyValue(`--${name}`).trim();
}

export function shaded(hex, factor) {
  const parts = [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16));
  const mixed = parts.map((part) => (factor < 1 ? part * factor : part + (255 - part) * (factor - 1)));
  return `rgb(${mixed.map(Math.round).join(" ")})`;
}

export function fitted(canvas) {
  const ratio = window.devicePixelRatio || 1;
  const { clientWidth: width, clientHeight: height } = canvas;
  if (canvas.width !== Math.round(width * ratio)) canvas.width = Math.round(width * ratio);
  if (canvas.height !== Math.round(height * ratio)) canvas.height = Math.round(height * ratio);
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, width, height);
  return [pen, width, height];
}
