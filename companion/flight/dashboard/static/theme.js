// Colours by name: the table stands in style.css, and what is drawn on a canvas reads it there.

const KEPT = "slz-theme"; // "light" or "dark" where the switch was used, else the browser's wish counts
const root = document.documentElement;
const wish = matchMedia("(prefers-color-scheme: light)");
const table = new Map();

/** The theme that is shown: "light" or "dark". */
export const theme = () => root.dataset.theme;

/** A colour of the table, as #rrggbb or #rrggbbaa. */
export function ink(name) {
  if (!table.has(name)) table.set(name, getComputedStyle(root).getPropertyValue(`--${name}`).trim());
  return table.get(name);
}

/** The same for WebGL and pixels: red, green, blue between 0 and 1, and an opacity. */
export const tint = (name, opacity = 1) => [1, 3, 5].map((at) => parseInt(ink(name).slice(at, at + 2), 16) / 255).concat(opacity);

/** Name, line, fill and halo of a kind of thing. */
export const inks = (name, more) => ({
  ...more,
  name,
  get line() { return ink(name); },
  get fill() { return ink(`${name}-fill`) || `${ink(name)}29`; },
  get halo() { return ink("halo"); },
});

function show() {
  root.dataset.theme = localStorage.getItem(KEPT) ?? (wish.matches ? "light" : "dark");
  table.clear();
  document.querySelector("meta[name=theme-color]")?.setAttribute("content", ink("plate"));
  root.dispatchEvent(new Event("theme"));
}

/** Change the theme, and remember it. */
export function switchTheme() {
  localStorage.setItem(KEPT, theme() === "light" ? "dark" : "light");
  show();
}

wish.addEventListener("change", show);
show();
