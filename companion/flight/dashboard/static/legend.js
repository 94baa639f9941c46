// The legend: all that the map may show, drawn as there. A tap opens and closes it, and is remembered.

import { byId, el } from "./dom.js";
import { FENCE } from "./fence.js";
import { drawObstacle, FLOWN, movingMark, outline, pointMark, through, WAY } from "./marks.js";
import { MOVING } from "./moving.js";
import { drawArrow, drawSwatch, WAYS } from "./rose.js";
import { ink } from "./theme.js";
import { WIRE } from "./wires.js";
import { drawSurveyed, drawZone, pattern, STATE_STYLE } from "./zones.js";

const KEPT = "slz-legend"; // "open" or "closed" once it was tapped
const ROOMY_PX = 1500; // width from which it is open at first
const [WIDTH, HEIGHT, SCALE] = [52, 28, 2];
const box = (inset) => through([[inset, inset], [WIDTH - inset, inset], [WIDTH - inset, HEIGHT - inset], [inset, HEIGHT - inset]], true);
const zone = (sure, more, far = false) => (pen) => drawZone(pen, box(3), { sure, ...more }, { far, width: 3, scale: SCALE });
const line = (thing, dash) => (pen) => outline(pen, through([[2, 20], [WIDTH - 2, 8]]), thing, 4.5, dash);
const point = (state) => (pen) => outline(pen, pointMark(26, 14, 9, state === "unsafe"), STATE_STYLE[state], 3.5);
const soil = (name, hatch) => (pen) => {
  for (const fill of [ink(name), ...(hatch ? [pattern(pen, hatch, SCALE)] : [])]) {
    pen.fillStyle = fill;
    pen.fillRect(0, 0, WIDTH, HEIGHT);
  }
};
const ENTRIES = [
  ["largest zone", zone("certain", { largest: true })],
  ["zone, certain", zone("certain")],
  ["less certain", zone("less")],
  ["uncertain", zone("uncertain")],
  ["on a roof", zone("certain", { surface: "roof" })],
  ["on low vegetation", zone("certain", { surface: "low vegetation" })],
  ["zone of the far map", zone("certain", {}, true)],
  ["zone not judged now", zone("past")],
  ["safe when surveyed", (pen) => drawSurveyed(pen, box(3), SCALE)],
  ["ground", soil("ground-high")],
  ["far ground", soil("far-high", "far")],
  ["unknown: never seen", soil("unseen", "unseen")],
  ["landing point", point("safe")],
  ["landing point unsafe", point("unsafe")],
  ...Object.entries(WAYS).map(([state, { word }]) => [word, (pen) => drawSwatch(pen, state)]),
  ["wind blows to", (pen) => drawArrow(pen, 46, 14, -Math.PI / 2, 40, 1.2)],
  ["moving, in 2 s", (pen) => outline(pen, movingMark([12, 14], [46, 14], 9, 12), MOVING, 3.5)],
  ["wire", line(WIRE)],
  ["fence", line(FENCE, [15, 7])],
  ["obstacle", (pen) => drawObstacle(pen, 26, 16, SCALE)],
  ["flown path", line(FLOWN)],
  ["way to the point", line(WAY, [11, 7])],
];

/** Draw the legend in the present theme. */
export function drawLegend() {
  const pictures = ENTRIES.map(([text, draw]) => {
    const canvas = el("canvas", { width: WIDTH, height: HEIGHT });
    const pen = canvas.getContext("2d");
    soil("ground-high")(pen);
    draw(pen);
    return el("div", {}, canvas, el("span", { text }));
  });
  byId("legend").querySelector("div").replaceChildren(...pictures);
}

const legend = byId("legend");
legend.open = (localStorage.getItem(KEPT) ?? (window.innerWidth > ROOMY_PX ? "open" : "closed")) === "open";
legend.firstElementChild.onclick = () => localStorage.setItem(KEPT, legend.open ? "closed" : "open");
