// What is picked, what is under watch, and the orders.

import { byId, el, headings, percent, setClass, setText, shown, valueOf, ways } from "./dom.js";
import { isBeyond } from "./fence.js";
import { Hold } from "./hold.js";
import { STATE_STYLE, surfaceWords } from "./zones.js";

const NEAR_M = 0.05; // the point under watch is the picked one

export class Choice {
  constructor(model, link) {
    [this._model, this._link] = [model, link];
    this._drawn = "";
    this._armed = false;
    this._saidAt = null;
    this._refused = []; // orders of this flight
    this._read = false; // the summary of the last landing
    this._stood = false;
    byId("select").onclick = () => this.select();
    this.confirming = this._held("confirm", () => this._confirmation());
    this._held("best", () => ({ do: "land_best" }));
    this._held("now", () => ({ do: "land_now" }));
    byId("abort").onclick = () => this.abort();
  }

  /** Pick a point of the map: show what is known of it. */
  async pick(east, north, zone) {
    const picked = (this._model.picked = { east, north, zone, facts: null });
    this._read ||= this._model.state?.phase === "landed";
    this._say("");
    this.update();
    const facts = await this._link.order({ do: "facts", east_m: east, north_m: north });
    if (this._model.picked === picked || this._model.picked?.zone?.id === zone?.id) {
      this._model.picked = { ...(this._model.picked ?? picked), facts: facts.t === "facts" ? facts : null };
      this.update();
    }
  }

  pickZone(zone) {
    this.pick(zone.best[0], zone.best[1], zone);
  }

  async select() {
    const picked = this._model.picked;
    if (!picked || byId("select").disabled) return;
    const order = picked.zone
      ? { do: "select_zone", zone: picked.zone.id }
      : { do: "select_point", east_m: picked.east, north_m: picked.north };
    if (await this._send(order)) {
      this._model.picked = null;
      this._say("selected: it is judged with the next report", true);
    }
  }

  /** A button of an order that begins a landing: the order is that of the moment when the hold begins. */
  _held(id, order) {
    const ready = () => {
      const begun = order();
      return begun && (() => this._send(begun));
    };
    return new Hold(byId(id), ready, () => this._say("hold it until it is full", false));
  }

  _confirmation() {
    const point = this._model.selected();
    return point && { do: "confirm", east_m: point.enu_m[0], north_m: point.enu_m[1] };
  }

  /** Best ways in and out by corridor and wind, else the way in with the lowest horizon. */
  _wayRows(point) {
    const bearing = (deg) => (deg === null ? "–" : `${String(Math.round(deg)).padStart(3, "0")}°`);
    const words = (way) => `${bearing(way.bearing_deg)}, ${Math.round(way.slope_deg)}° steep`;
    const { way_in: inward, way_out: outward } = this._model.state ?? {};
    if (!inward || !outward) return [["Way in", bearing(point.way_in_deg)]];
    return [["Way in from", words(inward), "wide"], ["Way out to", words(outward), "wide"]];
  }

  /** Where an emergency order would land now. */
  _soonestWords() {
    const soonest = this._model.state?.emergency;
    if (this._model.isPast("verdict")) return `not now: ${this._model.state.blind}`;
    if (!soonest) return "not now: no zone known";
    if (soonest.seconds === null) return `zone ${soonest.zone}, too windy to reach`;
    const lasts = soonest.within_battery === false ? ", beyond the battery" : "";
    const zone = this._model.zone(soonest.zone);
    const where = zone ? `, ${shown(this._away(zone.best), 0, "m")} away${surfaceWords(zone) && `, ${surfaceWords(zone)}`}` : "";
    return `${this._model.state.guided ? "" : "takes over, "}zone ${soonest.zone} in ${soonest.seconds} s${where}${lasts}`;
  }

  abort() {
    this._send({ do: "abort" });
  }

  clear() {
    this._model.picked = null;
    this.update();
  }

  // ---- what is shown ---------------------------------------------------------------------------

  update() {
    const { state } = this._model;
    const [picked, point] = [this._model.pickedNow(), this._model.selected()];
    const may = this._model.operator && Boolean(state) && this._model.about.kind === "flight";
    const ready = may && state.connected && !this._link.stale;
    const judged = ready && !this._model.isPast("verdict");
    byId("select").disabled = !judged || !picked || (picked.zone !== null && this._isFar(picked.zone));
    byId("confirm").disabled = !judged || !point || point.state === "unsafe" || !state.guided || this._flownTo(point);
    byId("best").disabled = !judged || !state.guided || !this._model.near().length || this._descending();
    byId("now").disabled = !judged || this._descending() || !state.emergency || !state.armed || state.on_ground;
    setText(byId("best-zone"), byId("best").disabled ? "" : this._bestWords());
    byId("soonest").textContent = state?.armed && !state.on_ground && !this._descending() ? this._soonestWords() : "";
    byId("abort").disabled = !may;
    if (this._armed && state && !state.armed) this._say(""); // the flight that the answer was of is over
    this._armed = Boolean(state?.armed);
    this._forgetAnswer();
    setText(byId("abort-does"), state?.abort_does || this._whyNoAbort());
    setClass(byId("abort"), "idle", !state?.abort_does); // it can be pressed all the same
    byId("answer").dataset.hint = this._hint(point);
    const landed = this._landing();
    setClass(document.body, "landed", Boolean(landed));
    const now = JSON.stringify([picked, point, Boolean(this._model.aim()), landed, this._model.texts.at(-1)?.number, this._model.since("verdict"), this._model.zones?.number, this._model.about?.role]);
    if (now === this._drawn) return;
    this._drawn = now;
    setClass(byId("choice"), "past", this._model.isPast("verdict") && !landed);
    byId("choice").replaceChildren(...(landed ? this._landed(landed) : picked ? this._picked(picked) : point ? this._watched(point) : this._nothing()));
  }

  _whyNoAbort() {
    const { connected, phase } = this._model.state ?? {};
    return !connected ? "no link" : { final: "too low", failsafe: "no effect: take over" }[phase] ?? "nothing to abort";
  }

  /** What it does now, and what is missing before an order can be given, shown while nothing was answered. */
  _hint(point) {
    const { state, about } = this._model;
    if (!state || about?.kind !== "flight") return "";
    if (!this._model.operator) return "This page may look only.";
    if (!state.connected) return "No autopilot: only your own remote control may reach it.";
    if (!state.armed || state.on_ground) return "";
    const now = state.doing || (state.guided ? "hovers and waits for your order" : `you fly (${state.mode})`);
    return `${now[0].toUpperCase()}${now.slice(1)}${this._advice(point)}.`;
  }

  _advice(point) {
    const { state } = this._model;
    if (this._model.isPast("verdict")) return `. ${state.blind}: nothing is judged now, last ${this._model.since("verdict")}`;
    if (state.doing) return "";
    if (!state.guided) return ". To land, set the guided flight mode";
    if (point?.state === "unsafe") return ". The landing point is unsafe: select another";
    return point ? ". Confirm lands there" : "";
  }

  _descending() {
    return ["descend", "final"].includes(this._model.state.phase);
  }

  /** Whether it flies there already, or comes down somewhere. */
  _flownTo(point) {
    const aim = this._model.aim();
    return this._descending() || (aim !== null && Math.hypot(aim[0] - point.enu_m[0], aim[1] - point.enu_m[1]) < NEAR_M);
  }

  _isFar(zone) {
    return !this._model.near().some((z) => z.id === zone.id);
  }

  /** Where it landed, until the next flight or a tap; null then. */
  _landing() {
    const { state, health } = this._model;
    const [landed, flies] = [state?.phase === "landed", Boolean(state?.armed && !state.on_ground)];
    if (this._stood && flies) this._refused = []; // the next flight
    this._stood = landed && !flies;
    this._read = landed && (this._read || flies);
    return landed && !this._read ? (health?.landing ?? null) : null;
  }

  /** Summary of the landing: where, how far off, what was refused or broken off on the way, the recording. */
  _landed({ lat, lon, zone, off_point_m: off }) {
    const { health } = this._model;
    const far = off > (health.parameters?.off_point_m ?? Infinity);
    const way = [...this._model.warnings().map((x) => x.text.replace("SLZ: ", "")), ...this._refused.map((reason) => `refused: ${reason}`)];
    const close = () => {
      this._read = true;
      this.update();
    };
    return [
      el("h2", {}, `Landed${zone === null ? "" : ` · zone ${zone}`}`, this._badge(far ? "uncertain" : "certain", `${shown(off, 2, "m")} off the point`)),
      this._facts([["Where", `${lat.toFixed(6)}, ${lon.toFixed(6)}`, "wide"], ["Recording", health.recording?.name ?? "none", "wide"]]),
      el("button", { class: "act", id: "controls", text: "Show the controls", onclick: close }),
      el("h3", { text: "Refused or broken off on the way" }),
      ...(way.length ? [...new Set(way)] : ["nothing"]).map((text) => el("div", { class: "said", text })),
    ];
  }

  _nothing() {
    if (this._model.aim()) return [el("h2", {}, "Landing point", this._badge("unknown", "? NOT JUDGED YET")), el("p", { text: "It was chosen just now: the next report judges it." })];
    if (this._model.about?.kind === "replay") return [el("h2", { text: "No landing point" }), el("p", { text: "Tap a zone or a point of the map to see its facts." })];
    const words = this._model.operator
      ? "Tap a zone or a point of the map to see its facts, select it, and confirm the landing."
      : "This page may look only.";
    return [el("h2", { text: "No landing point" }), el("p", { text: words })];
  }

  _picked({ zone, facts, east, north }) {
    if (zone) {
      const far = this._isFar(zone);
      return [
        el("h2", {}, `Zone ${zone.id}${far ? " (far map)" : ""}`, this._badge(zone.sure, this._model.sureWords(zone))),
        this._facts([
          ["Area", shown(zone.area_m2, 0, "m²")],
          ["Rank", `${zone.rank} of ${(far ? this._model.far() : this._model.near()).length}`],
          ["Square", shown(zone.square_m, 1, "m")],
          ["Clearance", shown(zone.clearance_m, 1, "m")],
          ["Slope", shown(zone.slope_deg, 1, "°")],
          ["Roughness", shown(zone.roughness, 3, "m")],
          ["Relief", shown(facts?.relief_m, 2, "m")],
          ["Point", percent(zone.point_certainty, 1)],
          ["Distance", shown(this._away(zone.best), 0, "m")],
          ["Obstacles", String(zone.obstacles)],
          ...(zone.corridors ? [["Clear ways", ways(zone.corridors), "wide"]] : []),
          ...(zone.headings_deg ? [["Headings", headings(zone.headings_deg)]] : []),
          ...(zone.blocked_by ? [["Blocked by", zone.blocked_by, "wide"]] : []),
          ...(zone.areas ? [["Areas", zone.areas, "wide"]] : []),
          ...this._surface(zone),
        ]),
        zone.why ? el("p", { text: `Ranked behind the zone before it: ${zone.why}` }) : null,
        far ? el("p", { text: "Seen from afar only: fly nearer before it can be landed at." }) : null,
        isBeyond(this._model, zone) ? el("p", { text: "Beyond the autopilot's fence: an order to land there is refused." }) : null,
      ].filter(Boolean);
    }
    const state = this._model.isPast("verdict") ? "past" : (facts?.state ?? "unknown");
    return [
      el("h2", {}, "Point", this._badge(state, STATE_STYLE[state].word.toLowerCase())),
      this._facts([
        ...this._model.about.layers.map((layer) => [layer.title, valueOf(layer, facts?.[layer.name])]),
        ["Map", facts?.map ?? "–"],
        ["Distance", shown(this._away([east, north]), 0, "m")],
      ]),
      state === "safe" ? null : el("p", { text: this._whyNot(facts) }),
    ].filter(Boolean);
  }

  _whyNot(facts) {
    if (this._model.isPast("verdict")) return `Last judged ${this._model.since("verdict")}: ${this._model.state.blind}.`;
    if (!facts?.map) return "Nothing was seen there: unknown is never safe.";
    if (facts.state === "unknown") return "Part of the footprint was not seen: unknown is never safe.";
    return "Outside of every zone: too steep or too uneven for the vehicle's footprint.";
  }

  _watched(point) {
    const style = STATE_STYLE[point.state];
    const zone = this._model.zone(point.zone);
    const nearest = point.obstacles[0];
    return [
      el("h2", {}, `Landing point${zone ? ` · zone ${zone.id}` : ""}`, this._badge(point.state, `${style.mark} ${style.word}`)),
      ...(point.state === "past" ? [el("p", { text: `Last judged ${this._model.since("verdict")}: ${this._model.state.blind}.` })] : []),
      this._facts([
        ["Certainty", percent(point.certainty, 1)],
        ["Slope", shown(point.slope_deg, 1, "°")],
        ["Relief", shown(point.relief_m, 2, "m")],
        ["Square", shown(zone?.square_m, 1, "m")],
        ...this._wayRows(point),
        ...(point.corridors ? [["Clear ways", ways(point.corridors), "wide"]] : []),
        ["Headings", headings(point.headings_deg ?? [])],
        ...(point.blocked_by ? [["Blocked by", point.blocked_by, "wide"]] : []),
        ["Unseen", percent(point.unseen ?? null, 1)],
        ["Map", point.judged_by === "none" ? "–" : point.judged_by],
        ["Obstacles", `${point.obstacles.length}${point.obstacles.length === 40 ? "+" : ""}`],
        ["Nearest", nearest ? `${nearest.height_m.toFixed(1)} / ${nearest.distance_m.toFixed(0)} m` : "–"],
        ...this._surface(point),
      ]),
    ];
  }

  /** The surface with its probability, over both columns, and the suspicion of water. */
  _surface(place) {
    const words = surfaceWords(place) || place.surface;
    return [
      ["Water", percent(place.water, 1)],
      ["Surface", words ? `${words}: ${percent(place.surface_probability)}` : "–", "wide"],
    ];
  }

  _facts(rows) {
    return el("dl", { class: "facts" }, ...rows.map(([name, value, kind = ""]) => el("div", { class: kind }, el("dt", { text: name }), el("dd", { text: value }))));
  }

  _badge(kind, text) {
    return el("span", { class: `badge ${kind}`, text });
  }

  _away([east, north]) {
    const s = this._model.state;
    return s && s.east_m !== null ? Math.hypot(east - s.east_m, north - s.north_m) : null;
  }

  _bestWords() {
    const zone = this._model.near()[0];
    return zone ? `zone ${zone.id}, ${Math.round(zone.area_m2)} m², ${this._model.sureWords(zone)}` : "";
  }

  // ---- orders ----------------------------------------------------------------------------------

  async _send(order) {
    this._say("…");
    const { ok, reason } = await this._link.order(order);
    if (!ok) this._refused.push(reason);
    this._say(reason || (ok ? "done" : "refused"), ok);
    return ok;
  }

  /** An answer stands until the flight has gone on: another phase, or the report that judges a selection. */
  _moment() {
    return { phase: this._model.state?.phase, number: this._model.zones?.number ?? 0 };
  }

  _forgetAnswer() {
    const [said, now] = [this._saidAt, this._moment()];
    if (said && (said.phase !== now.phase || (said.good && now.number > said.number + 1))) this._say("");
  }

  _say(text, good = null) {
    this._saidAt = text ? { ...this._moment(), good } : null;
    const answer = byId("answer");
    answer.textContent = text;
    setClass(answer, "yes", good === true);
    setClass(answer, "no", good === false);
  }
}
