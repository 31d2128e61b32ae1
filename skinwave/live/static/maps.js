// Maps of a surface on a canvas, and as SVG for figures: 45 x 45 places, row y and column x ascending.

import { contours } from "./contours.js";
import { CanvasPen, SvgPen } from "./pens.js";
import { SEQUENTIAL, SIGNED, TABLE_LENGTH, withUnit } from "./palette.js";

export const REACH = 0.044; // m, of a map either way
const MARGIN = { left: 32, right: 10, top: 20, bottom: 50 }; // pixels about the map: text, ticks, bar
const FINE = 4; // pixels of the image from place to place
const TICKS = [-40, -20, 0, 20, 40]; // mm
const INFLUENCED = -20; // dB of the kernel's largest: border of its area
const CLICKED = 1e-3, LEAP = 5e-3; // m: a step by an arrow key, and with shift
export const COLOURS = { path: "#56b4e9", threshold: "#ff6fd0", point: "#d55e00" };
const kept = new WeakMap(); // by canvas: options, box, image, hovered place

/** Place of each value on the scale of colours, 0 to 1, beyond these where it is clipped. */
function placeOnScale({ rms, largest, decibel, signed }) {
  if (decibel && !signed) return (v) => 1 + 20 * Math.log10(Math.max(v / largest, 1e-9)) / decibel;
  return signed ? (v) => 0.5 + v / (2 * largest) : (v) => v / largest;
}

function picture(width, height) {
  const canvas = document.createElement("canvas");
  canvas.width = width;
  canvas.height = height;
  return canvas;
}

/** The values in colours, bilinear between places; transparent where there is no body. */
function image(options, n) {
  const { rms, signed } = options, onScale = placeOnScale(options), side = (n - 1) * FINE;
  const grid = Float32Array.from(rms, onScale), table = signed ? SIGNED : SEQUENTIAL;
  const made = picture(side, side), context = made.getContext("2d");
  const data = context.createImageData(side, side), out = new Uint32Array(data.data.buffer);
  const colours = new Uint32Array(table.buffer);
  for (let row = 0; row < side; row++) {
    const v = (side - row - 0.5) / FINE, j = Math.min(Math.floor(v), n - 2), b = v - j;
    for (let column = 0; column < side; column++) {
      const u = (column + 0.5) / FINE, i = Math.min(Math.floor(u), n - 2), a = u - i, k = j * n + i;
      const value = between(grid, k, n, a, b);
      if (value !== value) continue;
      const place = Math.round((TABLE_LENGTH - 1) * Math.min(Math.max(value, 0), 1));
      out[row * side + column] = colours[place];
    }
  }
  context.putImageData(data, 0, 0);
  return made;
}

/** Value at parts a and b of a cell; at an edge of the body from the corners on it. */
function between(grid, k, n, a, b) {
  const low = (1 - a) * grid[k] + a * grid[k + 1], high = (1 - a) * grid[k + n] + a * grid[k + n + 1];
  const value = (1 - b) * low + b * high;
  return value === value ? value : besideEdge(grid, k, n, a, b);
}

/** Mean of those of four corners that are on the body, NaN if they weigh less than a half. */
function besideEdge(grid, k, n, a, b) {
  let sum = 0, weights = 0;
  const parts = [(1 - a) * (1 - b), a * (1 - b), (1 - a) * b, a * b];
  [k, k + 1, k + n, k + n + 1].forEach((corner, c) => {
    if (Number.isNaN(grid[corner])) return;
    sum += parts[c] * grid[corner];
    weights += parts[c];
  });
  return weights < 0.5 ? NaN : sum / weights;
}

/** The colours of a scale, left to right. */
function bar(table) {
  const made = picture(TABLE_LENGTH, 1);
  made.getContext("2d").putImageData(new ImageData(new Uint8ClampedArray(table), TABLE_LENGTH, 1), 0, 0);
  return made;
}

/** The square of the map in a canvas of a size, in pixels. */
function boxIn(width, height) {
  const room = width - MARGIN.left - MARGIN.right;
  const side = Math.max(40, Math.min(room, height - MARGIN.top - MARGIN.bottom));
  return { side, x: MARGIN.left + Math.max(0, (room - side) / 2), y: MARGIN.top };
}

const toPixels = (box, reach) => ([x, y]) => [box.x + box.side * (0.5 + x / (2 * reach)),
  box.y + box.side * (0.5 - y / (2 * reach))];
const mm = (value) => `${Math.round(1e4 * value) / 10 || 0}`.replace("-", "−");

function draw(pen, options, state, ink) {
  const { box } = state, { rms, path = [], foci = [], point, hatched, reach } = options;
  const at = toPixels(box, reach);
  const drawZeros = (values, ...looks) => {
    const n = Math.round(Math.sqrt(values.length)), step = 2 * reach / (n - 1);
    for (const line of contours(values, n)) {
      const points = line.map(([i, j]) => at([i * step - reach, j * step - reach]));
      for (const look of looks) pen.line(points, look);
    }
  };
  const said = state.hover ? readout(options, state.hover) : options.note || "", { title = "" } = options;
  if (pen.width(title, 13) + pen.width(said, 11) < box.side || !state.hover) { // or the value alone
    pen.text([box.x, box.y - 7], title, { colour: ink, size: 12, bold: true });
  }
  if (said) pen.text([box.x + box.side, box.y - 7], said, { colour: ink, size: 11, anchor: "end" });
  pen.within(box.x, box.y, box.side, box.side, () => {
    if (rms) pen.image(state.image, box.x, box.y, box.side, box.side, options.stale ? 0.3 : 1);
    if (hatched) {
      for (let k = -box.side, odd = false; k < box.side; k += 9, odd = !odd) {
        const ends = [[box.x + k, box.y + box.side], [box.x + k + box.side, box.y]];
        pen.line(ends, { colour: odd ? "#fff" : "#000", width: 1.5, opacity: 0.3 });
      }
    }
    if (options.influenced) {
      const peak = options.influenced.reduce((a, b) => (b > a ? b : a), 0);
      const above = Float32Array.from(options.influenced,
        (v) => 20 * Math.log10(Math.max(v / peak, 1e-9)) - INFLUENCED);
      drawZeros(above, { colour: "#000", width: 2.6, opacity: 0.5 },
        { colour: "#fff", width: 1.8, dash: [0.1, 4] });
    }
    if (options.level) drawZeros(options.level, { colour: COLOURS.threshold, width: 1.8 });
    for (const line of path.length && typeof path[0][0] === "number" ? [path] : path) {
      if (line.length > 1) pen.line(line.map(at), { colour: COLOURS.path, width: 1.8 });
    }
    for (const focus of foci) {
      pen.circle(at(focus), 5, { colour: "#fff", width: 3.4 });
      pen.circle(at(focus), 5, { colour: "#1673b1", width: 2 });
    }
    if (point) {
      const [x, y] = at(point);
      for (const [colour, width] of [["#fff", 4], [COLOURS.point, 2.2]]) {
        pen.line([[x - 5, y - 5], [x + 5, y + 5]], { colour, width });
        pen.line([[x - 5, y + 5], [x + 5, y - 5]], { colour, width });
      }
    }
  });
  if (hatched && typeof hatched === "string") {
    pen.box(box.x + 4, box.y + 4, Math.min(pen.width(hatched, 11) + 10, box.side - 8), 18, "#7a2e00");
    pen.text([box.x + 9, box.y + 17], hatched, { colour: "#fff", size: 11 });
  }
  const left = box.x, top = box.y, right = left + box.side, bottom = top + box.side;
  pen.line([[left, top], [right, top], [right, bottom], [left, bottom], [left, top]], { colour: ink });
  for (const tick of TICKS) {
    const [x, y] = at([tick / 1e3, tick / 1e3]), words = mm(tick / 1e3);
    pen.line([[x, bottom], [x, bottom + 4]], { colour: ink });
    pen.line([[left - 4, y], [left, y]], { colour: ink });
    pen.text([x, bottom + 15], tick ? words : "0 mm", { colour: ink, anchor: "middle", size: 10.5 });
    pen.text([left - 6, y + 4], words, { colour: ink, anchor: "end", size: 10.5 });
  }
  if (rms) drawBar(pen, options, state, ink);
}

function drawBar(pen, options, { box, bar: colours }, ink) {
  const { largest, unit, decibel, signed } = options, top = box.y + box.side + 21;
  pen.image(colours, box.x, top, box.side, 9);
  const end = withUnit(largest, unit);
  let words = ["0", "", end];
  if (decibel && !signed) words = [`≤ −${decibel} dB`, `−${decibel / 2}`, `0 dB = ${end}`];
  if (signed) words = [withUnit(-largest, unit), "0", `+${end}`];
  if (words.reduce((sum, text) => sum + pen.width(text, 13), 0) > box.side) words[1] = "";
  words.forEach((text, k) => pen.text([box.x + box.side * k / 2, top + 21], text,
    { colour: ink, size: 10.5, anchor: ["start", "middle", "end"][k] }));
}

/** Value of a map at a place in metre, bilinear; NaN off the body. */
export function valueAt({ rms, reach = REACH }, [x, y]) {
  const n = Math.round(Math.sqrt(rms.length));
  const [u, v] = [x, y].map((place) => (place / reach + 1) * (n - 1) / 2);
  if (!(u >= 0 && v >= 0 && u <= n - 1 && v <= n - 1)) return NaN;
  const i = Math.min(Math.floor(u), n - 2), j = Math.min(Math.floor(v), n - 2);
  return between(rms, j * n + i, n, u - i, v - j);
}

const readout = (options, place) => {
  const value = options.rms ? valueAt(options, place) : NaN;
  const words = Number.isNaN(value) ? "no body" : withUnit(value, options.unit);
  return `${mm(place[0])}, ${mm(place[1])} mm: ${words}`;
};

function completed(options) {
  const peak = (options.rms || []).reduce((a, b) => (Math.abs(b) > a ? Math.abs(b) : a), 0);
  return { reach: REACH, unit: "m", ...options, largest: options.largest || peak || 1 };
}

function imagesOf(options, before) {
  const keys = ["rms", "largest", "decibel", "signed"];
  const same = before && keys.every((key) => before.options[key] === options[key]);
  if (same || !options.rms) return { image: before?.image, bar: before?.bar };
  const n = Math.round(Math.sqrt(options.rms.length));
  return { image: image(options, n), bar: bar(options.signed ? SIGNED : SEQUENTIAL) };
}

/**
 * Draw a map on a canvas, which has its size by styles. `canvas.asSvg()` is the same as the inside of
 * an SVG element.
 * @param {HTMLCanvasElement} canvas
 * @param {object} options rms: values (n * n) in `unit`, NaN off the body, none yet if not given;
 *   unit: "m", "Pa", "m/s", "dB"; largest: end of the scale, else of the values; decibel: span of a scale in
 *   dB below `largest`, linear if 0; signed: red and blue about 0; level: values (n * n), with a contour at
 *   0; influenced: the kernel's values (n * n), with a dotted border at -20 dB; path: points [x, y] in metre,
 *   or several paths; foci: places [x, y] in metre; point: [x, y]; title; note: at the top right;
 *   hatched: true, or why the values are not valid; stale: whether they are of an earlier body
 */
export function drawMap(canvas, options) {
  const before = kept.get(canvas), full = completed(options), ratio = window.devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  const state = { options: full, box: boxIn(width, height), hover: before?.hover, ...imagesOf(full, before) };
  kept.set(canvas, state);
  if (canvas.width !== Math.round(width * ratio)) canvas.width = Math.round(width * ratio);
  if (canvas.height !== Math.round(height * ratio)) canvas.height = Math.round(height * ratio);
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  const ink = getComputedStyle(canvas).color;
  draw(new CanvasPen(context), full, state, ink);
  canvas.asSvg = () => {
    const pen = new SvgPen();
    draw(pen, full, { ...state, hover: null }, ink);
    return pen.parts.join("");
  };
  if (full.point) {
    const said = `${full.title || "Map"}. Selected point ${readout(full, full.point)}. Arrow keys move it.`;
    canvas.setAttribute("aria-label", said);
  }
}

/**
 * Select points of a map by pointer and arrow keys (1 mm, with shift 5 mm), and show the value under
 * the pointer. Calls onPoint(x, y) in metre.
 */
export function mapControls(canvas, onPoint) {
  canvas.tabIndex = 0;
  canvas.setAttribute("role", "application");
  canvas.style.touchAction = "pan-y"; // a finger that moves up scrolls the page
  const place = (event) => {
    const { box, options: { reach } } = kept.get(canvas), bounds = canvas.getBoundingClientRect();
    const parts = [event.clientX - bounds.left - box.x, bounds.top + box.y + box.side - event.clientY];
    return parts.map((part) => 2 * reach * (part / box.side - 0.5));
  };
  const bounded = (at) => at.map((v) => Math.round(1e4 * Math.min(Math.max(v, -REACH), REACH)) / 1e4);
  const hover = (at) => {
    const state = kept.get(canvas);
    if (!state) return;
    const within = at && Math.max(...at.map(Math.abs)) <= state.options.reach;
    state.hover = within ? at.map((v) => Math.round(1e3 * v) / 1e3) : null;
    drawMap(canvas, state.options);
  };
  const select = (event) => {
    if (kept.has(canvas)) onPoint(...bounded(place(event).map((v) => Math.round(1e3 * v) / 1e3)));
  };
  let pressed = false;
  canvas.addEventListener("pointerdown", (event) => {
    pressed = true;
    canvas.setPointerCapture(event.pointerId);
    select(event);
  });
  canvas.addEventListener("pointermove", (event) => {
    if (pressed) select(event);
    if (kept.has(canvas)) hover(place(event));
  });
  for (const name of ["pointerup", "pointercancel"]) {
    canvas.addEventListener(name, () => { pressed = false; });
  }
  canvas.addEventListener("pointerleave", () => hover(null));
  const ways = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
  canvas.addEventListener("keydown", (event) => {
    const way = ways[event.key], from = kept.get(canvas)?.options.point;
    if (!way || !from || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    onPoint(...bounded(from.map((v, k) => v + way[k] * (event.shiftKey ? LEAP : CLICKED))));
  });
}

/** The marks of a map and what they mean, as markup. */
export const MAP_LEGEND = [
  ["path of the focus", `stroke="${COLOURS.path}" stroke-width="2"`],
  ["kernel above −20 dB",
    'stroke="currentColor" stroke-width="2" stroke-linecap="round" stroke-dasharray="0.1 4"'],
  ["detection threshold", `stroke="${COLOURS.threshold}" stroke-width="2"`],
].map(([words, look]) => '<span class="mark"><svg width="20" height="8" aria-hidden="true">'
  + `<path d="M1,4H19" fill="none" ${look}/></svg> ${words}</span>`).join(" ");
