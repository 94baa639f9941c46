// The time line of a replay.

import { byId, el } from "./dom.js";

const SPEEDS = [0.5, 1, 2, 5, 10];

export class ReplayBar {
  constructor(model, link) {
    [this.model, this.link] = [model, link];
    this._made = false;
  }

  update() {
    const { replay, about } = this.model;
    byId("replay").hidden = about?.kind !== "replay";
    if (!replay || about?.kind !== "replay") return;
    if (!this._made) this._make();
    this._play.textContent = replay.ended ? "Ended" : replay.speed > 0 ? "❚❚ Pause" : "▶ Play";
    this._play.disabled = replay.ended && replay.at_s >= replay.length_s;
    this._line.max = String(replay.length_s);
    if (!this._dragging) this._line.value = String(replay.at_s);
    this._time.textContent = `${clock(replay.at_s)} / ${clock(replay.length_s)}`;
    if (replay.speed > 0) this._speed.value = String(replay.speed);
  }

  _make() {
    this._made = true;
    this._play = el("button", { class: "act", id: "play", text: "Play" });
    this._play.onclick = () => this._order({ speed: this.model.replay.speed > 0 ? 0 : Number(this._speed.value) || 1 });
    this._line = el("input", { type: "range", min: 0, max: 1, step: 0.1, value: 0, "aria-label": "Time of the flight" });
    this._line.oninput = () => (this._dragging = true);
    // A finger that goes back to where it began changes nothing, and one may be taken away.
    for (const end of ["pointerup", "pointercancel", "blur"]) this._line.addEventListener(end, () => (this._dragging = false));
    this._line.onchange = () => {
      this._dragging = false;
      this._order({ at_s: Number(this._line.value) });
    };
    this._speed = el("select", { "aria-label": "Speed" }, ...SPEEDS.map((x) => el("option", { value: x, text: `${x} ×` })));
    this._speed.value = "1";
    this._speed.onchange = () => this._order({ speed: Number(this._speed.value) });
    this._time = el("output");
    byId("replay").replaceChildren(this._play, this._speed, this._line, this._time);
  }

  async _order(fields) {
    const { ok, reason } = await this.link.order({ do: "replay", ...fields });
    if (!ok) byId("answer").textContent = reason;
  }
}

function clock(seconds) {
  const whole = Math.floor(seconds);
  return `${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, "0")}`;
}
