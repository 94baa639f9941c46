// Colours of the maps. Ramps differ in lightness all the way, so that they read without hue.

import { ink } from "./theme.js";

const LIGHT = unit([-1, 1, 1.25]); // from the north-west
const EXAGGERATION = 1.6;
const FAR_STEP = 5; // cells between the hatches over ground that only the far map knows

function unit(v) {
  const length = Math.hypot(...v);
  return v.map((x) => x / length);
}

const bytes = (colour) => [1, 3, 5].map((at) => parseInt(colour.slice(at, at + 2), 16));

/** A table of 256 colours, blended from those of a list. */
function table(colours) {
  const stops = colours.map(bytes);
  const out = new Uint8Array(256 * 3);
  for (let i = 0; i < 256; i++) {
    const at = (i / 255) * (stops.length - 1);
    const k = Math.min(stops.length - 2, Math.floor(at));
    for (let c = 0; c < 3; c++) out[3 * i + c] = stops[k][c] + (at - k) * (stops[k + 1][c] - stops[k][c]);
  }
  return out;
}

/** Colours of the layers, from none to full: dark blue to yellow (cividis). */
export const ramp = () => ink("ramp").split(" ");

/** Paint a block into a canvas, north up, by a layer or as ground where it is null; what is unknown stays clear. */
export function paint(data, layer, canvas, far) {
  const { side, height, cell } = data;
  canvas = canvas ?? document.createElement("canvas");
  canvas.width = canvas.height = side;
  const context = canvas.getContext("2d");
  const image = context.createImageData(side, side);
  const out = image.data;
  const plane = layer && data.planes[layer.name];
  const full = layer && Math.round(layer.full / layer.step);
  const kind = far ? "far" : "ground";
  const tones = plane ? table(ramp()) : table([ink(`${kind}-low`), ink(`${kind}-high`)]);
  const shadow = bytes(ink(`${kind}-shadow`));
  const unknown = bytes(ink("ramp-unknown"));
  const reach = cell < 0.5 ? 2 : 1; // returns are noisy: shade over a metre or so
  for (let row = 0; row < side; row++) {
    let at = 4 * (side - 1 - row) * side;
    for (let col = 0; col < side; col++, at += 4) {
      const i = row * side + col;
      const h = height[i];
      const value = plane ? plane[i] : 0;
      if (!(h === h) && (!plane || value === 255)) continue;
      let light = h === h ? shade(height, side, row, col, reach, cell) : 0.75;
      if (far && (row + col) % FAR_STEP === 0) light *= 0.4;
      const share = plane ? Math.min(1, 0.59 + 0.42 * light) : light;
      const turn = (((h / 30) % 2) + 2) % 2; // up over 30 m, down over the next: no jump of colour
      const k = 3 * Math.round(255 * Math.min(1, plane ? value / full : Math.min(turn, 2 - turn)));
      for (let c = 0; c < 3; c++) {
        const base = plane ? 0 : shadow[c];
        out[at + c] = base + share * ((plane && value === 255 ? unknown[c] : tones[k + c]) - base);
      }
      out[at + 3] = 255;
    }
  }
  context.putImageData(image, 0, 0);
  return canvas;
}

/** How much light a cell gets, 0 to 1. */
function shade(height, side, row, col, reach, cell) {
  const r0 = Math.max(0, row - reach);
  const r1 = Math.min(side - 1, row + reach);
  const c0 = Math.max(0, col - reach);
  const c1 = Math.min(side - 1, col + reach);
  const here = height[row * side + col];
  const at = (r, c) => {
    const h = height[r * side + c];
    return h === h ? h : here;
  };
  const gx = (EXAGGERATION * (at(row, c1) - at(row, c0))) / ((c1 - c0) * cell);
  const gy = (EXAGGERATION * (at(r1, col) - at(r0, col))) / ((r1 - r0) * cell);
  const dot = (-gx * LIGHT[0] - gy * LIGHT[1] + LIGHT[2]) / Math.hypot(gx, gy, 1);
  return Math.min(1, Math.max(0, 1.3 * dot));
}
