// Parameters: with units, ranges and help, changed live where the table says so.

import { byId, el, setClass } from "./dom.js";

export class ParameterSheet {
  constructor(model, link) {
    [this.model, this.link] = [model, link];
    this._fields = new Map();
    this._rows = null;
  }

  update() {
    const { about, health } = this.model;
    if (!about?.rows) return;
    if (this._rows !== about.rows) this._make(about.rows);
    const values = health?.parameters ?? {};
    for (const [name, { input, row }] of this._fields) {
      input.disabled = !this.model.operator;
      if (document.activeElement === input || values[name] === undefined) continue;
      if (input.value !== String(values[name])) input.value = String(values[name]);
      setClass(input, "changed", values[name] !== row.default);
    }
  }

  _make(rows) {
    this._rows = rows;
    const filter = el("input", { id: "filter", type: "search", placeholder: "Find a parameter", "aria-label": "Find a parameter" });
    const items = rows.map((row) => this._item(row));
    filter.oninput = () => {
      const words = filter.value.toLowerCase();
      rows.forEach((row, i) => (items[i].hidden = !`${row.name} ${row.mavlink} ${row.help}`.toLowerCase().includes(words)));
    };
    byId("sheet-params").replaceChildren(filter, ...items);
  }

  _item(row) {
    const input = row.choices.length
      ? el("select", {}, ...row.choices.map((choice) => el("option", { text: choice, value: choice })))
      : el("input", { type: "number", min: row.low, max: row.high, step: row.whole ? 1 : "any" });
    input.setAttribute("aria-describedby", `help-${row.name}`);
    input.dataset.name = row.name;
    const told = el("small", { id: `help-${row.name}`, text: `${row.help} Allowed: ${row.allowed}. ${row.live ? "In force at once." : "In force at the next start."}` });
    input.onchange = () => this._set(row, input, told);
    this._fields.set(row.name, { input, row });
    return el(
      "div",
      { class: "parameter" },
      el("label", {}, el("span", { text: row.name.replace(/_(m|s|deg|ms|hz|pct|mb|m2)$/, "").replaceAll("_", " ") }), input, el("em", { text: row.unit })),
      told,
    );
  }

  async _set(row, input, told) {
    const value = row.choices.length ? input.value : Number(input.value);
    const { ok, reason } = await this.link.order({ do: "set", name: row.name, value });
    told.textContent = `${ok ? "✓" : "✕"} ${reason}`;
    setClass(told, "no", !ok);
    if (!ok) input.value = String(this.model.health?.parameters?.[row.name] ?? row.default);
    else if (this.model.health) this.model.health.parameters[row.name] = value;
  }
}
