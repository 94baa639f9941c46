// Puts the page together.

import { Alarms } from "./alarms.js";
import { Background } from "./background.js";
import { Bar } from "./bar.js";
import { BirdView } from "./bird.js";
import { Choice } from "./choice.js";
import { Details } from "./details.js";
import { byId, el } from "./dom.js";
import { drawLegend } from "./legend.js";
import { Link } from "./link.js";
import { Model } from "./model.js";
import { ParameterSheet } from "./parameters.js";
import { PilotView } from "./pilot.js";
import { ReplayBar } from "./replay.js";
import { Sheets } from "./sheets.js";
import { switchTheme } from "./theme.js";

const model = new Model();
const sheets = new Sheets(() => {});
const link = new Link(
  (message) => {
    if (message.t === "map") sheets.take(message);
    else {
      if (message.t === "about") {
        sheets.serve(message.serving);
        offerLayers(message.layers);
      }
      model.take(message);
    }
    due = true;
  },
  () => sheets.restart(),
);
let due = true;

const choice = new Choice(model, link);
const background = new Background(model);
const parts = [
  background,
  new Bar(model, link),
  new Alarms(model),
  choice,
  new Details(model, choice, link),
  new ParameterSheet(model, link),
  new ReplayBar(model, link),
];
const alarms = parts.find((part) => part instanceof Alarms);
const bird = new BirdView(byId("bird"), model, sheets, background, (east, north, zone) => choice.pick(east, north, zone));
const pilot = new PilotView(byId("space"), byId("hud"), model, sheets);

setInterval(() => {
  const gone = link.stale;
  byId("stale").hidden = !gone;
  if (gone) byId("stale-text").textContent = Number.isFinite(link.age) ? `from the companion for ${Math.round(link.age / 1000)} s` : "waiting for the companion";
  if (due || gone) {
    due = false;
    for (const part of parts) part.update();
  }
}, 100);

// ---- buttons -----------------------------------------------------------------------------------

function press(selector, attribute, act) {
  const buttons = [...document.querySelectorAll(selector)];
  for (const button of buttons) {
    button.onclick = () => {
      for (const other of buttons) other.setAttribute(attribute, String(other === button));
      act(button);
    };
  }
}

/** Make a button for each layer that has one, beside that of the ground. */
function offerLayers(layers) {
  if (JSON.stringify(layers) === JSON.stringify(sheets.layers)) return;
  sheets.layers = layers;
  const [ground] = byId("layers").children;
  const others = layers.filter(({ button }) => button);
  byId("layers").replaceChildren(ground, ...others.map(({ name, title }) => el("button", { "data-layer": name, "aria-pressed": "false", text: title })));
  press("#layers button", "aria-pressed", (button) => (sheets.layer = button.dataset.layer));
  ground.click();
}

press("#cameras button", "aria-pressed", (button) => pilot.use(button.dataset.camera));
press("#tabs button", "aria-current", (button) => (document.body.dataset.view = button.dataset.show));
document.querySelector("#tabs button").setAttribute("aria-current", "true");
byId("zoom-in").onclick = () => bird.zoom(1.35);
byId("zoom-out").onclick = () => bird.zoom(1 / 1.35);
byId("fit").onclick = () => bird.fit();
byId("follow").onclick = () => (bird.follow = !bird.follow);
byId("track").onclick = () => (bird.trackUp = !bird.trackUp);
byId("theme").onclick = switchTheme;
document.documentElement.addEventListener("theme", drawLegend);
drawLegend();
setInterval(() => {
  byId("follow").setAttribute("aria-pressed", String(bird.follow));
  byId("track").setAttribute("aria-pressed", String(bird.trackUp));
}, 200);

document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || event.repeat) return;
  const key = event.key.length === 1 ? event.key.toLowerCase() : event.key; // with caps lock on, too
  // Where letters are written they are letters; in any other field only these two act.
  if (event.target.closest("input[type=search], input[type=text]")) return;
  if (event.target.closest("input, select") && key !== "a" && key !== "Escape") return;
  const acts = {
    a: () => choice.abort(), s: () => choice.select(), c: () => choice.confirming.begin(), k: () => alarms.acknowledge(),
    f: () => byId("follow").click(), t: () => byId("track").click(), Escape: () => choice.clear(),
  };
  if (!(key in acts)) return;
  event.preventDefault(); // a list would choose by the letter
  acts[key]();
});

window.slz = { model, sheets, link, bird, pilot }; // for tests and the curious
