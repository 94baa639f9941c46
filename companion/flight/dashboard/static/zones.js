// How zones look: colour by place and certainty, pattern by certainty, so that no colour is needed to tell.

import { el } from "./dom.js";
import { ink, inks, theme } from "./theme.js";

export const STYLE = Object.fromEntries(["largest", "certain", "uncertain", "past", "prior"].map((name) => [name, inks(name)]));
export const SURE_WORDS = { certain: "certain", less: "less certain", uncertain: "uncertain", past: "last judged" };
export const STATE_STYLE = {
  safe: inks("safe", { word: "SAFE", mark: "✓" }),
  unsafe: inks("unsafe", { word: "UNSAFE", mark: "✕" }),
  unknown: inks("unknown", { word: "NOT JUDGED", mark: "?" }),
  past: inks("past", { word: "NOT JUDGED NOW", mark: "…" }),
};

export function styleOf(zone) {
  if (zone.sure === "uncertain" || zone.sure === "past") return STYLE[zone.sure];
  return zone.largest ? STYLE.largest : STYLE.certain;
}

const rising = (side) => [[-side, side, side, -side], [0, side, side, 0], [0, 2 * side, 2 * side, 0]];
const falling = (side) => rising(side).map(([x0, y0, x1, y1]) => [x0, side - y0, x1, side - y1]);
// Side of the tile, width and colour of its lines: less certain zones are hatched, uncertain ones have a lattice,
// roofs rows of bricks, each shifted by half a brick, low vegetation tufts of three blades; unseen ground is hatched.
const PATTERNS = {
  less: [16, 2.5, "hatch", rising(16)],
  uncertain: [16, 2.5, "lattice", [...rising(16), ...falling(16)]],
  blocked: [7, 1.4, "bars", [...rising(7), ...falling(7)]],
  unseen: [10, 1.2, "unseen-hatch", falling(10)],
  far: [7, 1.5, "far-shadow", falling(7)],
  roof: [20, 1.6, "bricks", [[0, 1, 20, 1], [0, 11, 20, 11], [5, 1, 5, 11], [15, 11, 15, 20]]],
  "low vegetation": [20, 1.6, "tufts", [[5, 9], [15, 19]].flatMap(([x, y]) => [-4, 0, 4].map((lean) => [x, y, x + lean, y - 7]))],
};

const tiles = new Map(); // by theme and name

function tileOf(name) {
  const [side, width, colour, lines] = PATTERNS[name];
  const tile = el("canvas", { width: side, height: side });
  const pen = tile.getContext("2d");
  pen.strokeStyle = ink(colour);
  pen.lineWidth = width;
  for (const [x0, y0, x1, y1] of lines) {
    pen.moveTo(x0, y0);
    pen.lineTo(x1, y1);
  }
  pen.stroke();
  return tile;
}

/** A pattern by its name; `scale` is that of the screen. */
export function pattern(context, name, scale = 1) {
  const key = `${theme()} ${name}`;
  if (!tiles.has(key)) tiles.set(key, tileOf(name));
  const made = context.createPattern(tiles.get(key), "repeat");
  made.setTransform(new DOMMatrix().scale(scale));
  return made;
}

/** Patterns over a zone, in the order in which they are drawn: how sure it is, and what it is of. */
export const patternsOf = (context, zone, scale) => [zone.sure, zone.surface].filter((name) => name in PATTERNS).map((name) => pattern(context, name, scale));

/** Draw a zone's area: full, or the outline alone, in dashes, where only the far map knows it. */
export function drawZone(pen, path, zone, { far, chosen, width, scale }) {
  const style = styleOf(zone);
  if (!far) {
    for (const fill of [style.fill, ...patternsOf(pen, zone, scale)]) {
      pen.fillStyle = fill;
      pen.fill(path, "evenodd");
    }
  }
  pen.setLineDash(far ? [4 * width, 3 * width] : []);
  for (const [colour, wide] of [[chosen ? ink("chosen") : style.halo, chosen ? 3 : 2], [style.line, 1]]) {
    pen.lineWidth = wide * width;
    pen.strokeStyle = colour;
    pen.stroke(path);
  }
  pen.setLineDash([]);
}

/** Draw what a survey before the flight found: grey and dotted, below all that was seen since. */
export function drawSurveyed(pen, path, scale) {
  pen.fillStyle = STYLE.prior.fill;
  pen.fill(path, "evenodd");
  pen.setLineDash([2 * scale, 4 * scale]);
  pen.lineWidth = 2 * scale;
  pen.strokeStyle = STYLE.prior.line;
  pen.stroke(path);
  pen.setLineDash([]);
}

/** A surface in words, a roof with its height; empty where it is bare ground or unknown. */
export function surfaceWords({ surface, raised_m: raised }) {
  if (!surface || surface === "bare ground") return "";
  return raised ? `${surface}, ${Math.round(raised)} m up` : surface;
}

/** The zone's area as a path: rings of east, north ... in centimetres, put on the screen by `place`. */
export function pathOf(zone, place) {
  const path = new Path2D();
  for (const polygon of zone.rings) {
    for (const ring of polygon) {
      for (let i = 0; i < ring.length; i += 2) {
        const [x, y] = place(ring[i] / 100, ring[i + 1] / 100);
        if (i === 0) path.moveTo(x, y);
        else path.lineTo(x, y);
      }
      path.closePath();
    }
  }
  return path;
}

/** Tell whether a point of the map lies in a zone (even-odd over all rings). */
export function holds(zone, east, north) {
  let inside = false;
  const [x, y] = [100 * east, 100 * north];
  for (const polygon of zone.rings) {
    for (const ring of polygon) {
      for (let i = 0, j = ring.length - 2; i < ring.length; j = i, i += 2) {
        const [xi, yi, xj, yj] = [ring[i], ring[i + 1], ring[j], ring[j + 1]];
        if (yi > y !== yj > y && x < ((xj - xi) * (y - yi)) / (yj - yi) + xi) inside = !inside;
      }
    }
  }
  return inside;
}
