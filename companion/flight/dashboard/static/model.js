// Everything the page knows, as last told.

import { percent } from "./dom.js";
import { SURE_WORDS } from "./zones.js";

const WARNING = 4; // severity of MAVLink's STATUSTEXT
const STEP_MS = 100; // between two states
const OTHER_M = 0.5; // from the judged point: another one

export class Model {
  constructor() {
    this.about = null;
    this.forget();
  }

  /** Forget a flight: another run of the companion numbers anew whatever it tells. */
  forget() {
    this.state = null;
    this.health = null;
    this.replay = null;
    this.zones = null;
    this.texts = [];
    this.path = [];
    this._pathNumber = -1;
    this.picked = null; // what was tapped: {east, north, zone, facts}
    this.latencies = [];
    this._poses = [];
  }

  take(message) {
    switch (message.t) {
      case "about":
        if (this.about && this.about.run !== message.run) this.forget();
        this.about = message;
        break;
      case "state":
        this.state = message;
        this._note(message);
        break;
      case "zones":
        this.zones = message;
        if (this.picked?.zone) this._followPicked();
        break;
      case "health":
        this.health = message;
        break;
      case "replay":
        this.replay = message;
        break;
      case "texts":
        this.texts = [...this.texts, ...message.texts.filter((x) => !(x.number <= this.texts.at(-1)?.number))].slice(-200);
        break;
      case "path":
        if (message.number !== this._pathNumber || message.from === 0) this.path = [];
        this._pathNumber = message.number;
        this.path.push(...message.points);
        break;
    }
  }

  /** Whether a source of the state (autopilot, position, map, verdict) is silent: what it told is of the past. */
  isPast(source) {
    return Boolean(this.state?.past && source in this.state.past);
  }

  /** How long a silent source has been, in words. */
  since(source) {
    const age = this.state?.past?.[source] ?? null;
    return age === null ? "never" : age < 2 ? "just now" : age < 100 ? `${Math.round(age)} s ago` : `${Math.round(age / 60)} min ago`;
  }

  /** How sure a zone is, in words; of the past, when it was last judged. */
  sureWords(zone) {
    return `${SURE_WORDS[zone.sure]} ${zone.sure === "past" ? this.since("verdict") : percent(zone.certainty)}`;
  }

  near() {
    return this._judged(this.zones?.near ?? []);
  }

  far() {
    return this._judged(this.zones?.far ?? []);
  }

  /** Zones on ground surveyed before the flight: to look at, never yet to land in. */
  prior() {
    return this.zones?.prior ?? [];
  }

  allZones() {
    return [...this.near(), ...this.far()];
  }

  zone(id) {
    return this.allZones().find((zone) => zone.id === id) ?? null;
  }

  /** The landing point of the newest report, null while it flies to another one that no report has judged. */
  selected() {
    const [point, aim] = [this.zones?.selected ?? null, this.aim()];
    if (point && aim && Math.hypot(aim[0] - point.enu_m[0], aim[1] - point.enu_m[1]) > OTHER_M) return null;
    return point && this.isPast("verdict") ? { ...point, state: "past", certainty: null, rose: null } : point;
  }

  /** Where it flies to, null while it does not. */
  aim() {
    return this.state?.aim_enu_m ?? null;
  }

  get operator() {
    return this.about?.role === "operator";
  }

  /** Warnings and worse of the last flight: after the landing before, if there was one. */
  warnings() {
    const ends = this.texts.filter(({ text }) => /^SLZ: (landed|disarmed)/.test(text));
    return this.texts.filter((x) => x.severity <= WARNING && !(x.number <= ends.at(-2)?.number));
  }

  /** Pose at a moment, between the last two that came, so that it moves without steps. */
  pose(now = performance.now()) {
    const [a, b] = this._poses.slice(-2);
    if (!a) return null;
    if (!b) return a;
    const share = Math.min(1, Math.max(0, (now - b.at) / STEP_MS));
    const turn = (p, q) => p + share * (((q - p + 540) % 360) - 180);
    const mix = (name) => a[name] + share * (b[name] - a[name]);
    return {
      east: mix("east"), north: mix("north"), up: mix("up"),
      yaw: turn(a.yaw, b.yaw), pitch: turn(a.pitch, b.pitch), roll: turn(a.roll, b.roll), height: b.height, velocity: b.velocity,
    };
  }

  _note(s) {
    if (s.east_m === null) {
      this._poses = [];
      return;
    }
    this._poses.push({
      at: performance.now(), east: s.east_m, north: s.north_m, up: s.up_m,
      yaw: s.yaw_deg, pitch: s.pitch_deg, roll: s.roll_deg, height: s.height_m, velocity: s.velocity_enu_ms,
    });
    if (this._poses.length > 2) this._poses.shift();
  }

  /** What is picked, as it may be shown now. */
  pickedNow() {
    return this.picked?.zone ? { ...this.picked, zone: this._judged([this.picked.zone])[0] } : this.picked;
  }

  _judged(zones) {
    if (!this.isPast("verdict")) return zones;
    return zones.map((zone) => ({ ...zone, sure: "past", largest: false, certainty: null, point_certainty: null }));
  }

  _followPicked() {
    const again = this.zone(this.picked.zone.id);
    this.picked = again ? { ...this.picked, zone: again } : null;
  }
}
