// Marks that the map and its legend share: paths on the screen, drawn over a halo.

import { inks } from "./theme.js";

export const [FLOWN, WAY, OBSTACLE] = ["flown", "way", "obstacle"].map((name) => inks(name));

/** Stroke a path in the line of a kind of thing, over its halo. */
export function outline(pen, path, { line, halo }, width, dash = []) {
  pen.setLineDash(dash);
  for (const [colour, wide] of [[halo, 2.1 * width], [line, width]]) {
    pen.lineWidth = wide;
    pen.strokeStyle = colour;
    pen.stroke(path);
  }
  pen.setLineDash([]);
}

/** A line through places, or around them. */
export function through(places, closed = false) {
  const path = new Path2D();
  for (const [x, y] of places) path.lineTo(x, y);
  if (closed) path.closePath();
  return path;
}

/** The landing point: a cross hair, or crossed out. */
export function pointMark(x, y, size, crossedOut) {
  const path = new Path2D();
  path.arc(x, y, size, 0, 7);
  const [from, to, turn] = crossedOut ? [-1, 1, Math.PI / 4] : [0.5, 1.45, 0];
  for (let i = 0; i < 4; i++) {
    const [c, s] = [Math.cos(turn + (i * Math.PI) / 2), Math.sin(turn + (i * Math.PI) / 2)];
    path.moveTo(x + from * size * c, y + from * size * s);
    path.lineTo(x + to * size * c, y + to * size * s);
  }
  return path;
}

/** What moves: a ring of its size, and an arrow to where it will be. */
export function movingMark([x, y], [tx, ty], size, head) {
  const path = new Path2D();
  path.arc(x, y, size, 0, 7);
  path.moveTo(x, y);
  path.lineTo(tx, ty);
  const angle = Math.atan2(ty - y, tx - x);
  for (const side of [-2.6, 2.6]) {
    path.moveTo(tx, ty);
    path.lineTo(tx + head * Math.cos(angle + side), ty + head * Math.sin(angle + side));
  }
  return path;
}

/** An obstacle: a triangle. */
export function drawObstacle(pen, x, y, r) {
  const path = through([[x, y - 6 * r], [x + 5 * r, y + 3 * r], [x - 5 * r, y + 3 * r]], true);
  outline(pen, path, OBSTACLE, 1 * r);
  pen.fillStyle = OBSTACLE.line;
  pen.fill(path);
}
