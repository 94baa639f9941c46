// What must not be overlooked: banners that stay while their reason stands, and sound until somebody hears it.

import { byId, el, setClass } from "./dom.js";

const CRITICAL = 2; // severity of MAVLink's STATUSTEXT
// Banners; the others wait behind a tap.
const most = () => (window.innerHeight > 560 ? 2 : 1);

export class Alarms {
  constructor(model) {
    this._model = model;
    this._box = byId("alarms");
    this._heard = new Set(); // keys of standing alarms that were acknowledged
    this._read = -1; // newest text that was acknowledged, -1 before it is known
    this._run = null;
    this._shown = "";
    this._all = false;
    this._beepAt = 0;
    document.addEventListener("pointerdown", () => this._wake(), { once: true });
    document.addEventListener("keydown", () => this._wake(), { once: true });
    window.addEventListener("resize", () => this.update()); // fewer banners where the screen is low
    setInterval(() => this._sound(), 250);
  }

  update() {
    this._know();
    const standing = this._model.state?.alarms ?? [];
    for (const key of [...this._heard]) if (!standing.some((alarm) => alarm.key === key)) this._heard.delete(key);
    const texts = this._model.texts.filter((x) => x.severity <= CRITICAL && x.number > this._read);
    const items = standing.map((alarm) => ({ ...alarm, loud: alarm.level === "critical" && !this._heard.has(alarm.key) }));
    const last = texts.at(-1);
    if (last && !standing.some((alarm) => alarm.key === "point-unsafe" && last.text.includes("UNSAFE"))) {
      // What was said is history: it stands behind what is true now, with its time.
      const at = new Date(1000 * last.at_s).toTimeString().slice(0, 8);
      items.push({ level: "said", key: `text-${last.number}`, text: `said at ${at}: ${last.text.replace("SLZ: ", "")}`, loud: true });
    }
    this.loud = items.some((item) => item.loud);
    const now = JSON.stringify([items, this._all, most(), window.innerWidth]);
    if (now === this._shown) return;
    this._shown = now;
    const hidden = this._all ? 0 : Math.max(0, items.length - most());
    this._box.replaceChildren(...items.slice(0, items.length - hidden).map((item) => this._banner(item)));
    setClass(this._box, "open", this._all);
    const clipped = [...this._box.querySelectorAll(".alarm span:nth-child(2)")].some((text) => text.scrollWidth > text.clientWidth);
    if (items.length > most() || clipped || (this._all && items.length)) {
      const more = this._all ? "fewer" : hidden ? `${hidden} more` : "whole text";
      this._box.append(el("button", { class: "more", text: more, "aria-expanded": String(this._all), onclick: () => this._fold() }));
    }
    document.title = items.length ? `(!) ${items[0].text}` : "slz – landing zones";
  }

  _fold() {
    this._all = !this._all;
    this.update();
  }

  /** Silence everything that sounds; what stands stays in sight. */
  acknowledge() {
    for (const alarm of this._model.state?.alarms ?? []) this._heard.add(alarm.key);
    this._read = this._model.texts.at(-1)?.number ?? this._read;
    if (this._run) sessionStorage.setItem("slz-acknowledged", JSON.stringify([this._run, this._read]));
    this.update();
  }

  /** What was acknowledged counts for the run of the companion that said it. */
  _know() {
    const run = this._model.about?.run;
    if (!run || run === this._run) return;
    this._run = run;
    const [known, read] = JSON.parse(sessionStorage.getItem("slz-acknowledged") ?? "[null, 0]");
    this._read = known === run ? read : 0;
    this._heard.clear();
  }

  _banner(item) {
    const button = item.loud ? el("button", { text: "Acknowledge", onclick: () => this.acknowledge() }) : null;
    return el(
      "div",
      { class: `alarm ${item.level}${item.loud ? "" : " quiet"}`, "data-key": item.key },
      el("span", { class: "mark", text: "!", "aria-hidden": "true" }),
      el("span", { text: item.text }),
      button,
    );
  }

  _wake() {
    this._audio = this._audio ?? new (window.AudioContext ?? window.webkitAudioContext)();
  }

  _sound() {
    if (!this.loud || performance.now() < this._beepAt) return;
    this._beepAt = performance.now() + 1000;
    if (!this._audio) return; // browsers allow neither before the first tap
    if (navigator.userActivation?.hasBeenActive !== false) navigator.vibrate?.([250, 120, 250]);
    const at = this._audio.currentTime;
    for (const [i, hertz] of [880, 660].entries()) {
      const tone = this._audio.createOscillator();
      const volume = this._audio.createGain();
      tone.type = "square";
      tone.frequency.value = hertz;
      volume.gain.value = 0.08;
      tone.connect(volume).connect(this._audio.destination);
      tone.start(at + 0.22 * i);
      tone.stop(at + 0.22 * i + 0.18);
    }
  }
}
