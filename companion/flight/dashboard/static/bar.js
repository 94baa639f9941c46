// The bar at the top: phase, numbers, lamps.

import { byId, el, setClass, setText, shown } from "./dom.js";

const NUMBERS = [
  ["mode", "Mode", false],
  ["height", "Height", false],
  ["speed", "Speed", true],
  ["sink", "Climb", true],
  ["battery", "Battery", false],
  ["wind", "Wind", true],
  ["distance", "To point", true],
  ["here", "Landing here", true],
  ["latency", "Ground age", true],
];
const LAMPS = [["link", "Autopilot"], ["lidar", "LiDAR"], ["map", "Map"], ["rec", "Recording"]];

const ARROWS = ["↓", "↙", "←", "↖", "↑", "↗", "→", "↘"]; // from north, north-east, ...: where it blows, north up

function windWords(wind) {
  if (!wind) return "–";
  const arrow = ARROWS[Math.round(wind.from_deg / 45) % 8];
  return `${arrow} ${wind.speed_ms.toFixed(0)}–${wind.gust_ms.toFixed(0)} m/s`;
}

export class Bar {
  constructor(model, link) {
    [this._model, this._link] = [model, link];
    this._cells = {};
    for (const [key, label, wide] of NUMBERS) {
      const value = el("dd", { text: "–" });
      const name = el("dt", { text: label });
      const box = el("div", { class: wide ? "wide" : "" }, name, value);
      byId("numbers").append(box);
      this._cells[key] = { box, value, label: name };
    }
    this._lamps = {};
    for (const [key, label] of LAMPS) {
      const lamp = el("div", { class: "lamp", title: label }, el("i"), el("span", { text: label }));
      byId("lamps").append(lamp);
      this._lamps[key] = lamp;
    }
  }

  update() {
    const s = this._model.state;
    if (!s) return;
    const phase = byId("phase");
    setText(phase, s.connected ? s.phase : "no link");
    setClass(phase, "flying", s.flying);
    setClass(phase, "landed", s.phase === "landed");
    const v = s.velocity_enu_ms;
    const aim = this._model.aim() ?? this._model.selected()?.enu_m;
    const away = aim && s.east_m !== null ? Math.hypot(aim[0] - s.east_m, aim[1] - s.north_m) : null;
    this._set("mode", `${s.mode || "–"}${s.armed === false ? " · disarmed" : ""}`, s.flying && !s.guided && s.phase !== "final");
    const overGround = s.height_m !== null;
    setText(this._cells.height.label, overGround || s.height_home_m === null ? "Over ground" : "Over home");
    this._set("height", shown(overGround ? s.height_m : s.height_home_m, 1, "m"));
    this._set("speed", v ? shown(Math.hypot(v[0], v[1]), 1, "m/s") : "–");
    this._set("sink", v ? shown(v[2], 1, "m/s") : "–");
    this._set("battery", shown(s.battery_pct, 0, "%"), s.battery_low);
    this._set("wind", windWords(s.wind), Boolean(s.wind) && s.wind.gust_ms > (this._model.health?.parameters?.max_wind_ms ?? Infinity));
    this._set("distance", shown(away, 0, "m"));
    this._set("here", s.here || "–", s.here?.startsWith("no"));
    setText(this._cells.here.label, s.assist && s.assist !== "off" ? `Landing here (${s.assist})` : "Landing here");
    const past = this._model.isPast("verdict");
    setText(this._cells.latency.label, past ? "Last report" : "Ground age");
    this._set("latency", past ? this._model.since("verdict") : shown(this._model.zones?.latency_ms, 0, "ms"), past && !s.on_ground);
    this._lamp("link", s.connected && s.heard);
    for (const [key, good] of [["lidar", s.lidar_ok], ["map", !s.pipeline_failed && !past && Boolean(this._model.zones)]]) {
      this._lamp(key, good || s.on_ground); // the ground needs neither
      setClass(this._lamps[key], "off", s.on_ground && !good);
    }
    const recording = this._model.health?.recording;
    setClass(this._lamps.rec, "off", !recording);
    setClass(this._lamps.rec, "bad", Boolean(recording?.ended));
  }

  _set(key, text, bad = false) {
    setText(this._cells[key].value, text);
    setClass(this._cells[key].box, "bad", bad);
  }

  _lamp(key, good) {
    setClass(this._lamps[key], "bad", !good);
  }
}
