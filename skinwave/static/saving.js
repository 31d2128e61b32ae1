// The menu to save figures and data.

import { canvasOf } from "./maps.js";
import { escaped } from "./text.js";
import { textOf } from "./values.js";

const NS = "http://www.w3.org/2000/svg";
const HEAD = 20; // px above a figure for its scene
const SHOWN = [["amplitude"], ["am"], ["shape", "size", "speed"], ["peak", "height"], ["x", "y"]];
const STYLED = ["fill", "stroke", "stroke-width", "stroke-dasharray", "stroke-linejoin", "opacity",
  "fill-opacity", "font-size", "font-family", "font-weight", "paint-order"];

/** Text of an SVG element at x, y that contains its styles. */
function standalone(svg, x, y) {
  const copy = svg.cloneNode(true), from = [...svg.querySelectorAll("*")];
  [...copy.querySelectorAll("*")].forEach((element, k) => {
    const style = getComputedStyle(from[k]);
    for (const name of STYLED) element.setAttribute(name, style.getPropertyValue(name));
    element.removeAttribute("class");
  });
  const { width, height } = svg.getBoundingClientRect();
  for (const [name, value] of Object.entries({ x, y, width, height })) copy.setAttribute(name, value);
  for (const name of ["class", "tabindex", "role", "aria-label", "style"]) copy.removeAttribute(name);
  return new XMLSerializer().serializeToString(copy);
}

/**
 * SVG {text, width, height} of elements of the page in their places. SVG elements are copied, a canvas gives
 * its `asSvg()`, and other elements their text.
 */
function figureOf(parts, paper, title) {
  const visible = parts.filter((part) => part.getClientRects().length);
  const boxes = visible.map((part) => part.getBoundingClientRect());
  const left = Math.min(...boxes.map((b) => b.left)) - 8, top = Math.min(...boxes.map((b) => b.top)) - 8;
  const width = Math.max(...boxes.map((b) => b.right)) - left + 8;
  const height = Math.max(...boxes.map((b) => b.bottom)) - top + 8 + HEAD;
  const inside = visible.map((part, k) => {
    const x = boxes[k].left - left, y = boxes[k].top - top;
    if (part instanceof SVGSVGElement) return standalone(part, x, y);
    if (part.asSvg) {
      const { color } = getComputedStyle(part);
      return `<g transform="translate(${x}, ${y})" font-family="sans-serif"
        color="${color}">${part.asSvg()}</g>`;
    }
    const style = getComputedStyle(part);
    return `<text x="${x}" y="${y + 0.78 * boxes[k].height}" fill="${style.color}" font-family="sans-serif"
      font-size="${style.fontSize}" font-weight="${style.fontWeight}">${escaped(part.innerText)}</text>`;
  });
  const text = `<svg xmlns="${NS}" width="${width}" height="${height}" viewBox="0 0 ${width} ${height}">
<rect width="100%" height="100%" fill="${paper}"/>
<text x="8" y="15" font-family="sans-serif" font-size="11" fill="#777">${escaped(title)}</text>
<g transform="translate(0, ${HEAD})">${inside.join("\n")}</g></svg>`;
  return { text, width, height };
}

/** PNG of an SVG text at twice its size, as a blob. */
async function pngOf({ text, width, height }) {
  const picture = new Image();
  picture.src = URL.createObjectURL(new Blob([text], { type: "image/svg+xml" }));
  await picture.decode();
  const canvas = canvasOf(Math.round(2 * width), Math.round(2 * height));
  canvas.getContext("2d").drawImage(picture, 0, 0, canvas.width, canvas.height);
  URL.revokeObjectURL(picture.src);
  return new Promise((resolve) => canvas.toBlob(resolve, "image/png"));
}

function download(name, content, type) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(content instanceof Blob ? content : new Blob([content], { type }));
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1e4);
}

/** Figure of the visible tiles, maps with their legend, and plots of the page, with its scene. */
const figure = ({ values, body }) => figureOf([...document.querySelectorAll(
  "#tiles .tile > span, .map, .solid canvas, #map-legend svg, #map-legend span span, .plot-card h2, .plot,"
  + " #pane .plot")], getComputedStyle(document.documentElement).getPropertyValue("--card"),
[body.title, ...SHOWN.map((keys) => keys.map((key) => textOf(key, values[key])).join(", "))].join("; "));

/**
 * Fill the menu of files to save. `answer()` gives the present answer, `writers` write files: [[title, name,
 * type, (answer) => text or bytes]].
 */
export function offerSaves(menu, { answer, notify, writers }) {
  const items = [
    ["Maps and plots, SVG", "skinwave.svg", "image/svg+xml", (answer) => figure(answer).text],
    ["Maps and plots, PNG", "skinwave.png", "image/png", (answer) => pngOf(figure(answer))],
    ...writers,
  ];
  menu.innerHTML = items.map(([title], k) => (
    `<button type="button" data-save="${k}">${title}</button>`)).join("");
  menu.addEventListener("click", async ({ target }) => {
    const item = items[target.dataset.save];
    if (!item) return;
    const [title, name, type, write] = item;
    try {
      download(name, await write(answer()), type);
      notify(`${name} is saved.`);
    } catch (error) { notify(`${title}: ${error.message}`); }
  });
}
