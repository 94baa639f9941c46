// What moves around the vehicle: a ring of its size, and an arrow to where it will be in two seconds.

import { inks } from "./theme.js";

export const MOVING = inks("moving");
export const AHEAD_S = 2;
const LEAST_RADIUS_M = 0.5;

export const radiusOf = (one) => Math.max(LEAST_RADIUS_M, one.radius_m);

/** Where it will be, east and north. */
export const ahead = (one) => one.enu_m.map((place, i) => place + AHEAD_S * one.velocity_ms[i]);

/** Its height and speed in words. */
export const movingWords = (one) => `${one.height_m.toFixed(1)} m high, ${Math.hypot(...one.velocity_ms).toFixed(1)} m/s`;
