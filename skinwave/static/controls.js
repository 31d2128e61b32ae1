// The controls of the page: sliders with fields, choices, texts, and values of the body.

import { CHOICES, LABELS, NUMBERS, check } from "./values.js";
import { escaped } from "./text.js";

const WORDS = {
  there_and_back: "there and back", one_way: "one way, then jump", sinusoidal: "sinusoidal",
  linear: "linear, as published", pressure_squared: "pressure squared", force_corrected: "force corrected",
  gaussian: "Gaussian, as of the array", main_lobe: "main lobe, as published",
  simultaneous: "all at once", time_multiplexed: "in turn",
};
const PAUSE = 120; // ms without a move of a slider of the body, after which the body is requested

/** Function that calls another one after some ms in which it was not called again. */
export function afterPause(act, ms) {
  let due = 0;
  return (...given) => {
    clearTimeout(due);
    due = setTimeout(act, ms, ...given);
  };
}

const options = (values, words, chosen) => values.map((value) => `<option value="${escaped(value)}"${
  value === chosen ? " selected" : ""}>${escaped(words(value))}</option>`).join("");

/** HTML of the values of a body, which only a server can change. */
function bodyKeys(body, editable) {
  const rows = (body.keys ?? []).map(({ key, label, unit, value, low, high, step, choices }) => {
    const [name, per] = [label, unit].map(escaped);
    if (!editable) return `<div class="fact"><span>${name}</span><b>${escaped(value)} ${per}</b></div>`;
    const head = `<span class="head"><label for="key-${key}" title="${name}">${name}</label></span>`;
    if (choices) {
      return `<div class="row wide">${head}<select id="key-${key}" data-body="${key}">${
        options(choices, (text) => text, value)}</select></div>`;
    }
    return `<div class="row">${head}<input type="range" data-body="${key}" min="${low}" max="${high}"
      step="${step}" value="${value}" aria-label="${name}, ${per}"><input class="field" id="key-${key}"
      data-body="${key}" value="${Number(value.toPrecision(4))}" inputmode="decimal" autocomplete="off">
      <span class="unit">${per}</span></div>`;
  });
  return rows.join("") || '<p class="note">This body has no values that can be changed.</p>';
}

/**
 * Connect the controls inside an element.
 *
 * `change(key, value, settled)` receives each valid value, `refuse(key, sentence)` an error of typed text,
 * `hold(on)` whether a slider is held, `edit(key, text)` a value of the body. `current()` gives the values.
 * Returns functions that show values and bodies.
 */
export function buildControls(host, { editable, current, change, refuse, hold, edit }) {
  const $ = (id) => host.querySelector(`#${id}`), all = (selector) => [...host.querySelectorAll(selector)];
  const editSoon = afterPause(edit, PAUSE);

  for (const input of all("input[data-key][type=range]")) {
    const { low, high, step, unit } = NUMBERS[input.dataset.key], label = LABELS[input.dataset.key];
    Object.assign(input, { min: low, max: high, step, ariaLabel: unit ? `${label}, ${unit}` : label });
    input.parentNode.querySelector(".unit").textContent = unit;
  }
  for (const select of all("select[data-key]")) {
    select.innerHTML = options(CHOICES[select.dataset.key].options, (value) => WORDS[value] ?? value);
  }
  for (const part of all(editable ? "[data-file]" : "[data-served]")) part.remove();

  function take(key, text, settled) {
    let value;
    try {
      value = check(key, text);
    } catch (error) {
      refuse(key, error.message);
      return;
    }
    change(key, value, settled);
  }

  host.addEventListener("input", ({ target }) => {
    const { key, field, body } = target.dataset;
    if (key && target.type === "range") { hold(true); take(key, target.value, false); }
    else if (field && !("whole" in target.dataset)) take(field, target.value, false);
    else if (body && target.type === "range") {
      target.nextElementSibling.value = target.value;
      editSoon(body, target.value);
    }
  });
  host.addEventListener("change", ({ target }) => {
    const { key, field, body } = target.dataset;
    if (key) { hold(false); take(key, target.value, true); }
    else if (field) take(field, target.value, true);
    else if (body) edit(body, target.value);
  });
  host.addEventListener("pointerup", ({ target }) => target.type === "range" && hold(false));
  host.addEventListener("focusout", ({ target }) => {
    const key = target.dataset?.field;
    if (key && !target.hasAttribute("aria-invalid")) target.value = fieldText(key, current()[key]);
  });
  // Arrow keys in a field change it by one step, with shift by ten.
  host.addEventListener("keydown", (event) => {
    const key = event.target.dataset?.field, up = { ArrowUp: 1, ArrowDown: -1 }[event.key];
    if (!key || !up || !NUMBERS[key]) return;
    event.preventDefault();
    const { low, high, least = low, step } = NUMBERS[key], change = up * step * (event.shiftKey ? 10 : 1);
    const typed = Number(event.target.value), from = Number.isFinite(typed) ? typed : current()[key];
    const next = Math.min(Math.max(Number((from + change).toFixed(6)), least), high);
    event.target.value = fieldText(key, next);
    take(key, String(next), true);
  });
  const fieldText = (key, value) => (key in NUMBERS ? String(Number(Number(value).toPrecision(6))) : value);

  function disable(key, off) {
    for (const input of all(`[data-row="${key}"] :is(input, select)`)) input.disabled = off;
    host.querySelector(`[data-row="${key}"]`)?.classList.toggle("off", off);
  }

  return {
    /** Show values, a drawing frequency in Hz, NaN if it is unknown, and which fields have errors. */
    show(values, drawn, errors) {
      for (const input of all("[data-key]")) {
        const value = values[input.dataset.key];
        if (input.type === "radio") input.checked = input.value === value;
        else if (input.value !== String(value)) input.value = value;
      }
      for (const input of all("[data-field]")) {
        const key = input.dataset.field;
        if (errors[key]) input.setAttribute("aria-invalid", "true");
        else input.removeAttribute("aria-invalid");
        if (input !== document.activeElement && !errors[key]) input.value = fieldText(key, values[key]);
      }
      const { shape, foci, paths } = values, isPath = !paths && shape !== "point";
      const isUsed = {
        size: isPath && shape !== "polyline", speed: isPath, phases: foci > 1 && !paths, shape: !paths,
        sweep: ["line", "polyline"].includes(shape), polyline: shape === "polyline", ramp: values.pulses,
        ratio: values.am && values.am2, drawn: paths,
      };
      for (const [key, used] of Object.entries(isUsed)) disable(key, !used);
      $("drawing").textContent = drawn === 0 ? "focus at rest" : drawn ? `${drawn.toFixed(1)} Hz` : "–";
      const at = ["x", "y"].map((axis) => fieldText(axis, values[axis]));
      const digest = {
        rhythm: values.pulses || "always on", "foci-more": foci > 1 ? `${foci} foci` : "one focus",
        focus: `${values.height} mm, ${WORDS[values.drive]}`, "point-more": `${at.join(", ")} mm`,
      };
      for (const [id, text] of Object.entries(digest)) $(`${id}-digest`).textContent = text;
    },
    /** Show the bodies to choose from. */
    showBodies(bodies) {
      $("body").innerHTML = options(bodies.map(({ name }) => name),
        (name) => bodies.find((body) => body.name === name).title, current().body);
    },
    /** Show a body's values, except the one that is being edited. */
    showBody(body) {
      const names = JSON.stringify([body.name, body.keys?.map(({ key }) => key)]);
      if ($("keys").dataset.names !== names) $("keys").innerHTML = bodyKeys(body, editable);
      $("keys").dataset.names = names;
      for (const input of all("[data-body]")) {
        const { value } = body.keys.find(({ key }) => key === input.dataset.body);
        if (input !== document.activeElement) input.value = typeof value === "number"
          ? Number(value.toPrecision(4)) : value;
      }
      $("body-more-digest").textContent = body.title;
    },
  };
}
