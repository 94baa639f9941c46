// Wires: a line where they were seen, dashes where they go on, and their height over the ground.

import { inks } from "./theme.js";

export const WIRE = inks("wire");

/** Pieces of a wire: two places each, and whether it was seen between them. */
export const pieces = (wire) =>
  wire.enu_m.slice(1).map((place, i) => [wire.enu_m[i], place, wire.seen[i] && wire.seen[i + 1]]);

/** The middle of a wire. */
export const middle = (wire) => wire.enu_m[wire.enu_m.length >> 1];

/** Its height over the ground in words. */
export const wireWords = (wire) => (wire.over_m === null ? "wire" : `wire ${wire.over_m.toFixed(0)} m up`);
