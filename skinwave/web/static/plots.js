// Curves on a canvas: draws what plots.py describes, in a few milliseconds, and lets one zoom in.
(() => {
  const EDGE = { left: 56, right: 56, top: 22, bottom: 34 };
  const FONT = "Roboto, sans-serif";
  const BAND = 0.28; // opacity of what is between the ends of a band
  const PALE = 0.25; // opacity of curves that are not of what the controls say
  const MODES = [1, 2, 3, 4, 5, 6].map((n) => `mode${n}`); // roles of dispersion curves
  const LEAST_DRAG = 6; // pixels that are no click any more
  const SNAP = 9; // pixels
  const SEEN = 3; // pixels that a peak is high at least, and away from the one before
  const shown = {}; // by id of the canvas: { canvas, figure, zoom, drag, value }

  // About `count` round numbers between two others.
  function ticks([low, high], count) {
    const rough = (high - low) / Math.max(1, count);
    const power = 10 ** Math.floor(Math.log10(rough));
    const step = power * [1, 2, 5, 10].find((s) => s * power >= rough);
    const found = [];
    for (let k = Math.ceil(low / step); k * step <= high * (1 + 1e-12); k++) found.push(k * step);
    const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
    return found.map((value) => [value, value.toFixed(Math.min(digits, 9))]);
  }

  // Text with its parts in <sub> lowered; returns its width without drawing if there is no place.
  function text(g, said, size, place) {
    let x = 0;
    for (const [k, part] of said.split(/<\/?sub>/).entries()) {
      g.font = `${k % 2 ? 0.75 * size : size}px ${FONT}`;
      if (place) g.fillText(part, place[0] + x, place[1] + (k % 2 ? 0.25 * size : 0));
      x += g.measureText(part).width;
    }
    return x;
  }

  // From values to pixels of an axis, "y" or "y2" upwards.
  function scales(plot) {
    const { figure, canvas } = plot;
    const w = canvas.clientWidth, h = canvas.clientHeight;
    const top = plot.top ?? EDGE.top;
    const box = { x: EDGE.left, y: top, w: w - EDGE.left - EDGE.right, h: h - top - EDGE.bottom };
    const range = plot.zoom || figure.x.range;
    const to = { x: (v) => box.x + ((v - range[0]) / (range[1] - range[0])) * box.w };
    for (const axis of ["y", "y2"]) {
      if (!figure[axis]) continue;
      const [low, high] = figure[axis].range;
      to[axis] = (v) => box.y + box.h - ((v - low) / (high - low)) * box.h;
    }
    return { box, range, to, w, h };
  }

  const xOf = (curve, k) => (curve.x ? curve.x[k] : curve.x0 + k * curve.dx);

  function stroke(g, curve, to) {
    const y = to[curve.axis];
    g.beginPath();
    for (let k = 0; k < curve.y.length; k++) g.lineTo(to.x(xOf(curve, k)), y(curve.y[k]));
    if (curve.low) { // a band
      for (let k = curve.y.length - 1; k >= 0; k--) g.lineTo(to.x(xOf(curve, k)), y(curve.low[k]));
      g.globalAlpha *= BAND;
      g.fill();
      g.globalAlpha = 1;
      return;
    }
    if (curve.mirrored) { // the area between a curve and its mirror image
      for (let k = curve.y.length - 1; k >= 0; k--) g.lineTo(to.x(xOf(curve, k)), y(-curve.y[k]));
      g.globalAlpha = 0.4;
      g.fill();
      g.globalAlpha = 1;
    }
    g.stroke();
  }

  function grid(g, { box, range, to }, figure, ink, faint) {
    g.lineWidth = 1;
    g.textBaseline = "top";
    g.textAlign = "center";
    for (const [value, said] of ticks(range, box.w / 80)) {
      g.fillStyle = faint;
      g.fillRect(Math.round(to.x(value)), box.y, 1, box.h);
      g.fillStyle = ink;
      g.fillText(said, to.x(value), box.y + box.h + 4);
    }
    g.fillText(figure.x.said, box.x + box.w / 2, box.y + box.h + 18);
    g.textBaseline = "middle";
    for (const [axis, x, align, turn] of [["y", box.x - 5, "right", 12],
                                          ["y2", box.x + box.w + 5, "left", -12]]) {
      if (!figure[axis]) continue;
      g.textAlign = align;
      for (const [value, said] of ticks(figure[axis].range, box.h / 32)) {
        g.fillStyle = faint;
        if (axis === "y") g.fillRect(box.x, Math.round(to.y(value)), box.w, 1);
        g.fillStyle = ink;
        g.fillText(said, x, to[axis](value));
      }
      g.save();
      g.translate(axis === "y" ? turn : box.x + box.w + EDGE.right + turn, box.y + box.h / 2);
      g.rotate(-Math.PI / 2);
      g.textAlign = "center";
      g.fillText(figure[axis].said, 0, 0);
      g.restore();
    }
  }

  // Where names of curves are: right of the title or, where there is no room, in rows below it; and
  // how much of the canvas is above the plot then, so that no curve is behind a name.
  function entries(g, figure, w) {
    g.font = `500 12px ${FONT}`;
    let x = 4 + g.measureText(figure.title).width + 16, y = 11;
    const named = figure.data.filter((curve) => curve.name);
    if (figure.data.length < 2 && !figure.legend) return { placed: [], top: EDGE.top };
    g.font = `11px ${FONT}`;
    const widths = named.map((curve) => g.measureText(curve.name).width + 34);
    const all = widths.reduce((a, b) => a + b, 0), below = w - 6 - all < x;
    x = below ? EDGE.left + 4 : w - 6 - all;
    if (below) y += 16;
    const placed = named.map((curve, k) => {
      if (below && x > EDGE.left + 4 && x + widths[k] > w) {
        x = EDGE.left + 4;
        y += 16;
      }
      x += widths[k];
      return { curve, x: x - widths[k], y, wide: widths[k] };
    });
    return { placed, top: below ? y + 12 : EDGE.top };
  }

  // A title without the last of its clauses that there is no room for.
  function fitted(g, title, wide) {
    while (g.measureText(title).width > wide && /[,;]/.test(title))
      title = title.slice(0, Math.max(title.lastIndexOf(","), title.lastIndexOf(";")));
    return title;
  }

  function legend(g, { placed }, figure, colours, ink) {
    g.textAlign = "left";
    g.textBaseline = "middle";
    g.fillStyle = ink;
    g.font = `500 12px ${FONT}`;
    g.fillText(fitted(g, figure.title, g.canvas.clientWidth - 8), 4, 11);
    g.font = `11px ${FONT}`;
    for (const { curve, x, y } of placed) {
      line(g, curve, colours);
      g.beginPath();
      g.moveTo(x, y);
      g.lineTo(x + 20, y);
      if (curve.low) [g.lineWidth, g.globalAlpha] = [9, BAND];
      g.stroke();
      g.globalAlpha = 1;
      g.fillStyle = ink;
      g.fillText(curve.name, x + 24, y);
      g.setLineDash([]);
    }
  }

  const stale = () => window.trame.state.get("stale");

  function line(g, curve, colours) {
    g.strokeStyle = g.fillStyle = colours[curve.role];
    g.lineWidth = curve.width ?? 1.4;
    g.setLineDash({ dash: [6, 4], dot: [1.5, 3] }[curve.dash] || []);
    g.globalAlpha = (curve.opacity ?? 1) * (stale() ? PALE : 1);
  }

  // The corners of all curves in pixels, with those between which one rises by more than a step.
  function corners({ box, range, to }, figure) {
    const found = [];
    for (const curve of figure.data.filter((one) => !one.low)) {
      let before = null;
      for (let k = 0; k < curve.y.length; k++) {
        const value = xOf(curve, k);
        if (value < range[0] || value > range[1]) continue;
        const here = [to.x(value), Math.max(box.y, to[curve.axis](curve.y[k]))];
        const steps = before ? Math.ceil(Math.hypot(here[0] - before[0], here[1] - before[1]) / 4) : 1;
        for (let n = 1; n <= steps; n++) {
          const part = before ? n / steps : 1, from = before || here;
          found.push([from[0] + part * (here[0] - from[0]), from[1] + part * (here[1] - from[1])]);
        }
        before = here;
      }
    }
    return found;
  }

  const over = (a, b) => a.x < b.x + b.w && b.x < a.x + a.w && a.y < b.y + b.h && b.y < a.y + a.h;

  // The place for a name of this size that is nearest to its line and on no curve and no other name;
  // null if there is none.
  function place(at, [x, y], [w, h], points, placed) {
    const { box } = at, found = [];
    for (let up = 4; y - up - h >= box.y + 1; up += 4)
      for (let aside = 0; aside <= 72; aside += 6)
        for (const way of aside ? [-1, 1] : [1]) found.push([up, way * aside]);
    // The lowest line may have room only beside it.
    for (let aside = w / 2 + 4; aside <= w / 2 + 76; aside += 6)
      for (const way of [1, -1])
        for (let up = -h; up <= 0; up += 6) found.push([up, way * aside]);
    found.sort((a, b) => Math.hypot(...a) - Math.hypot(...b));
    for (const [up, aside] of found) {
      const one = { x: x + aside - w / 2, y: y - up - h, w, h };
      const within = one.x >= box.x && one.x + w <= box.x + box.w && one.y >= box.y
        && one.y + h <= box.y + box.h - 2;
      if (!within || placed.some((other) => over(one, other))) continue;
      const on = ([px, py]) => px > one.x - 1 && px < one.x + w + 1 && py > one.y - 1 && py < one.y + h + 1;
      if (!points.some(on)) return one;
    }
    return null;
  }

  // Names beside lines of a spectrum, the strongest first, joined to their line where they are away.
  function names(g, at, figure, ink) {
    const { range, to } = at, placed = [], wanted = figure.names || [];
    const points = wanted.length ? corners(at, figure) : [];
    for (const { x, y, axis, said } of wanted) {
      if (x < range[0] || x > range[1]) continue;
      const widths = said.map((part) => text(g, part, 11)), wide = Math.max(...widths);
      const peak = [to.x(x), to[axis](y)];
      const one = place(at, peak, [wide + 2, 13 * said.length], points, placed);
      if (!one) continue;
      placed.push({ ...one, said });
      g.fillStyle = g.strokeStyle = ink;
      g.textAlign = "left";
      g.textBaseline = "middle";
      said.forEach((part, k) =>
        text(g, part, 11, [one.x + 1 + (wide - widths[k]) / 2, one.y + 7 + 13 * k]));
      const end = [Math.min(Math.max(peak[0], one.x), one.x + one.w),
                   Math.min(Math.max(peak[1], one.y), one.y + one.h)];
      if (Math.hypot(end[0] - peak[0], end[1] - peak[1]) < 9) continue;
      g.lineWidth = 0.6;
      g.beginPath();
      g.moveTo(...peak);
      g.lineTo(...end);
      g.stroke();
    }
    return placed;
  }

  // The peaks of all curves but of bands and marks: each with its value and its height in pixels,
  // of which less is higher.
  function* peaks({ figure }, to) {
    for (const curve of figure.data) {
      if (curve.low || ["threshold", "pinned"].includes(curve.role)) continue;
      for (let k = 1; k + 1 < curve.y.length; k++)
        if (curve.y[k] > curve.y[k - 1] && curve.y[k] >= curve.y[k + 1])
          yield { value: xOf(curve, k), high: to[curve.axis](curve.y[k]) };
    }
  }

  // The value on the axis where the pointer is or, on a spectrum, of the peak that it is next to.
  function snapped(plot, pixel) {
    const { box, range, to } = scales(plot);
    const back = (x) => range[0] + ((x - box.x) / box.w) * (range[1] - range[0]);
    let best = null;
    for (const peak of plot.figure.names ? peaks(plot, to) : [])
      if (Math.abs(to.x(peak.value) - pixel) <= SNAP && (!best || peak.high < best.high)) best = peak;
    return best ? best.value : back(pixel);
  }

  // The next peak that is seen after or before the cursor; the end of the axis where there is none.
  function next(plot, way) {
    const { box, range, to } = scales(plot), [low, high] = range;
    const from = plot.value ?? (way > 0 ? low : high), step = (SEEN * (high - low)) / box.w;
    let found = way > 0 ? high : low;
    for (const { value, high: top } of peaks(plot, to)) {
      const seen = top < to.y(0) - SEEN && value >= low && value <= high;
      if (seen && way * (value - from) > step && way * (found - value) > 0) found = value;
    }
    return found;
  }

  // A cursor at a value of a plot, and at the same time of the other plots over time; of one that
  // moves by itself, values are not read out.
  function point(plot, value, moving = false) {
    for (const other of Object.values(shown)) {
      const same = other === plot || other.figure?.x.said === plot.figure.x.said;
      if (!other.figure || !same) continue;
      [other.value, other.moving] = [value, moving];
      draw(other);
    }
  }

  // The place of the cursor and the value of each curve there, in words.
  function read(plot) {
    const { value } = plot;
    const at = (c) => value >= xOf(c, 0) && value <= xOf(c, c.y.length - 1);
    const said = plot.figure.data.filter((c) => c.name && at(c)).map((curve) => {
      let low = 0, high = curve.y.length - 1;
      while (high - low > 1) {
        const middle = (low + high) >> 1;
        if (xOf(curve, middle) > value) high = middle; else low = middle;
      }
      const k = value - xOf(curve, low) < xOf(curve, high) - value ? low : high;
      const least = curve.low ? `${curve.low[k].toPrecision(4)} .. ` : "";
      return `${curve.name} ${least}${curve.y[k].toPrecision(4)}`;
    });
    return [`${value.toPrecision(5)}:`, ...said.map((one, k) => one + (k + 1 < said.length ? ";" : ""))];
  }

  function readout(g, { box, range, to, w }, plot, ink, paper) {
    const value = plot.value, x = to.x(value);
    if (value < range[0] || value > range[1]) return;
    g.fillStyle = ink;
    g.fillRect(x, box.y, 1, box.h);
    if (plot.moving) return;
    g.font = `11px ${FONT}`;
    const parts = read(plot), all = parts.join(" ");
    const rows = g.measureText(all).width < w - 12 ? [all] : parts;
    const top = box.y + box.h - 16 * rows.length;
    const wide = Math.max(...rows.map((row) => g.measureText(row).width));
    const left = Math.max(2, Math.min(x + 6, w - wide - 6));
    g.fillStyle = paper;
    g.fillRect(left - 3, top - 2, wide + 6, 16 * rows.length);
    g.fillStyle = ink;
    g.textAlign = "left";
    g.textBaseline = "middle";
    rows.forEach((row, k) => g.fillText(row, left, top + 6 + 16 * k));
  }

  function draw(plot) {
    const { canvas, figure } = plot, ratio = window.devicePixelRatio || 1;
    if (!figure || !canvas.clientWidth) return;
    const style = getComputedStyle(canvas), own = (name) => style.getPropertyValue(name).trim();
    const ink = own("--sw-ink"), faint = own("--sw-grid"), paper = own("--sw-paper");
    const colours = Object.fromEntries(
      ["kernel", "published", "waves", "pinned", "threshold", "measured", ...MODES].map((role) => [role, own(`--sw-${role}`)]));
    const g = canvas.getContext("2d"), said = entries(g, figure, canvas.clientWidth);
    plot.top = said.top;
    const at = scales(plot), { box } = at;
    if (canvas.width !== Math.round(at.w * ratio)) canvas.width = Math.round(at.w * ratio);
    if (canvas.height !== Math.round(at.h * ratio)) canvas.height = Math.round(at.h * ratio);
    g.setTransform(ratio, 0, 0, ratio, 0, 0);
    g.clearRect(0, 0, at.w, at.h);
    g.font = `11px ${FONT}`;
    grid(g, at, figure, ink, faint);
    g.save();
    g.beginPath();
    g.rect(box.x, box.y, box.w, box.h);
    g.clip();
    for (const curve of figure.data) {
      line(g, curve, colours);
      stroke(g, curve, at.to);
    }
    g.restore();
    plot.named = names(g, at, figure, ink);
    [plot.box, plot.entries] = [box, said.placed];
    legend(g, said, figure, colours, ink);
    if (plot.value !== null && !plot.drag) readout(g, at, plot, ink, paper);
    if (plot.drag) {
      g.fillStyle = faint;
      g.globalAlpha = 0.6;
      g.fillRect(plot.drag[0], box.y, plot.drag[1] - plot.drag[0], box.h);
      g.globalAlpha = 1;
    }
    canvas.dispatchEvent(new CustomEvent("drawn"));
  }

  // A figure of which `asks` is true is computed anew where it is zoomed to.
  function zoomed(plot, range) {
    if (plot.figure.asks) {
      window.trame.trigger("zoom", range || []);
      return;
    }
    plot.zoom = range;
    draw(plot);
  }

  // Zoom and move, within what there is; of a figure that `asks` its session keeps within.
  function nearer(plot, factor, shift) {
    const [low, high] = plot.zoom || plot.figure.x.range;
    let [first, last] = plot.figure.x.range;
    if (plot.figure.asks) [first, last] = [-Infinity, Infinity];
    const wide = Math.min((high - low) * factor, last - first);
    const start = (low + high) / 2 + shift * (high - low) - wide / 2;
    const begin = Math.min(Math.max(start, first), last - wide);
    zoomed(plot, [begin, begin + wide]);
  }

  // The cursor goes to the next peak, whose values are told.
  function tell(plot, way) {
    point(plot, next(plot, way));
    document.getElementById("plot-said").textContent = `${plot.figure.x.said} ${read(plot).join(" ")}`;
  }

  function listen(plot) {
    const { canvas } = plot;
    const within = (event) => {
      const { box } = scales(plot);
      return Math.min(Math.max(event.offsetX, box.x), box.x + box.w);
    };
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      plot.drag = [within(event), within(event)];
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!plot.figure) return;
      if (plot.drag) plot.drag[1] = within(event);
      point(plot, snapped(plot, within(event)));
    });
    canvas.addEventListener("pointerup", () => {
      const { box, range } = scales(plot), drag = plot.drag && [...plot.drag].sort((a, b) => a - b);
      plot.drag = null;
      if (drag && drag[1] - drag[0] >= LEAST_DRAG) {
        const back = (x) => range[0] + ((x - box.x) / box.w) * (range[1] - range[0]);
        zoomed(plot, drag.map(back));
      } else draw(plot);
    });
    canvas.addEventListener("pointerleave", () => plot.figure && point(plot, null));
    canvas.addEventListener("dblclick", () => zoomed(plot, null));
    const keys = { "+": [0.5, 0], "-": [2, 0], ArrowLeft: [1, -0.25], ArrowRight: [1, 0.25] };
    canvas.addEventListener("keydown", (event) => {
      if (event.ctrlKey || event.metaKey || !plot.figure) return;
      const way = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
      if (event.shiftKey && way) tell(plot, way);
      else if (keys[event.key]) nearer(plot, ...keys[event.key]);
      else if (event.key === "Home" || event.key === "0") zoomed(plot, null);
      else return;
      event.preventDefault();
    });
    new ResizeObserver(() => draw(plot)).observe(canvas);
  }

  // Begin to draw the figures of these keys of the state, on the canvas of the same name.
  function begin(state, keys) {
    for (const key of keys) {
      const canvas = document.getElementById(key);
      const plot = (shown[key] = { canvas, figure: null, zoom: null, drag: null, value: null });
      listen(plot);
      state.watch([key], (figure) => {
        if (!figure) return;
        if (plot.figure?.kept !== figure.kept) plot.zoom = null;
        plot.figure = figure;
        draw(plot);
      });
    }
    document.fonts?.ready.then(() => Object.values(shown).forEach(draw));
    state.watch(["stale"], () => Object.values(shown).forEach(draw));
    state.watch(["dark"], () => setTimeout(() => Object.values(shown).forEach(draw), 50));
  }

  // What part of a figure is zoomed to, by its key.
  const zooms = () => Object.entries(shown).filter(([, plot]) => plot.zoom)
    .map(([key, plot]) => `${key}:${plot.zoom.join(":")}`);

  window.trame.utils.plots = { begin, zooms, shown, point };
})();
