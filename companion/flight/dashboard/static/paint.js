// Colours of the maps. Ramps differ in lightness all the way, so that they read without hue.

const LIGHT = unit([-1, 1, 1.25]); // from the north-west
const EXAGGERATION = 1.6;
// Dark blue to yellow (cividis), by numbers of 0 to 1.
const RAMP = [
  [0, 32, 76], [0, 52, 110], [57, 72, 107], [87, 93, 109], [112, 113, 115], [138, 134, 120], [165, 156, 116],
  [195, 179, 105], [225, 204, 85], [255, 234, 70],
];
// Ground by height: slate to sand, light enough for what is drawn on it.
const GROUND = [[92, 104, 118], [112, 122, 126], [134, 138, 132], [158, 154, 138], [184, 174, 150], [208, 198, 176]];

function unit(v) {
  const length = Math.hypot(...v);
  return v.map((x) => x / length);
}

function table(stops) {
  const out = new Uint8Array(256 * 3);
  for (let i = 0; i < 256; i++) {
    const at = (i / 255) * (stops.length - 1);
    const k = Math.min(stops.length - 2, Math.floor(at));
    for (let c = 0; c < 3; c++) out[3 * i + c] = stops[k][c] + (at - k) * (stops[k + 1][c] - stops[k][c]);
  }
  return out;
}

const RAMP_TABLE = table(RAMP);
const GROUND_TABLE = table(GROUND);

export const rampColour = (share) => {
  const i = 3 * Math.round(255 * Math.min(1, Math.max(0, share)));
  return `rgb(${RAMP_TABLE[i]}, ${RAMP_TABLE[i + 1]}, ${RAMP_TABLE[i + 2]})`;
};

/** Paint a block into a canvas, north up, by a layer or as ground where it is null; what is unknown stays clear. */
export function paint(data, layer, canvas) {
  const { side, height, cell } = data;
  canvas = canvas ?? document.createElement("canvas");
  canvas.width = canvas.height = side;
  const context = canvas.getContext("2d");
  const image = context.createImageData(side, side);
  const out = image.data;
  const plane = layer && data.planes[layer.name];
  const full = layer && Math.round(layer.full / layer.step);
  const reach = cell < 0.5 ? 2 : 1; // returns are noisy: shade over a metre or so
  for (let row = 0; row < side; row++) {
    let at = 4 * (side - 1 - row) * side;
    for (let col = 0; col < side; col++, at += 4) {
      const i = row * side + col;
      const h = height[i];
      const value = plane ? plane[i] : 0;
      if (!(h === h) && (!plane || value === 255)) continue;
      const light = h === h ? shade(height, side, row, col, reach, cell) : 1;
      let lookup = GROUND_TABLE;
      let number;
      if (!plane) {
        number = ((((h / 30) % 2) + 2) % 2) * 255; // up over 30 m, down over the next: no jump of colour
        number = number > 255 ? 510 - number : number;
      } else {
        if (value === 255) {
          lookup = null;
          number = 0;
        } else {
          lookup = RAMP_TABLE;
          number = (value * 255) / full;
        }
      }
      const k = 3 * Math.round(Math.min(255, number));
      const soft = !plane ? light : 0.45 + 0.55 * light;
      out[at] = (lookup ? lookup[k] : 60) * soft;
      out[at + 1] = (lookup ? lookup[k + 1] : 60) * soft;
      out[at + 2] = (lookup ? lookup[k + 2] : 66) * soft;
      out[at + 3] = 255;
    }
  }
  context.putImageData(image, 0, 0);
  return canvas;
}

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
  return Math.min(1.25, Math.max(0.25, 0.25 + 1.0 * dot));
}
