// How zones look: colour by place and certainty, pattern by certainty, so that no colour is needed to tell.

export const STYLE = {
  largest: { fill: "rgba(0, 92, 40, 0.62)", line: "#0b7a3b", halo: "#d9ffe6" },
  certain: { fill: "rgba(120, 214, 130, 0.50)", line: "#8be89a", halo: "#0d2a14" },
  uncertain: { fill: "rgba(214, 60, 50, 0.42)", line: "#ff8a7a", halo: "#3a0d0a" },
  past: { fill: "rgba(150, 158, 166, 0.28)", line: "#b4bcc4", halo: "#10151a" },
  prior: { fill: "rgba(176, 188, 200, 0.20)", line: "#c3ced9", halo: "#10151a" },
};
export const SURE_WORDS = { certain: "certain", less: "less certain", uncertain: "uncertain", past: "last judged" };
export const STATE_STYLE = {
  safe: { line: "#4cc2ff", fill: "rgba(76, 194, 255, 0.16)", word: "SAFE", mark: "✓" },
  unsafe: { line: "#ff3b30", fill: "rgba(255, 59, 48, 0.34)", word: "UNSAFE", mark: "✕" },
  unknown: { line: "#e2e6ea", fill: "rgba(200, 206, 212, 0.16)", word: "NOT JUDGED", mark: "?" },
  past: { line: "#b4bcc4", fill: "rgba(150, 158, 166, 0.16)", word: "NOT JUDGED NOW", mark: "…" },
};

export function styleOf(zone) {
  if (zone.sure === "uncertain" || zone.sure === "past") return STYLE[zone.sure];
  return zone.largest ? STYLE.largest : STYLE.certain;
}

const patterns = new Map();

/** Pattern over a zone: none where certain, lines where less, a lattice where uncertain. */
export function patternOf(context, sure) {
  if (sure !== "less" && sure !== "uncertain") return null;
  if (!patterns.has(sure)) {
    const tile = document.createElement("canvas");
    tile.width = tile.height = 16;
    const pen = tile.getContext("2d");
    pen.strokeStyle = sure === "less" ? "rgba(0, 50, 20, 0.55)" : "rgba(90, 0, 0, 0.65)";
    pen.lineWidth = 2.5;
    for (const shift of [-16, 0, 16]) {
      pen.moveTo(shift, 16);
      pen.lineTo(shift + 16, 0);
      if (sure === "uncertain") {
        pen.moveTo(shift, 0);
        pen.lineTo(shift + 16, 16);
      }
    }
    pen.stroke();
    patterns.set(sure, tile);
  }
  return context.createPattern(patterns.get(sure), "repeat");
}

const SURFACE_PENS = {
  // Bricks: rows of stones, each shifted by half a stone.
  roof: (pen) => {
    pen.strokeStyle = "rgba(255, 255, 255, 0.85)";
    pen.lineWidth = 1.6;
    for (const [x0, y0, x1, y1] of [[0, 1, 20, 1], [0, 11, 20, 11], [5, 1, 5, 11], [15, 11, 15, 20]]) {
      pen.moveTo(x0, y0);
      pen.lineTo(x1, y1);
    }
  },
  // Tufts of three blades.
  "low vegetation": (pen) => {
    pen.strokeStyle = "rgba(255, 246, 190, 0.95)";
    pen.lineWidth = 1.6;
    for (const [x, y] of [[5, 9], [15, 19]]) {
      for (const lean of [-4, 0, 4]) {
        pen.moveTo(x, y);
        pen.lineTo(x + lean, y - 7);
      }
    }
  },
};
const SURFACE_TILE = 20;

/** Pattern of a surface that needs a confirmation: bricks for roofs, tufts for low vegetation, else none. */
export function surfacePatternOf(context, surface) {
  const draw = SURFACE_PENS[surface];
  if (!draw) return null;
  if (!patterns.has(surface)) {
    const tile = document.createElement("canvas");
    tile.width = tile.height = SURFACE_TILE;
    const pen = tile.getContext("2d");
    draw(pen);
    pen.stroke();
    patterns.set(surface, tile);
  }
  return context.createPattern(patterns.get(surface), "repeat");
}

/** Patterns over a zone, in the order in which they are drawn. */
export const patternsOf = (context, zone) =>
  [patternOf(context, zone.sure), surfacePatternOf(context, zone.surface)].filter(Boolean);

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
