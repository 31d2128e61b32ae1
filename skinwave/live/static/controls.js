// The controls of the page: rows of a slider and a field, choices, rhythm, foci, body and files.

import { CHOICES, LABELS, NUMBERS, check, pulsesOf } from "./values.js";
import { escaped } from "./plots.js";

const HELP = {
  body: "The body that the focus pushes. Its resonances and waves come from a finite-element or layered model.",
  amplitude: "Share of full drive. With radiation pressure, half the drive is a quarter of the pressure.",
  am: "Frequency of the amplitude modulation. 0 switches it off.",
  am2: "Frequency of a second sinusoid, mixed with the first by the superposition ratio. 0 switches it off.",
  ratio: "Weights of the first and the second sinusoid.",
  envelope: "A slow sinusoid that multiplies the signal. It splits each line into two. 0 switches it off.",
  duration: "Length of the Tacton. Lines closer than about 1/duration cannot be told apart.",
  shape: "Path that the focus follows, again and again. A point does not move.",
  size: "Diameter of a circle, side of a square or triangle, length of a line.",
  speed: "Speed of the focus along its path. Waves add up if it is close to the speed of surface waves.",
  hold: "Size, shape and speed then move together, so that the drawing frequency stays as it is.",
  pulses: "On and off times in ms, repeated to the end of the Tacton, such as 100/50, 40/110.",
  ramp: "Time that a pulse takes to rise and to fall.",
  foci: "Several foci share the pressure: each gets 1/n.",
  phases: "Where each focus starts, in per cent of the path. Empty means evenly spaced.",
  own: "All foci follow one path, or each has its own.",
  drawn: "How often each path is drawn per second.",
  sweep: "How a line or a polyline is repeated.",
  polyline: "Corners of the path in mm, such as 0/0, 10/0, 10/5.",
  sharing: "How the device makes several foci. It changes device scripts, not this model's load.",
  height: "Distance from the array to the focus. Far foci are wider and weaker.",
  drive: "How the pressure on the skin follows from the drive. Radiation pressure goes with its square.",
  profile: "Pressure across the focus.",
  peak: "Pressure at the focus at full drive, 200 mm above the array. It is known to a factor of 2.",
  modulation: "100 % modulates down to silence.",
  published: "Also draws the point kernel as published: linear drive and main lobe.",
  x: "Where waveform, spectrum and lines are read. Click a map or use its arrow keys.",
  y: "Where waveform, spectrum and lines are read. Click a map or use its arrow keys.",
  quantity: "What the plots show at the point.",
  scene: "A scene file (TOML) sets the body and all controls.",
  measurement: "A CSV file: time or frequency in the first column. It is drawn over the waves.",
};
const SHORT = {
  am: "AM", am2: "Second AM", envelope: "Envelope", ratio: "Mix", shape: "Shape", speed: "Speed",
  drawn: "Drawn", height: "Height", drive: "Drive law", profile: "Profile", foci: "Foci",
  modulation: "Modulation", peak: "Peak pressure", quantity: "Quantity", sharing: "Made",
  pulses: "On/off, ms", phases: "Phases, %", polyline: "Corners, mm", sweep: "Sweep",
};
const WORDS = {
  there_and_back: "there and back", one_way: "one way, then jump", sinusoidal: "sinusoidal",
  linear: "linear, as published", pressure_squared: "pressure squared", force_corrected: "force corrected",
  gaussian: "Gaussian, as the array's", main_lobe: "main lobe, as published",
  simultaneous: "all at once", time_multiplexed: "in turn",
};
const ICONS = {
  point: "M12 12h.01", line: "M4 12h16", circle: "M12 4a8 8 0 1 0 .01 0z", triangle: "M12 4L3.5 19h17z",
  square: "M5 5h14v14H5z", polyline: "M4 18L9 7l5 8 6-10",
};
const WIDE = new Set(["pulses", "phases", "polyline"]);

const labelOf = (key) => SHORT[key] ?? LABELS[key];
const fullLabel = (key) => (NUMBERS[key]?.unit ? `${LABELS[key]}, ${NUMBERS[key].unit}` : LABELS[key]);
const question = (key, label) => `<button type="button" class="help" data-help="${key}"
  aria-label="Help: ${escaped(label)}">?</button>`;
const head = (key, target) => `<span class="head"><label for="${target}" title="${escaped(HELP[key])}">${
  escaped(labelOf(key))}</label>${question(key, LABELS[key] ?? key)}</span>`;

function numberRow(key) {
  const { low, high, step, unit } = NUMBERS[key];
  return `<div class="row" data-row="${key}">${head(key, `${key}-field`)}
    <input type="range" id="${key}" data-key="${key}" min="${low}" max="${high}" step="${step}"
      aria-label="${escaped(fullLabel(key))}">
    <input class="field" id="${key}-field" data-field="${key}" inputmode="decimal" autocomplete="off"
      aria-describedby="problem"><span class="unit">${unit}</span></div>`;
}

function choiceRow(key, words = (value) => WORDS[value] ?? value) {
  const options = CHOICES[key].map((value) =>
    `<option value="${escaped(value)}">${escaped(words(value))}</option>`);
  return `<div class="row wide" data-row="${key}">${head(key, key)}
    <select id="${key}" data-key="${key}">${options.join("")}</select></div>`;
}

const textRow = (key) => `<div class="row wide" data-row="${key}">${head(key, `${key}-field`)}
  <input class="field" id="${key}-field" data-field="${key}" autocomplete="off" spellcheck="false"
    aria-describedby="problem"></div>`;

function shapeRow() {
  const each = Object.entries(ICONS).map(([name, path]) => `<label title="${name}"><input type="radio"
    name="shape" value="${name}" data-key="shape" aria-label="${name}"><svg viewBox="0 0 24 24"
    aria-hidden="true"><path d="${path}"/></svg></label>`);
  return `<div class="row wide" data-row="shape"><span class="head"><span id="shape-name"
    title="${HELP.shape}">Shape</span>${
    question("shape", LABELS.shape)}</span>
    <span class="shapes" role="radiogroup" aria-labelledby="shape-name">${each.join("")}</span></div>`;
}

const section = (id, title, body, note = "") => `<details name="more" id="${id}"><summary>${title}
  <span class="digest" id="${id}-digest"></span></summary><div class="inside">${body}${
  note ? `<p class="note">${note}</p>` : ""}</div></details>`;

/** HTML of a body's keys: editable with a server, otherwise as they are. */
function bodyKeys(body, editable) {
  const rows = (body.keys ?? []).map(({ key, label, unit, value, low, high, step, choices }) => {
    const name = `<span class="head"><label for="key-${key}"
      title="${escaped(label)}">${escaped(label)}</label></span>`;
    if (!editable) return `<div class="fact"><span>${escaped(label)}</span><b>${escaped(value)}
      ${escaped(unit)}</b></div>`;
    if (choices) {
      return `<div class="row wide">${name}<select id="key-${key}"
        data-body="${key}">${choices.map((each) => `<option${
        each === value ? " selected" : ""}>${escaped(each)}</option>`).join("")}</select></div>`;
    }
    return `<div class="row">${name}<input type="range" data-body="${key}" min="${low}" max="${high}"
      step="${step}"
      value="${value}" aria-label="${escaped(label)}, ${escaped(unit)}"><input class="field" id="key-${key}"
      data-body="${key}" value="${Number(value.toPrecision(4))}" inputmode="decimal"
        autocomplete="off"><span class="unit">${escaped(unit)}</span></div>`;
  });
  return rows.join("") || '<p class="note">This body has no values to change.</p>';
}

/**
 * Build the controls inside an element.
 *
 * `change(key, value, settled)` receives each valid value, `refuse(key, sentence)` what was typed wrong
 * (an empty sentence once it is right), `moving(on)` whether a slider is held. Returns
 * { show(values, facts), showBody(body), popover }.
 */
export function buildControls(host, { bodies, editable, change, refuse, moving, edit, hold, published }) {
  host.innerHTML = [
    choiceRow("body", (name) => bodies.find((body) => body.name === name)?.title ?? name),
    ...["amplitude", "am", "am2"].map(numberRow), choiceRow("ratio"), ...["envelope",
      "duration"].map(numberRow),
    shapeRow(), numberRow("size"), numberRow("speed"),
    `<div class="row wide"><span class="head"><span>Drawn</span>${question("hold",
      "Keep the drawing frequency")}</span>
      <span class="pair"><output id="drawing">–</output><label><input type="checkbox" id="hold">
        keep</label></span></div>`,
    '<div class="more">',
    section("rhythm", "Rhythm", `<svg id="strip" viewBox="0 0 248 40" role="img" aria-label="Pulses"></svg>${
      textRow("pulses")}${numberRow("ramp")}<div class="buttons"><button type="button" id="pulse-add">Add a
        pulse</button>
      <button type="button" id="pulse-remove">Remove the last</button></div>`),
    section("foci-more", "Path and foci", `${numberRow("foci")}
      <div class="row wide"><span class="head"><span id="own-name">Paths</span>${question("own",
        "Paths of the foci")}</span>
      <span class="pair" role="radiogroup" aria-labelledby="own-name"><label><input type="radio" name="own"
        value=""> one</label>
      <label><input type="radio" name="own" value="own"> one each</label></span></div>
      <div id="one-path">${textRow("phases")}${choiceRow("sweep")}${textRow("polyline")}</div>
      <div id="own-paths" hidden>${numberRow("drawn")}<table><thead><tr><th>#</th><th>shape</th><th>size</th><th>x</th>
      <th>y, mm</th></tr></thead><tbody></tbody></table></div>${choiceRow("sharing")}`),
    section("focus", "Focus and drive", `${["height", "peak", "modulation"].map(numberRow).join("")}
      ${choiceRow("drive")}${choiceRow("profile")}<div class="row wide"><span
        class="head"><span>Kernel</span>${
        question("published", "Kernel as published")}</span><label class="pair"><input type="checkbox"
          id="published">
        as published, too</label></div>`),
    section("body-more", "Layers", '<div id="keys"></div>', editable
      ? "Moving a value computes the body again. The old result is pale meanwhile."
      : "This file holds finished bodies. Run <code>skinwave web</code> to change their values."),
    section("point-more", "Point", `${numberRow("x")}${numberRow("y")}${choiceRow("quantity")}`),
    section("files", "Files", `${editable ? `<div class="row wide"><span class="head"><label
      for="scene">Scene</label>${
      question("scene", "Open a scene")}</span><input type="file" id="scene" accept=".toml"></div>` : ""}
      <div class="row wide"><span class="head"><label for="measurement">Measurement</label>${
      question("measurement", "Show a measurement")}</span><input type="file" id="measurement"></div>
      <p class="note" id="measured">${editable ? "CSV, .npz, .wav, .mat or Universal File." : "CSV file."}
      Or drop it onto the plots.</p><div class="buttons"><button type="button" id="measured-clear"
        hidden>Remove the
      measurement</button></div>`),
    "</div>",
    '<div id="popover" popover role="note"></div>',
  ].join("");
  const $ = (id) => host.querySelector(`#${id}`), all = (selector) => [...host.querySelectorAll(selector)];
  let values = {};

  function take(key, text, settled) {
    try {
      const value = check(key, text);
      refuse(key, "");
      change(key, value, settled);
    } catch (error) {
      refuse(key, error.message);
    }
  }

  host.addEventListener("input", ({ target }) => {
    const { key, field, body } = target.dataset;
    if (key && target.type === "range") { moving(true); take(key, target.value, false); }
    else if (field && !WIDE.has(field)) take(field, target.value, false);
    else if (body && target.type === "range") target.nextElementSibling.value = target.value;
  });
  host.addEventListener("change", ({ target }) => {
    const { key, field, body, own } = target.dataset;
    if (key) { moving(false); take(key, target.value, true); }
    else if (field) take(field, target.value, true);
    else if (body) edit(body, target.value);
    else if (own) takePaths();
    else if (target.name === "own") change("paths", target.value ? startPaths() : "", true);
    else if (target.id === "hold") hold(target.checked);
    else if (target.id === "published") published(target.checked);
  });
  host.addEventListener("pointerup", ({ target }) => target.type === "range" && moving(false));
  host.addEventListener("focusout", ({ target }) => {
    const key = target.dataset?.field;
    if (key && !target.hasAttribute("aria-invalid")) target.value = fieldText(key, values[key]);
  });
  // Up and down in a field move it by a step, with the shift key by ten.
  host.addEventListener("keydown", (event) => {
    const key = event.target.dataset?.field, up = { ArrowUp: 1, ArrowDown: -1 }[event.key];
    if (!key || !up || !NUMBERS[key]) return;
    event.preventDefault();
    const { low, high, least = low, step } = NUMBERS[key], by = up * step * (event.shiftKey ? 10 : 1);
    const now = Number(event.target.value), from = Number.isFinite(now) ? now : values[key];
    const next = Math.min(Math.max(Number((from + by).toFixed(6)), least), high);
    event.target.value = fieldText(key, next);
    take(key, String(next), true);
  });
  host.addEventListener("click", ({ target }) => {
    const key = target.dataset?.help;
    if (key) explain(target, HELP[key]);
    else if (target.id === "pulse-add") take("pulses", [values.pulses,
      "100/100"].filter(Boolean).join(", "), true);
    else if (target.id === "pulse-remove") take("pulses", values.pulses.split(",").slice(0, -1).join(","),
      true);
  });

  function explain(button, text) {
    const popover = $("popover"), { left, bottom } = button.getBoundingClientRect();
    popover.textContent = text;
    popover.style.left = `${Math.min(left, innerWidth - 250)}px`;
    popover.style.top = `${Math.min(bottom + 4, innerHeight - 90)}px`;
    popover.showPopover();
  }

  const startPaths = () => {
    const size = values.shape === "point" ? 0 : Math.min(values.size, 30);
    const shape = ["polyline"].includes(values.shape) ? "circle" : values.shape;
    return values.foci > 1 ? `${shape}/${size}/-20/0, ${shape}/${size}/20/0` : `${shape}/${size}/0/0`;
  };
  const takePaths = () => take("paths", all("#own-paths tbody tr").map((row) => [...row.querySelectorAll(
    "select, input")].map((input) => input.value.trim()).join("/")).join(", "), true);

  function showPaths(text) {
    const rows = text.split(",").map((part) => part.trim().split("/")).filter((row) => row.length === 4);
    const body = host.querySelector("#own-paths tbody");
    if (body.dataset.text === text) return;
    body.dataset.text = text;
    body.innerHTML = rows.map((row, k) => `<tr><th scope="row">${k + 1}</th><td><select data-own="1"
      aria-label="Shape of path ${k + 1}">${Object.keys(ICONS).slice(0, 5).map((name) => `<option${
      name === row[0] ? " selected" : ""}>${name}</option>`).join("")}</select></td>${row.slice(1).map((value, j) => `
      <td><input data-own="1" inputmode="decimal" value="${escaped(value)}" aria-label="${["Size", "x",
        "y"][j]} of path ${
      k + 1}, mm"></td>`).join("")}</tr>`).join("");
  }

  /** The pulses over two periods of the rhythm. */
  function showRhythm() {
    const strip = $("strip");
    let pulses = [];
    try { pulses = pulsesOf(values.pulses); } catch { /* what is typed is marked at the field */ }
    const period = pulses.reduce((sum, [on, gap]) => sum + on + gap, 0);
    strip.setAttribute("aria-label", period ? `Pulses, repeated every ${Math.round(1e3 * period)} ms`
      : "No pulses: always on");
    if (!period) {
      strip.innerHTML = '<rect class="block" x="0" y="4" width="248" height="22"/><text x="124" y="38" text-anchor="middle">always on</text>';
      return;
    }
    const scale = 124 / period, parts = [];
    for (let start = 0, turn = 0; turn < 2; turn++) {
      for (const [on, gap] of pulses) {
        const r = Math.min(values.ramp / 1e3, on / 2), [a, b] = [start * scale, (start + on) * scale];
        parts.push(`<polygon class="block${turn ? " again" : ""}" points="${a},26 ${a
          + r * scale},4 ${b - r * scale},4 ${b},26"/>`);
        start += on + gap;
      }
    }
    strip.innerHTML = `${parts.join("")}<path class="axis" d="M0,26H248M124,2V30"/><text x="124" y="38"
      text-anchor="middle">${Math.round(1e3 * period)} ms, repeated</text>`;
  }

  const fieldText = (key, value) => (key in NUMBERS ? String(Number(Number(value).toPrecision(6))) : value);

  return {
    /** Show values; `facts` are { drawing: Hz, held: bool }. */
    show(given, facts) {
      values = given;
      for (const input of all("[data-key]")) {
        const value = values[input.dataset.key];
        if (input.type === "radio") input.checked = input.value === value;
        else if (input.value !== String(value)) input.value = value;
      }
      for (const input of all("[data-field]")) {
        const key = input.dataset.field;
        if (input !== document.activeElement) input.value = fieldText(key, values[key]);
      }
      const still = values.shape === "point" || Boolean(values.paths);
      for (const key of ["size", "speed"]) toggle(key, still || (key === "size"
        && values.shape === "polyline"));
      toggle("phases", values.foci < 2);
      toggle("sweep", !["line", "polyline"].includes(values.shape));
      toggle("polyline", values.shape !== "polyline");
      toggle("ramp", !values.pulses);
      toggle("ratio", !values.am2 || !values.am);
      for (const input of all('[name="own"]')) input.checked = input.value === (values.paths ? "own" : "");
      $("one-path").hidden = Boolean(values.paths);
      $("own-paths").hidden = !values.paths;
      if (values.paths) showPaths(values.paths);
      showRhythm();
      $("drawing").textContent = facts.drawing ? `${facts.drawing.toFixed(1)} Hz` : "does not move";
      $("hold").checked = facts.held;
      const digest = {
        rhythm: values.pulses || "always on", "foci-more": values.foci > 1 ? `${values.foci} foci`
          : "one focus",
        focus: `${values.height} mm, ${WORDS[values.drive]}`, "point-more": `${fieldText("x", values.x)}, ${
          fieldText("y", values.y)} mm`,
      };
      for (const [id, text] of Object.entries(digest)) $(`${id}-digest`).textContent = text;
    },
    showBodies(own) {
      $("body").innerHTML = own.map(({ name, title }) =>
        `<option value="${escaped(name)}">${escaped(title)}</option>`).join("");
      $("body").value = values.body;
    },
    showBody(body) {
      const focused = document.activeElement?.dataset?.body, kind = document.activeElement?.type;
      $("keys").innerHTML = bodyKeys(body, editable);
      if (focused) host.querySelector(`[data-body="${focused}"][type="${kind}"]`)?.focus();
      $("body-more-digest").textContent = body.title;
    },
    mark(key, wrong) {
      const input = host.querySelector(`[data-field="${key}"]`);
      if (wrong) input?.setAttribute("aria-invalid", "true"); else input?.removeAttribute("aria-invalid");
    },
    explain,
  };

  function toggle(key, off) {
    for (const input of all(`[data-row="${key}"] :is(input, select)`)) input.disabled = off;
    host.querySelector(`[data-row="${key}"]`)?.classList.toggle("off", off);
  }
}
