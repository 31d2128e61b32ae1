// What is about a view in three dimensions: its canvas, controls, colours and words.

import { TABLE_LENGTH } from "./palette.js";

export const SLOWER = [10, 30, 100, 300, 1000];
const KEYS = "The body, moving. Arrow keys turn it, plus and minus zoom, Home shows it as at first, "
  + "the space bar plays and pauses.";
const STYLE = `.view3d { display: flex; flex-direction: column; min-height: 0; height: 100%; gap: 4px; }
  .view3d { font-size: 12px; }
  .view3d .stage { position: relative; flex: 1 1 0; min-height: 160px; }
  .view3d canvas, .view3d .stage > svg { position: absolute; inset: 0; width: 100%; height: 100%; }
  .view3d .stage > svg { pointer-events: none; }
  .view3d canvas { cursor: grab; touch-action: none; }
  .view3d .row { display: flex; flex-wrap: wrap; gap: 4px 8px; align-items: center; }
  .view3d .time { flex: 1 1 50px; min-width: 40px; } .view3d .cut { width: 56px; }
  .view3d label { display: inline-flex; gap: 4px; align-items: center; }
  .view3d :is(button, select) { font: inherit; min-height: 24px; }
  .view3d output { min-width: 4.6em; font-variant-numeric: tabular-nums; }
  .view3d .colours { height: 8px; } .view3d .ends { display: flex; justify-content: space-between; }`;

export const element = (name, attributes = {}, ...children) => {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.append(...children);
  return made;
};
const choice = (label, options, chosen) => element("select", { "aria-label": label, title: label },
  ...options.map(([value, words]) => {
    const option = element("option", { value }, words);
    option.selected = value === chosen;
    return option;
  }));
/** A table of colours as a gradient of CSS. */
export const gradient = (table) => Array.from({ length: 17 }, (_, k) => {
  const at = 4 * Math.round(k / 16 * (TABLE_LENGTH - 1));
  return `rgb(${table[at]},${table[at + 1]},${table[at + 2]})`;
}).join(",");

/** The parts of a panel by name, put into a container. */
export function panel(container) {
  if (!document.getElementById("view3d-style")) {
    document.head.append(element("style", { id: "view3d-style" }, STYLE));
  }
  const range = (name, most, label) => element("input",
    { type: "range", class: name, min: 0, max: most, value: 0, "aria-label": label });
  const p = {};
  p.canvas = element("canvas", { tabindex: 0, role: "application", "aria-label": KEYS });
  p.over = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  p.over.setAttribute("aria-hidden", "true");
  p.play = element("button", { type: "button" });
  p.slider = range("time", 1000, "Time");
  p.now = element("output");
  p.slow = choice("How many times slower than real", SLOWER.map((s) => [s, `${s} × slower`]), 100);
  p.hues = choice("Colours", [["motion", "motion"], ["rms", "RMS"]], "motion");
  p.high = choice("Height of the relief", [[0.4, "flat"], [1, "relief"], [2.5, "high"]], 1);
  p.cutter = range("cut", 95, "Cut away from the front, per cent");
  p.above = element("button", { type: "button", title: "Look from above" }, "Above");
  p.home = element("button", { type: "button", title: "Show the body as at first" }, "Reset");
  p.said = element("div");
  p.colours = element("div", { class: "colours", "aria-hidden": "true" });
  p.ends = element("div", { class: "ends" });
  const row = (...children) => element("div", { class: "row" }, ...children);
  p.root = element("div", { class: "view3d" },
    element("div", { class: "stage" }, p.canvas, p.over),
    element("div", {}, p.colours, p.ends),
    row(p.play, p.slider, p.now, p.slow),
    row(p.hues, p.high, element("label", {}, "cut", p.cutter), p.above, p.home),
    p.said);
  container.replaceChildren(p.root);
  return p;
}
