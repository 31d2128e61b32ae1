// Maps of a surface as SVG. Values are by place, row y and column x ascending.

import { HALF } from "./evaluate.js";
import { cached, largestOf } from "./numeric.js";
import { SEQUENTIAL, SIGNED, TABLE_LENGTH } from "./palette.js";
import { escaped, withUnit } from "./text.js";

const MARGIN = { left: 32, right: 10, top: 20, bottom: 50 }; // px around the map for text, ticks and bar
const TICKS = [-40, -20, 0, 20, 40]; // mm
const INFLUENCED = -20; // dB re the largest of the kernel: edge of its region
const GRASP = 2.5e-3; // m within which the pointer takes a corner
const KEY_STEP = 1e-3, LONG_KEY_STEP = 5e-3; // m: step of an arrow key, alone and with shift
const COLOURS = { path: "#56b4e9", threshold: "#ff6fd0", point: "#d55e00" };
const states = new WeakMap(); // by element: options, box, image, hovered place

/** Function that gives the place of a value on the scale of colours, from 0 to 1. */
function placeOnScale({ rms, largest, decibel, signed }) {
  if (decibel && !signed) return (v) => 1 + 20 * Math.log10(Math.max(v / largest, 1e-9)) / decibel;
  return signed ? (v) => 0.5 + v / (2 * largest) : (v) => v / largest;
}

/** A new canvas of a size in px. */
export const canvasOf = (width, height) => Object.assign(document.createElement("canvas"), { width, height });

/** Paint the values on a canvas, one pixel for each place; transparent off the body. */
function paint(canvas, options) {
  const { rms, signed } = options, onScale = placeOnScale(options), colours = signed ? SIGNED : SEQUENTIAL;
  const n = canvas.width, context = canvas.getContext("2d"), data = context.createImageData(n, n);
  rms.forEach((value, p) => {
    if (Number.isNaN(value)) return;
    const from = 4 * Math.round((TABLE_LENGTH - 1) * Math.min(Math.max(onScale(value), 0), 1));
    data.data.set(colours.subarray(from, from + 4), 4 * ((n - 1 - Math.floor(p / n)) * n + p % n));
  });
  context.putImageData(data, 0, 0);
  return canvas;
}

const sideOf = ({ rms }) => Math.round(Math.sqrt(rms.length)); // places along a side of a map

const bars = new Map(); // images by table of colours

/** Image of the colours of a scale, left to right. */
const bar = (table) => cached(bars, table, () => {
  const made = canvasOf(TABLE_LENGTH, 1);
  made.getContext("2d").putImageData(new ImageData(new Uint8ClampedArray(table), TABLE_LENGTH, 1), 0, 0);
  return made.toDataURL();
});

/** Square of the map in an element of this size, in pixels. */
function boxIn(width, height) {
  const room = width - MARGIN.left - MARGIN.right;
  const side = Math.max(40, Math.min(room, height - MARGIN.top - MARGIN.bottom));
  return { side, x: MARGIN.left + Math.max(0, (room - side) / 2), y: MARGIN.top };
}

const toPixels = (box) => ([x, y]) => [box.x + box.side * (0.5 + x / (2 * HALF)),
  box.y + box.side * (0.5 - y / (2 * HALF))];
const mm = (value) => `${Math.round(1e4 * value) / 10 || 0}`.replace("-", "−");

/** A line through points, or lines through every `apart` of them. */
const line = (points, { colour = "currentColor", width = 1, opacity = 1, apart = Infinity } = {}) => (
  `<path d="${points.map(([x, y], k) => `${k % apart ? "L" : "M"}${x.toFixed(1)},${y.toFixed(1)}`).join("")}"
  fill="none" stroke="${colour}" stroke-width="${width}" stroke-linecap="round" stroke-linejoin="round"
  opacity="${opacity}"/>`);
const text = ([x, y], words, { colour = "currentColor", size = 11, anchor = "start", weight = 400 } = {}) => (
  `<text x="${x}" y="${y}" fill="${colour}" font-size="${size}" text-anchor="${anchor}"
  font-weight="${weight}">${escaped(words)}</text>`);
const rectangle = (x, y, width, height, look = "") => (
  `<rect x="${x}" y="${y}" width="${width}" height="${height}" ${look}/>`);
const imageMarkup = (url, x, y, width, height) => `<image href="${url}" x="${x}" y="${y}" width="${width}"
  height="${height}" preserveAspectRatio="none"/>`;
const widthOf = (words, size) => 0.55 * size * words.length;

/** Segments [[[x, y], [x, y]], ...] in steps of the grid of the contour at 0 of values (n * n). */
export function contours(values, n) {
  const segments = [];
  for (let j = 0; j + 1 < n; j++) {
    for (let i = 0; i + 1 < n; i++) {
      const corners = [[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1]];
      const own = corners.map(([x, y]) => values[y * n + x]);
      if (own.some(Number.isNaN)) continue;
      const ends = corners.flatMap(([x, y], k) => {
        const next = (k + 1) % 4, part = own[k] / (own[k] - own[next]);
        if ((own[k] > 0) === (own[next] > 0)) return [];
        return [[x + part * (corners[next][0] - x), y + part * (corners[next][1] - y)]];
      });
      // If two segments cross a cell, its mean decides how they join.
      const turned = own.reduce((sum, v) => sum + v) > 0 === own[0] > 0;
      const order = ends.length === 4 && !turned ? [3, 0, 1, 2] : [0, 1, 2, 3];
      for (let k = 0; k + 1 < ends.length; k += 2) segments.push([ends[order[k]], ends[order[k + 1]]]);
    }
  }
  return segments;
}

/** Markup of the square of a map: image, unless a canvas below shows it, contours, paths, foci and point. */
function inside(options, { box, image: url }) {
  const { path = [], point, hatched } = options, at = toPixels(box), parts = [];
  const n = sideOf(options), cell = box.side / (n - 1);
  const drawZeros = (values, ...looks) => {
    const lines = contours(values, n).map((ends) => ends.map(([i, j]) => (
      [box.x + i * cell, box.y + box.side - j * cell])));
    parts.push(...looks.map((look) => line(lines.flat(), { ...look, apart: 2 })));
  };
  if (url) parts.push(imageMarkup(url, box.x - cell / 2, box.y - cell / 2, box.side + cell, box.side + cell));
  if (hatched) {
    for (let k = -box.side, odd = false; k < box.side; k += 9, odd = !odd) {
      const ends = [[box.x + k, box.y + box.side], [box.x + k + box.side, box.y]];
      parts.push(line(ends, { colour: odd ? "#fff" : "#000", width: 1.5, opacity: 0.3 }));
    }
  }
  if (options.influenced) {
    const peak = largestOf(options.influenced);
    const above = Float32Array.from(options.influenced,
      (v) => 20 * Math.log10(Math.max(v / peak, 1e-9)) - INFLUENCED);
    drawZeros(above, { colour: "#000", width: 2.6, opacity: 0.5 }, { colour: "#fff", width: 1.2 });
  }
  if (options.level) drawZeros(options.level, { colour: COLOURS.threshold, width: 1.8 });
  for (const each of path) {
    if (each.length > 1) parts.push(line(each.map(at), { colour: COLOURS.path, width: 1.8 }));
  }
  for (const [x, y] of (options.corners ?? []).map(at)) {
    parts.push(rectangle(x - 4, y - 4, 8, 8, `fill="#fff" stroke="${COLOURS.path}" stroke-width="1.5"`));
  }
  parts.push(`<g class="foci">${fociMarkup(options, box)}</g>`);
  if (point) {
    const [x, y] = at(point), ends = [[x - 5, y - 5], [x + 5, y + 5], [x - 5, y + 5], [x + 5, y - 5]];
    parts.push(line(ends, { colour: "#fff", width: 4, apart: 2 }),
      line(ends, { colour: COLOURS.point, width: 2.2, apart: 2 }));
  }
  return parts.join("");
}

const fociMarkup = ({ foci = [] }, box) => foci.map(toPixels(box)).flatMap(([x, y]) => (
  [["#fff", 3.4], ["#1673b1", 2]].map(([colour, width]) => `<circle cx="${x}" cy="${y}" r="5" fill="none"
    stroke="${colour}" stroke-width="${width}"/>`))).join("");

/** Markup of a map; `clip` is the name of its clipping path. */
function markup(options, state, clip) {
  const { box } = state, { hatched, title = "" } = options, at = toPixels(box);
  const reading = state.hover ? readout(options, state.hover) : "", parts = [];
  const left = box.x, top = box.y, right = left + box.side, bottom = top + box.side;
  if (widthOf(title, 13) + widthOf(reading, 11) < box.side || !state.hover) { // or the value alone
    parts.push(text([left, top - 7], title, { size: 12, weight: 600 }));
  }
  if (reading) parts.push(text([right, top - 7], reading, { anchor: "end" }));
  parts.push(`<clipPath id="${clip}">${rectangle(left, top, box.side, box.side)}</clipPath>`,
    `<g clip-path="url(#${clip})">${inside(options, state)}</g>`);
  if (hatched) {
    parts.push(rectangle(left + 4, top + 4, Math.min(widthOf(hatched, 11) + 10, box.side - 8), 18,
      'fill="#7a2e00"'), text([left + 9, top + 17], hatched, { colour: "#fff" }));
  }
  parts.push(rectangle(left, top, box.side, box.side, 'fill="none" stroke="currentColor"'));
  for (const tick of TICKS) {
    const [x, y] = at([tick / 1e3, tick / 1e3]), words = mm(tick / 1e3);
    parts.push(line([[x, bottom], [x, bottom + 4], [left - 4, y], [left, y]], { apart: 2 }));
    parts.push(text([x, bottom + 15], tick ? words : "0 mm", { anchor: "middle", size: 10.5 }));
    parts.push(text([left - 6, y + 4], words, { anchor: "end", size: 10.5 }));
  }
  return parts.join("") + barMarkup(options, state);
}

function barMarkup({ largest, unit, decibel, signed }, { box, bar: url }) {
  const top = box.y + box.side + 21, end = withUnit(largest, unit);
  let words = ["0", "", end];
  if (decibel && !signed) words = [`≤ −${decibel} dB`, `−${decibel / 2}`, `0 dB = ${end}`];
  if (signed) words = [withUnit(-largest, unit), "0", `+${end}`];
  if (words.reduce((sum, each) => sum + widthOf(each, 13), 0) > box.side) words[1] = "";
  return imageMarkup(url, box.x, top, box.side, 9) + words.map((each, k) => text(
    [box.x + box.side * k / 2, top + 21], each,
    { size: 10.5, anchor: ["start", "middle", "end"][k] })).join("");
}

/** Value of a map at the place nearest to [x, y] in metre; NaN off the body. */
function valueAt({ rms }, at) {
  const n = sideOf({ rms });
  const [i, j] = at.map((place) => Math.round((place / HALF + 1) * (n - 1) / 2));
  return Math.min(i, j) < 0 || Math.max(i, j) >= n ? NaN : rms[j * n + i];
}

const readout = (options, place) => {
  const value = valueAt(options, place);
  const words = Number.isNaN(value) ? "off the body" : withUnit(value, options.unit);
  return `${mm(place[0])}, ${mm(place[1])} mm: ${words}`;
};

function imagesOf(options, before) {
  const keys = ["rms", "largest", "decibel", "signed", "moving"];
  const same = before && keys.every((key) => before.options[key] === options[key]);
  if (same) return { image: before?.image, bar: before?.bar };
  const n = sideOf(options), painted = options.moving ? null : paint(canvasOf(n, n), options);
  return { image: painted?.toDataURL(), bar: bar(options.signed ? SIGNED : SEQUENTIAL) };
}

/** The canvas below a map that moves, in its place. */
function canvasBelow(svg, options, { x, y, side }) {
  let canvas = svg.previousElementSibling;
  if (canvas?.className !== "moving") {
    if (!options.moving) return null;
    canvas = canvasOf(sideOf(options), sideOf(options));
    canvas.className = "moving";
    svg.before(canvas);
  }
  canvas.hidden = !options.moving;
  const cell = side / (sideOf(options) - 1);
  const [own, around] = [svg, svg.parentElement].map((each) => each.getBoundingClientRect());
  const within = { left: own.left - around.left + x - cell / 2, top: own.top - around.top + y - cell / 2,
    width: side + cell, height: side + cell };
  for (const [name, length] of Object.entries(within)) canvas.style[name] = `${length}px`;
  canvas.style.clipPath = `inset(${cell / 2}px)`;
  return canvas;
}

/** Draw a map with its title, paths and foci on a canvas. */
export function drawFrame(context, box, options) {
  const at = toPixels(box), { path, foci, title } = options, n = sideOf(options);
  context.drawImage(paint(canvasOf(n, n), options), box.x, box.y, box.side, box.side);
  const stroke = (colour, width, points, isClosed) => {
    Object.assign(context, { strokeStyle: colour, lineWidth: width });
    context.beginPath();
    if (isClosed) context.arc(...points, 7, 0, 2 * Math.PI);
    else points.forEach((point, k) => context[k ? "lineTo" : "moveTo"](...point));
    context.stroke();
  };
  for (const each of path) stroke(COLOURS.path, 2, each.map(at));
  for (const place of foci.map(at)) {
    stroke("#fff", 4, place, true);
    stroke("#1673b1", 2, place, true);
  }
  Object.assign(context, { fillStyle: "#111", font: "15px sans-serif" });
  context.fillText(title, box.x, box.y - 10);
}

/** Show other values and foci on a map that moves. Everything else stays. */
export function moveMap(svg, { rms, foci }) {
  const { options, box } = states.get(svg);
  Object.assign(options, { rms, foci });
  paint(svg.previousElementSibling, options);
  svg.querySelector(".foci").innerHTML = fociMarkup(options, box);
}

/**
 * Draw a map in an SVG element whose size is set by styles.
 * @param {SVGSVGElement} svg
 * @param {object} options rms: values (n * n) in `unit`, NaN off the body; unit: "m", "Pa" or "dB";
 *   largest: end of the scale; decibel: range of the scale in dB below `largest`, or 0 if it is linear;
 *   signed: whether the scale is red and blue about 0; level: values (n * n) with a contour at 0;
 *   influenced: the kernel's values (n * n) with a contour at -20 dB; path: paths of points [x, y] in metre;
 *   foci: places [x, y] in metre; corners: places [x, y] in metre that can be dragged; point: [x, y] in
 *   metre; title; hatched: why the values are not valid;
 *   moving: whether `moveMap` will show other values at once
 */
export function drawMap(svg, options) {
  const before = states.get(svg), { width, height } = svg.getBoundingClientRect();
  const state = { options, box: boxIn(width, height), hover: before?.hover, ...imagesOf(options, before) };
  states.set(svg, state);
  svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
  svg.innerHTML = markup(options, state, `clip-${svg.id}`);
  const canvas = canvasBelow(svg, options, state.box);
  if (options.moving) paint(canvas, options);
  if (options.point) {
    svg.setAttribute("aria-label", `${options.title || "Map"}. Selected point ${
      readout(options, options.point)}. Arrow keys move it.`);
  }
}

/**
 * Let pointer and arrow keys select points of a map, and show the value under the pointer. Calls
 * `onPoint(x, y)` in metre, or `onCorner(k, x, y)` while corner k of the path is dragged.
 */
export function mapControls(svg, onPoint, onCorner) {
  let held = -1; // corner that is dragged
  svg.tabIndex = 0;
  svg.setAttribute("role", "application");
  svg.style.touchAction = "pan-y"; // moving a finger up scrolls the page
  const place = (event) => {
    const { box } = states.get(svg), bounds = svg.getBoundingClientRect();
    const parts = [event.clientX - bounds.left - box.x, bounds.top + box.y + box.side - event.clientY];
    return parts.map((part) => 2 * HALF * (part / box.side - 0.5));
  };
  const bounded = (at) => at.map((v) => Math.round(1e4 * Math.min(Math.max(v, -HALF), HALF)) / 1e4);
  const hover = (at) => {
    const state = states.get(svg);
    if (!state) return;
    const within = at && Math.max(...at.map(Math.abs)) <= HALF;
    state.hover = within ? at.map((v) => Math.round(1e3 * v) / 1e3) : null;
    drawMap(svg, state.options);
  };
  const select = (event) => {
    if (!states.has(svg)) return;
    const at = bounded(place(event).map((v) => Math.round(1e3 * v) / 1e3));
    if (held < 0) onPoint(...at); else onCorner(held, ...at);
  };
  const cornerAt = ([x, y]) => (states.get(svg)?.options.corners ?? []).findIndex(
    ([own, other]) => Math.hypot(own - x, other - y) < GRASP);
  svg.addEventListener("pointerdown", (event) => {
    svg.setPointerCapture(event.pointerId);
    held = cornerAt(place(event));
    select(event);
  });
  svg.addEventListener("pointermove", (event) => {
    if (event.buttons) select(event);
    if (states.has(svg)) hover(place(event));
  });
  svg.addEventListener("pointerleave", () => hover(null));
  const ways = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
  svg.addEventListener("keydown", (event) => {
    const way = ways[event.key], from = states.get(svg)?.options.point;
    if (!way || !from || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    const next = bounded(from.map((v, k) => v + way[k] * (event.shiftKey ? LONG_KEY_STEP : KEY_STEP)));
    states.get(svg).options.point = next; // for the next key, before it is drawn
    onPoint(...next);
  });
}

/** Legend of the marks of a map, as markup. */
export const MAP_LEGEND = [
  ["path of the focus", `stroke="${COLOURS.path}" stroke-width="2"`],
  ["kernel at −20 dB", 'stroke="currentColor" stroke-width="1.2"'],
  ["detection threshold", `stroke="${COLOURS.threshold}" stroke-width="2"`],
].map(([words, look]) => '<span class="mark"><svg width="20" height="8" aria-hidden="true">'
  + `<path d="M1,4H19" fill="none" ${look}/></svg> <span>${words}</span></span>`).join(" ");
