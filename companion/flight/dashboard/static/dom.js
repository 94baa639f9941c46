// Small helpers around the document.

/** Make an element: tag, properties (class, text, attributes, on*), children. */
export function el(tag, properties = {}, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (value === null || value === undefined || value === false) continue;
    if (name === "class") node.className = value;
    else if (name === "text") node.textContent = value;
    else if (name.startsWith("on")) node.addEventListener(name.slice(2), value);
    else node.setAttribute(name, value === true ? "" : value);
  }
  node.append(...children.filter((child) => child !== null && child !== undefined));
  return node;
}

export const byId = (id) => document.getElementById(id);

/** Set text only where it changed, so that nothing is laid out for nothing. */
export function setText(node, text) {
  if (node.textContent !== text) node.textContent = text;
}

export function setClass(node, name, on) {
  if (node.classList.contains(name) !== on) node.classList.toggle(name, on);
}

/** A number with its unit, a dash where it is unknown. */
export function shown(value, digits = 0, unit = "") {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  const rounded = value.toFixed(digits);
  const text = Number(rounded) === 0 ? (0).toFixed(digits) : rounded; // no "-0.0"
  return unit ? `${text} ${unit}` : text;
}

export const percent = (value, digits = 0) =>
  value === null || value === undefined ? "–" : `${(100 * value).toFixed(digits)} %`;

/** Safe headings as ranges, clockwise: "any", "none" or "345°–015°, 165°–195°"; `step` apart. */
export function headings(safe, step = 15) {
  if (safe.length === 0 || safe.length >= 360 / step) return safe.length ? "any" : "none";
  const name = (deg) => `${String(deg).padStart(3, "0")}°`;
  const is = new Set(safe);
  const firsts = safe.filter((deg) => !is.has((deg - step + 360) % 360));
  return firsts
    .map((first) => {
      let last = first;
      while (is.has((last + step) % 360)) last = (last + step) % 360;
      return first === last ? name(first) : `${name(first)}–${name(last)}`;
    })
    .join(", ");
}

/** Clear ways in to a point: by bearing from it, 5° apart, and straight down. */
export function ways(corridors) {
  const down = corridors.overhead === "clear" ? "straight down" : `straight down ${corridors.overhead}`;
  if (corridors.state !== "clear") return corridors.state;
  return `${headings(corridors.bearings_deg, 5)}; ${down}`;
}

/** A round value of a layer with the sign of its unit. */
export const amount = (value, unit) => (unit === "probability" ? `${100 * value} %` : unit === "degree" ? `${value}°` : `${value} ${unit}`);

/** A cell's value of a layer, with the digits that the server gives; a dash where it is unknown. */
export const valueOf = (layer, value) =>
  layer.unit === "probability" ? percent(value, layer.digits) : shown(value, layer.digits, layer.unit === "degree" ? "°" : layer.unit);

/** Fit a canvas to its box in device pixels, or a share of them; return width, height and ratio. */
export function fitCanvas(canvas, share = 1) {
  const ratio = share * Math.min(window.devicePixelRatio || 1, 2);
  const width = Math.max(1, Math.round(canvas.clientWidth * ratio));
  const height = Math.max(1, Math.round(canvas.clientHeight * ratio));
  if (canvas.width !== width || canvas.height !== height) {
    canvas.width = width;
    canvas.height = height;
  }
  return { width, height, ratio };
}
