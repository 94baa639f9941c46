// The ways in and out of the landing point as a rose of bearings, and the wind as an arrow.
//
// Length and pattern say what colour says: a clear way is a long plain petal, a blocked one a short block with a
// lattice, one that was not seen an empty dotted outline. A petal is the longer, the less steep its way may be.

import { inks } from "./theme.js";
import { pattern } from "./zones.js";

export const STEP_DEG = 5;
export const WAYS = {
  c: inks("clear", { word: "way in clear" }),
  b: inks("blocked", { word: "way in blocked" }),
  u: inks("unlooked", { word: "way in not seen" }),
};
export const WIND = inks("wind");
const [STEEPEST_DEG, LEAST_DEG] = [90, 5];
const [INNER_PX, SHORT_PX, LONG_PX] = [25, 36, 52];
const RAD = Math.PI / 180;

/** Runs of neighbouring bearings that look alike: {state, first, last, slope}, in degrees. */
export function petals({ states, slopes_deg: slopes }) {
  const same = (i, j) => states[i] === states[j] && (states[i] !== "c" || slopes[i] === slopes[j]);
  const count = states.length;
  const firsts = [...states].map((_, i) => i).filter((i) => !same(i, (i + count - 1) % count));
  if (!firsts.length) return [{ state: states[0], first: 0, last: 360 - STEP_DEG, slope: slopes[0] }];
  return firsts.map((first, n) => {
    const after = n + 1 < firsts.length ? firsts[n + 1] : firsts[0] + count;
    return { state: states[first], first: first * STEP_DEG, last: (after - 1) * STEP_DEG, slope: slopes[first] };
  });
}

/** Length of a petal between 0 and 1: 1 for the flattest ways. */
export const reach = ({ state, slope }) => (state === "c" ? (STEEPEST_DEG - slope) / (STEEPEST_DEG - LEAST_DEG) : 0);

/** Share of the rose's outer radius that a petal reaches. */
const outer = (petal) => SHORT_PX + (petal.state === "c" ? Math.max(0.3, reach(petal)) * (LONG_PX - SHORT_PX) : 0);

/** Draw one sector in the style of its state. */
function sector(pen, x, y, inner, far, from, to, state, r) {
  const style = WAYS[state];
  const path = new Path2D();
  path.arc(x, y, far, from, to);
  path.arc(x, y, inner, to, from, true);
  path.closePath();
  pen.fillStyle = style.fill;
  pen.fill(path);
  if (state === "b") {
    pen.fillStyle = pattern(pen, "blocked", r);
    pen.fill(path);
  }
  pen.setLineDash([]);
  pen.lineWidth = 3.2 * r;
  pen.strokeStyle = style.halo;
  pen.stroke(path);
  if (state === "u") pen.setLineDash([2 * r, 3 * r]);
  pen.lineWidth = 1.5 * r;
  pen.strokeStyle = style.line;
  pen.stroke(path);
  pen.setLineDash([]);
}

/** Draw the rose around a point of the screen; `turn` is the bearing of the screen's top, negative (rad). */
export function drawRose(pen, x, y, turn, rose, r) {
  const order = { u: 0, b: 1, c: 2 };
  for (const petal of petals(rose).sort((a, b) => order[a.state] - order[b.state])) {
    const angle = (bearing) => bearing * RAD - Math.PI / 2 + turn;
    const half = STEP_DEG / 2;
    sector(pen, x, y, INNER_PX * r, outer(petal) * r, angle(petal.first - half), angle(petal.last + half), petal.state, r);
  }
}

/** Radius on the screen that a rose covers. */
export const roseRadius = (r) => LONG_PX * r;

/** Draw an arrow whose head is at a point of the screen and whose shaft comes from `angle` (rad, from the top). */
export function drawArrow(pen, x, y, angle, length, r) {
  pen.save();
  pen.translate(x, y);
  pen.rotate(angle);
  const path = new Path2D();
  path.moveTo(0, 0);
  for (const [px, py] of [[6.5, -11], [2, -11], [2, -length / r], [-2, -length / r], [-2, -11], [-6.5, -11]]) path.lineTo(px * r, py * r);
  path.closePath();
  pen.lineJoin = "round";
  pen.lineWidth = 3.6 * r;
  pen.strokeStyle = WIND.halo;
  pen.stroke(path);
  pen.fillStyle = WIND.line;
  pen.fill(path);
  pen.restore();
}

/** The wind in words, said too where it is not known. */
export const windWords = (wind) => (wind ? `wind ${wind.speed_ms.toFixed(wind.speed_ms < 10 ? 1 : 0)} m/s` : "wind unknown");

/** Picture of a state for the legend. */
export function drawSwatch(pen, state) {
  sector(pen, 26, 66, 44, state === "c" ? 62 : 56, -Math.PI / 2 - 0.5, -Math.PI / 2 + 0.5, state, 2);
}
