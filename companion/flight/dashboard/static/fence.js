// The autopilot's fence: its boundaries as dashes on the map and as walls in space.

import { inks } from "./theme.js";

export const FENCE = inks("fence");
const CIRCLE_CORNERS = 72;

/** Corners of a boundary, east and north: of a polygon its own, of a circle points around it. */
export function corners(boundary) {
  if (!boundary.radius_m) return boundary.corners_m;
  const [e, n] = boundary.corners_m[0];
  return [...Array(CIRCLE_CORNERS).keys()].map((i) => {
    const angle = (2 * Math.PI * i) / CIRCLE_CORNERS;
    return [e + boundary.radius_m * Math.sin(angle), n + boundary.radius_m * Math.cos(angle)];
  });
}

/** What a boundary is, in words. */
export const fenceWords = (boundary) => (boundary.inclusion ? "fence: stay inside" : "fence: stay out");

/** Tell whether a zone is beyond the fence. */
export const isBeyond = (model, zone) => model.state?.fence?.beyond.includes(zone.id) ?? false;
