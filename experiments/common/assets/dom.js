
"use strict";
// Elements, numbers and colours. A person's texts enter the page as text nodes, never as HTML.

const DATA = JSON.parse(document.getElementById("data").textContent);

/** Make an element: attributes, listeners (functions), and children, of which strings become text. */
function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (typeof value === "function") made.addEventListener(name, value);
    else made.setAttribute(name, value);
  }
  made.append(...children);
  return made;
}

/** A select element under a label; `choices` are pairs of value and text. */
function choice(label, choices, chosen, changed) {
  const select = element("select", { change: () => changed(select.value) });
  for (const [value, text] of choices) select.append(element("option", { value }, text));
  select.value = chosen;
  return element("label", {}, `${label} `, select);
}

/** A number with its unit: six digits, or as many as wanted; None where there is none. */
function shown(value, unit = "", digits = 6) {
  if (value === null || value === undefined) return "none";
  const text = String(Number(value.toPrecision(digits))).replace(/^-/, "\u2212").replace("e-", "e\u2212");
  return unit ? `${text}\u00a0${unit}` : text;
}

/** The unit in which a size reads best, of those from small to large: [name, how many make the SI unit]. */
function unitFor(size, units) {
  const fit = units.filter(([, factor]) => size * factor >= 1);
  return fit.length ? fit[fit.length - 1] : units[0];
}

const ANGLES = [["\u00b5rad", 1e6], ["mrad", 1e3], ["rad", 1]];
const RATES = [["\u00b5rad/s", 1e6], ["mrad/s", 1e3], ["rad/s", 1]];

/** Rows of a table of numbers, renewed in place: pairs of name and text. Roles are said, for the style takes them away. */
function fillTable(table, rows) {
  if (table.rows.length !== rows.length) {
    table.setAttribute("role", "table");
    table.replaceChildren(...rows.map(() => element("tr", { role: "row" },
      element("th", { role: "rowheader", scope: "row" }), element("td", { role: "cell" }))));
  }
  rows.forEach(([name, text], index) => {
    const [head, cell] = table.rows[index].cells;
    if (head.textContent !== name) head.textContent = name;
    if (cell.textContent !== text) cell.textContent = text;
  });
}

const floats = (text) => new Float64Array(bytes(text).buffer);
const counts = (text) => new Uint32Array(bytes(text).buffer);
const bytes = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));

const theme = {
  colours: {},
  listeners: [],
  set(name) {
    document.documentElement.dataset.theme = name;
    document.getElementById("theme").textContent = name === "dark" ? "Light" : "Dark";
    document.getElementById("theme").setAttribute("aria-label", `Switch to ${name === "dark" ? "light" : "dark"} colours`);
    const style = getComputedStyle(document.documentElement);
    for (const key of ["paper", "panel", "ink", "quiet", "line", "grid", "near", "far", "set", "measured", "impulse", "extra"]) {
      theme.colours[key] = style.getPropertyValue(`--${key}`).trim();
    }
    theme.listeners.forEach((listener) => listener());
  },
};

/** The colour a share of the way from the nearest to the farthest: dark to light, so that it reads in grey. */
function ramp(share) {
  const part = (hex, at) => parseInt(hex.slice(at, at + 2), 16);
  const mix = (at) => Math.round(part(theme.colours.near, at) * (1 - share) + part(theme.colours.far, at) * share);
  return `rgb(${mix(1)} ${mix(3)} ${mix(5)})`;
}

const tip = {
  box: document.getElementById("tip"),
  show(lines, event) {
    tip.box.hidden = !lines;
    if (!lines) return;
    tip.box.replaceChildren(...lines.map((line) => element("div", {}, line)));
    const { offsetWidth: width, offsetHeight: height } = tip.box;
    tip.box.style.left = `${Math.max(4, Math.min(event.clientX + 14, innerWidth - width - 4))}px`;
    tip.box.style.top = `${event.clientY + height + 18 < innerHeight ? event.clientY + 14 : event.clientY - height - 10}px`;
  },
};

{
  const dark = matchMedia("(prefers-color-scheme: dark)");
  theme.set(dark.matches ? "dark" : "light");
  dark.addEventListener("change", () => theme.set(dark.matches ? "dark" : "light"));
  document.getElementById("theme").addEventListener("click", () =>
    theme.set(document.documentElement.dataset.theme === "dark" ? "light" : "dark"));
  document.getElementById("heading").textContent = DATA.heading;
  document.getElementById("about").append(...DATA.about.map((line) => element("p", {}, line)));
}
