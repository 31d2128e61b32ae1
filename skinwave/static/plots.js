// Plots as SVG: curves, stems and names with one or two vertical axes. Pointer and arrow keys read values.

import { indexIn } from "./numeric.js";
import { escaped, rounded } from "./text.js";

const LEFT = 44, RIGHT = 46, TOP = 20, BOTTOM = 20;
const NAME_HEIGHT = 13, READING_DISTANCE = 14; // px

/** Smallest of 1, 1.5, 2, 3, 4, 5, 6 or 8 times a power of ten that is not below a value. */
export function niceTop(value) {
  if (!(value > 0) || !Number.isFinite(value)) return 1;
  const unit = 10 ** Math.floor(Math.log10(value) + 1e-12);
  return unit * ([1, 1.5, 2, 3, 4, 5, 6, 8, 10].find((step) => step * unit >= value * (1 - 1e-9)) ?? 10);
}

/**
 * Tops of axes by name that stay while a control moves. They grow if a curve does not fit, and shrink only
 * when nothing moves.
 */
export function keptScales() {
  const tops = new Map();
  return (name, largest, moving) => {
    const fit = niceTop(1.08 * largest);
    if (!(moving && fit < tops.get(name))) tops.set(name, fit);
    return tops.get(name);
  };
}

/** Round values within [low, high], about `count` of them, and the step between them. */
function ticks(low, high, count) {
  const raw = (high - low) / Math.max(count, 1), unit = 10 ** Math.floor(Math.log10(raw));
  const step = unit * [1, 2, 5, 10].find((s) => s * unit >= raw * 0.999);
  const values = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) values.push(k * step);
  return { values, step };
}

/** Values 1, 2 and 5 times powers of ten within [low, high], and a step below all of them. */
function logarithmicTicks(low, high) {
  const powers = Array.from({ length: 12 }, (_, k) => 10 ** (k - 4));
  const values = powers.flatMap((power) => [power, 2 * power, 5 * power]);
  return { values: values.filter((v) => v >= low * (1 - 1e-9) && v <= high * (1 + 1e-9)), step: 1 };
}

/** Return a number with as many decimals as its step needs. */
function atStep(value, step) {
  const decimals = Math.max(0, Math.ceil(-Math.log10(step) - 1e-9));
  return (Math.abs(value) < 1e-9 * step ? 0 : value).toFixed(Math.min(decimals, 6)).replace("-", "−");
}

const dashed = ({ dash }) => (dash ? ` stroke-dasharray="${dash}"` : "");

/** SVG of a name such as f_d or 2 f_AM − f_d: what follows an underscore is a subscript. */
const subscripted = (name) => escaped(name).replace(/_(\w+)/g,
  '<tspan dy="2.5" font-size="80%">$1</tspan><tspan dy="-2.5">&#8203;</tspan>');

/**
 * A plot inside an element.
 *
 * `draw(spec)` takes { x: {label, range, log}, y: {label, range, role}, y2, curves, names, hatched, label }.
 * A curve has {role, x, y, name, width, dash, fill, stems, offset}. Names are [{x, y, text}], the most
 * important first. If there are two axes, only the kernel is on the first one.
 */
export function createPlot(host, { announce }) {
  host.innerHTML = '<svg tabindex="0" role="img" aria-label="Plot, not yet drawn" class="plot">'
    + "<g></g><g></g></svg>";
  const svg = host.firstElementChild, [picture, over] = svg.children, clip = `clip-${host.id}`;
  let spec = null, size = [0, 0], cursor = null, selected = -1;

  const area = () => [LEFT, TOP, size[0] - RIGHT, size[1] - BOTTOM];
  const toX = (v) => {
    const [x0, , x1] = area(), scaled = (own) => (spec.x.log ? Math.log(Math.max(own, 1e-3)) : own);
    const [low, high] = spec.x.range.map(scaled);
    return x0 + (x1 - x0) * (scaled(v) - low) / (high - low || 1);
  };
  const axisOf = (role) => (spec.y2 && role !== "kernel" ? "y2" : "y");
  const toY = (v, axis) => {
    const [, y0, , y1] = area(), [low, high] = spec[axis].range;
    return y1 - (y1 - y0) * (v - low) / (high - low || 1);
  };

  function render() {
    if (!spec || !size[0]) return;
    svg.setAttribute("viewBox", `0 0 ${size[0]} ${size[1]}`);
    svg.setAttribute("aria-label", spec.label);
    const [x0, y0, x1, y1] = area();
    const parts = [`<clipPath id="${clip}"><rect x="${x0}" y="${y0 - 6}" width="${Math.max(x1 - x0, 1)}"
      height="${Math.max(y1 - y0 + 7, 1)}"/></clipPath>`];
    parts.push(axes(x0, y0, x1, y1), `<g clip-path="url(#${clip})">`);
    for (const curve of spec.curves) parts.push(curve.stems ? stems(curve) : line(curve));
    if (spec.hatched) parts.push(`<rect class="hatched" fill="url(#hatch)" x="${x0}" y="${y0}"
      width="${Math.max(x1 - x0, 1)}" height="${Math.max(y1 - y0, 1)}"/>`);
    parts.push("</g>", legend(x0, x1), names(x0, x1));
    picture.innerHTML = parts.join("");
    drawMarks();
  }

  function axes(x0, y0, x1, y1) {
    const parts = [`<path class="axis" d="M${x0},${y0}V${y1}H${x1}${spec.y2 ? `V${y0}` : ""}"/>`];
    const [low, high] = spec.x.range, label = spec.x.label, room = 6 * label.length + 8;
    const across = spec.x.log ? logarithmicTicks(low, high) : ticks(low, high, (x1 - x0) / 64);
    for (const v of across.values) {
      const x = toX(v).toFixed(1);
      parts.push(`<path class="grid" d="M${x},${y0}V${y1}"/>`);
      if (x < x1 - room) parts.push(`<text x="${x}" y="${y1 + 13}" text-anchor="middle">${
        atStep(v, across.step)}</text>`);
    }
    parts.push(`<text x="${x1}" y="${y1 + 13}" text-anchor="end">${escaped(label)}</text>`);
    for (const axis of spec.y2 ? ["y", "y2"] : ["y"]) {
      const own = spec[axis], up = ticks(...own.range, (y1 - y0) / 34);
      const [x, anchor] = axis === "y" ? [x0 - 4, "end"] : [x1 + 4, "start"];
      for (const v of up.values) {
        const y = toY(v, axis);
        if (axis === "y") parts.push(`<path class="grid${v === 0 ? " zero" : ""}" d="M${x0},${
          y.toFixed(1)}H${x1}"/>`);
        parts.push(`<text class="of-${own.role ?? "ink"}" x="${x}" y="${(y + 3.5).toFixed(1)}"
          text-anchor="${anchor}">${atStep(v, up.step)}</text>`);
      }
      parts.push(`<text class="of-${own.role ?? "ink"} unit" x="${axis === "y" ? 2 : size[0] - 2}" y="11"
        text-anchor="${axis === "y" ? "start" : "end"}">${escaped(own.label)}</text>`);
    }
    return parts.join("");
  }

  function line(curve) {
    const { x: xs, y: ys, role } = curve, axis = axisOf(role);
    const [low, high] = spec[axis].range, reach = 2 * (high - low);
    let d = "", on = false;
    for (let k = 0; k < xs.length; k++) {
      const y = ys[k];
      if (!Number.isFinite(y)) { on = false; continue; }
      const inside = Math.min(Math.max(y, low - reach), high + reach);
      d += `${on ? "L" : "M"}${toX(xs[k]).toFixed(1)},${toY(inside, axis).toFixed(1)}`;
      on = true;
    }
    const zero = toY(0, axis).toFixed(1);
    const [first, last] = [xs[0], xs[xs.length - 1]].map((x) => `${toX(x).toFixed(1)},${zero}`);
    const filled = curve.fill && d ? `<path class="filled is-${role}" d="${d}L${last}L${first}Z"/>`
      : "";
    return `${filled}<path class="curve is-${role}" d="${d}"${curve.width ? ` stroke-width="${curve.width}"`
      : ""}${dashed(curve)}/>`;
  }

  function stems(curve) {
    const axis = axisOf(curve.role), base = toY(Math.max(0, spec[axis].range[0]), axis);
    let d = "", heads = "";
    for (let k = 0; k < curve.x.length; k++) {
      const x = toX(curve.x[k]) + (curve.offset ?? 0), y = toY(curve.y[k], axis);
      if (y > base - 0.5) continue;
      d += `M${x.toFixed(1)},${base.toFixed(1)}V${y.toFixed(1)}`;
      heads += curve.role === "kernel"
        ? `<rect x="${(x - 2).toFixed(1)}" y="${(y - 2).toFixed(1)}" width="4" height="4"/>`
        : `<circle cx="${x.toFixed(1)}" cy="${y.toFixed(1)}" r="2.3"/>`;
    }
    return `<g class="stems is-${curve.role}"><path d="${d}"/>${heads}</g>`;
  }

  /** Names of curves above the plot, between the units of the axes. */
  function legend(x0, x1) {
    const named = spec.curves.filter((curve) => curve.name);
    const widths = named.map((curve) => 24 + 6.3 * curve.name.length);
    let x = Math.max(x0, (x0 + x1 - widths.reduce((a, b) => a + b, 0)) / 2);
    return named.map((curve, k) => {
      const at = x;
      x += widths[k];
      if (x > size[0]) return "";
      const sign = curve.stems ? `<g class="stems is-${curve.role}"><path d="M${at + 5},11V4"/><circle cx="${
        at + 5}" cy="4" r="2.2"/></g>` : `<path class="curve is-${curve.role}" d="M${at},7h11"${
        dashed(curve)}/>`;
      return `${sign}<text x="${at + 14}" y="11">${escaped(curve.name)}</text>`;
    }).join("");
  }

  /** Names above their lines. A name that would cross another line or name is left out. */
  function names(x0, x1) {
    const boxes = [], stems = spec.curves.filter((curve) => curve.stems).flatMap(
      ({ x: xs, y, role, offset = 0 }) => xs.map(
        (x, k) => ({ x, at: toX(x) + offset, top: toY(y[k], axisOf(role)) })));
    return (spec.names ?? []).map(({ x, y, text }) => {
      const width = 6.2 * text.replace(/_/g, "").length, [low, high] = spec.x.range;
      if (x < low || x > high) return "";
      const at = Math.min(Math.max(toX(x), x0 + width / 2), x1 - width / 2);
      const own = stems.filter((stem) => Math.abs(stem.x - x) < 1e-3);
      const others = stems.filter((stem) => !own.includes(stem));
      let up = Math.max(Math.min(toY(y, axisOf("")), ...own.map(({ top }) => top)) - 6, TOP + 2);
      const hits = () => boxes.some((box) => Math.abs(box.at - at) < (box.width + width) / 2
        && Math.abs(box.up - up) < NAME_HEIGHT)
        || others.some((stem) => Math.abs(stem.at - at) < width / 2 && stem.top < up + 4);
      if (hits()) up -= NAME_HEIGHT;
      if (hits() || up < TOP - 4) return "";
      boxes.push({ at, up, width });
      return `<text class="name" x="${at.toFixed(1)}" y="${up.toFixed(1)}" text-anchor="middle">${
        subscripted(text)}</text>`;
    }).join("");
  }

  /** Draw the cursor of the playback and the selected reading. */
  function drawMarks() {
    const [x0, y0, x1, y1] = area(), parts = [];
    if (cursor !== null && cursor >= spec.x.range[0] && cursor <= spec.x.range[1]) {
      parts.push(`<path class="cursor" d="M${toX(cursor).toFixed(1)},${y0}V${y1}"/>`);
    }
    const { x, text } = (selected >= 0 && readings()[selected]) || {};
    if (text) {
      const at = toX(x), isRight = at > (x0 + x1) / 2;
      parts.push(`<path class="reading" d="M${at.toFixed(1)},${y0}V${y1}"/>`, `<text class="read" x="${
        (at + (isRight ? -5 : 5)).toFixed(1)}" y="${y0 + 10}" text-anchor="${isRight ? "end" : "start"}">${
        escaped(text)}</text>`);
    }
    over.innerHTML = parts.join("");
  }

  /** Readings {x, text}: at the lines of a spectrum, or at the points of the first named curve. */
  function readings() {
    const curves = spec.curves.filter((curve) => curve.name && !curve.fill);
    const lead = curves.find((curve) => curve.stems) ?? curves[0];
    if (!lead) return [];
    const [low, high] = spec.x.range, all = [];
    for (let k = 0; k < lead.x.length; k++) {
      const x = lead.x[k];
      if (x < low || x > high) continue;
      const values = curves.map((curve) => {
        const j = curve.x === lead.x ? k : nearest(curve.x, x);
        if (j < 0 || Math.abs(curve.x[j] - x) > (high - low) / 50) return "";
        return `${curve.name} ${rounded(curve.y[j])}`;
      }).filter(Boolean);
      all.push({ x, text: `${rounded(x, 4)} ${spec.x.label.split(", ").pop()}: ${values.join(", ")}` });
    }
    return all;
  }

  const place = (event) => event.clientX - svg.getBoundingClientRect().left;
  svg.addEventListener("pointermove", (event) => {
    if (!spec) return;
    const all = readings(), index = nearest(all.map((each) => toX(each.x)), place(event));
    selected = index >= 0 && Math.abs(toX(all[index].x) - place(event)) < READING_DISTANCE ? index : -1;
    drawMarks();
  });
  const leave = () => { selected = -1; if (spec) drawMarks(); };
  for (const name of ["pointerleave", "blur"]) svg.addEventListener(name, leave);
  svg.addEventListener("keydown", (event) => {
    const way = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (!spec || !way || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    const all = readings(), next = selected + way * Math.max(1, Math.round(all.length / 100));
    selected = Math.min(Math.max(next, 0), all.length - 1);
    announce(all[selected]?.text ?? "There are no values to read.");
    drawMarks();
  });
  new ResizeObserver(() => {
    size = [host.clientWidth, host.clientHeight];
    render();
  }).observe(host);

  return {
    draw(given) {
      spec = given;
      render();
    },
    setCursor(x) { cursor = x; if (spec && size[0]) drawMarks(); },
  };
}

/** Index of the ascending value nearest to x; -1 if there are none. */
function nearest(values, x) {
  if (values.length < 2) return values.length - 1;
  const low = indexIn(values, x);
  return x - values[low] <= values[low + 1] - x ? low : low + 1;
}
