// The tables beside the map: zones, messages, the program's own health.

import { byId, el, fitCanvas, percent, setClass, shown } from "./dom.js";
import { ink } from "./theme.js";
import { styleOf, SURE_WORDS, surfaceWords } from "./zones.js";

const MOST_LATENCIES = 300;

export class Details {
  constructor(model, choice, link) {
    Object.assign(this, { model, choice, link });
    this._shown = {};
    this.open = "zones";
    for (const tab of document.querySelectorAll("#sheets button")) {
      tab.onclick = () => this.show(tab.dataset.sheet);
    }
  }

  show(name) {
    this.open = name;
    for (const tab of document.querySelectorAll("#sheets button")) {
      const chosen = tab.dataset.sheet === name;
      tab.setAttribute("aria-selected", String(chosen));
      byId(`sheet-${tab.dataset.sheet}`).hidden = !chosen;
    }
    this._shown = {};
    this.update();
  }

  update() {
    if (this.open === "zones") this._once("zones", [this.model.zones?.number, this.model.isPast("verdict"), this.model.picked?.zone?.id], () => this._zones());
    if (this.open === "log") this._once("log", this.model.texts.at(-1)?.number, () => this._log());
    if (this.open === "health") this._once("health", [this.model.health, this.model.zones?.number], () => this._health());
  }

  _once(name, key, make) {
    const now = JSON.stringify(key) ?? "";
    if (this._shown[name] === now) return;
    this._shown[name] = now;
    make();
  }

  _zones() {
    const row = (zone, far) => {
      const swatch = el("span", { class: "swatch" });
      swatch.style.background = `var(--${styleOf(zone).name}-fill)`;
      const line = el(
        "tr",
        { class: `pick${this.model.picked?.zone?.id === zone.id ? " chosen" : ""}`, tabindex: 0, "data-zone": zone.id },
        el("td", {}, swatch, `${zone.id}${far ? " far" : ""}`),
        el("td", { text: Math.round(zone.area_m2) }),
        el("td", { text: percent(zone.certainty), title: SURE_WORDS[zone.sure] }),
        el("td", { text: shown(zone.square_m, 1) }),
        el("td", { text: shown(zone.slope_deg, 1) }),
        el("td", { class: "words", text: surfaceWords(zone) || zone.surface || "–" }),
      );
      line.onclick = () => this.choice.pickZone(this.model.zone(zone.id) ?? zone);
      line.onkeydown = (event) => event.key === "Enter" && line.onclick();
      return line;
    };
    const head = el("tr", {}, ...["Zone", "m²", "sure", "room m", "slope °", "surface"].map((text) => el("th", { text, class: text === "surface" && "words" })));
    const rows = [...this.model.near().map((z) => row(z, false)), ...this.model.far().map((z) => row(z, true))];
    const focused = document.activeElement?.dataset?.zone;
    byId("sheet-zones").replaceChildren(
      rows.length ? el("table", {}, el("thead", {}, head), el("tbody", {}, ...rows)) : el("p", { text: "No zone yet." }),
    );
    if (focused) document.querySelector(`tr[data-zone="${focused}"]`)?.focus();
  }

  _log() {
    const lines = [...this.model.texts].reverse().map((x) =>
      el(
        "div",
        { class: `said s${x.severity}` },
        el("time", { text: new Date(1000 * x.at_s).toTimeString().slice(0, 8) }),
        el("span", { text: x.text.replace("SLZ: ", "") }),
      ),
    );
    byId("sheet-log").replaceChildren(...(lines.length ? lines : [el("p", { text: "Nothing was said yet." })]));
  }

  _health() {
    const h = this.model.health;
    const z = this.model.zones;
    const box = byId("sheet-health");
    if (!h) {
      box.replaceChildren(el("p", { text: "Not known yet." }));
      return;
    }
    const facts = (rows) =>
      el("dl", { class: "facts" }, ...rows.map(([name, value]) => el("div", {}, el("dt", { text: name }), el("dd", { text: value }))));
    const chart = el("canvas", { class: "chart", "aria-label": "Latency of the last reports" });
    const recording = h.recording;
    const button = el("button", { class: "act", text: recording ? "End recording" : "Begin recording" });
    button.disabled = !this.model.operator;
    button.onclick = async () => {
      const { ok, reason } = await this.link.order({ do: "record", on: !recording });
      byId("answer").textContent = reason;
      setClass(byId("answer"), "no", !ok);
    };
    box.replaceChildren(
      el("h3", { text: "Age of the ground at its report, last 300 (ms)" }),
      chart,
      facts([
        ["Reports", String(h.windows ?? "–")],
        ["Dropped windows", String(h.dropped_windows ?? "–")],
        ["Returns", String(z?.points ?? "–")],
        ["Density", shown(z?.choice?.density_per_m2, 0, "/m²")],
        ["Window", shown(h.window_s, 2, "s")],
        ["Computing", shown(h.computing_pct, 0, "% of a core")],
        ["Far cells", shown(z?.choice?.far_cell_m, 1, "m")],
      ]),
      el("h3", { text: "Link" }),
      facts([
        ["Autopilot", h.autopilot ?? "–"],
        ["Delay p99", shown(h.delay_p99_ms, 1, "ms")],
        ["Clock residual", shown(h.sync_ms, 2, "ms")],
        ["Lost frames", String(h.link_lost ?? "–")],
        ["Attitude", shown(h.rates_hz?.ATTITUDE_QUATERNION, 0, "Hz")],
        ["Position", shown(h.rates_hz?.GLOBAL_POSITION_INT, 0, "Hz")],
      ]),
      ...(h.missing?.length ? [el("p", { class: "said s4", text: `Slow or missing: ${h.missing.join(", ")}` })] : []),
      el("h3", { text: "LiDAR and fusion" }),
      facts(Object.entries({ ...h.lidar, ...h.fusion }).map(([name, value]) => [name.replaceAll("_", " "), String(value)])),
      el("h3", { text: "Stages of the last window (ms)" }),
      facts(Object.entries(z?.stage_ms ?? {}).map(([name, ms]) => [name.replaceAll("_", " "), ms.toFixed(1)])),
      el("h3", { text: "Recording" }),
      facts(recording ? [["Size", shown(recording.size_mb, 1, "MiB")], ["State", recording.ended || "running"]] : [["State", "off"]]),
      button,
    );
    this._chart(chart, h.ages_ms ?? []);
  }

  _chart(canvas, values) {
    const { width, height, ratio } = fitCanvas(canvas);
    const pen = canvas.getContext("2d");
    const most = Math.max(100, ...values) * 1.1;
    pen.font = `${10 * ratio}px system-ui, sans-serif`;
    pen.fillStyle = ink("dim");
    pen.strokeStyle = ink("line");
    for (const share of [0.25, 0.5, 0.75]) {
      const y = height * (1 - share);
      pen.beginPath();
      pen.moveTo(0, y);
      pen.lineTo(width, y);
      pen.stroke();
      pen.fillText(String(Math.round(share * most)), 3 * ratio, y - 2 * ratio);
    }
    if (!values.length) return;
    pen.beginPath();
    values.forEach((ms, i) => pen.lineTo((width * (i + MOST_LATENCIES - values.length)) / (MOST_LATENCIES - 1), height * (1 - ms / most)));
    pen.strokeStyle = ink("info");
    pen.lineWidth = 1.6 * ratio;
    pen.stroke();
    const sorted = [...values].sort((a, b) => a - b);
    const at = (share) => sorted[Math.min(sorted.length - 1, Math.floor(share * sorted.length))];
    pen.fillStyle = ink("text");
    pen.textAlign = "right";
    pen.fillText(`p50 ${at(0.5).toFixed(0)}  p99 ${at(0.99).toFixed(0)}`, width - 4 * ratio, 12 * ratio);
  }
}
