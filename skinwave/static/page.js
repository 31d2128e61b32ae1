// The page: events change its state, and `show` draws the state.

import { addressOf, readAddress, withStep } from "./address.js";
import { mapsOf, respond as respondTo } from "./answer.js";
import { mapsBeside } from "./beside.js";
import { openBody, shapeOf, surfaceMotion } from "./bodies.js";
import { afterPause, buildControls } from "./controls.js";
import { levelOver } from "./evaluate.js";
import { filmOf } from "./film.js";
import { OVER, commandedPlot, dispersionPlot, fociAt, levelPlot, pathsOf, playedOf, spanOf, spectrumPlot,
  timeOf, waveformPlot } from "./figures.js";
import { WRITERS, readMeasurement, readScene, readSession, samplesOf } from "./files.js";
import { drawingFrequency } from "./load.js";
import { MAP_LEGEND, drawMap, mapControls, moveMap } from "./maps.js";
import { pictures } from "./pictures.js";
import { createPlot, keptScales, niceTop } from "./plots.js";
import { offerSaves } from "./saving.js";
import { runSelftest } from "./selftest.js";
import { request, sendFile } from "./server.js";
import { comparison, linesTable, tiles } from "./tables.js";
import { escaped, rounded } from "./text.js";
import { LABELS, STARTS, check, fitPaths, loadOf, nameBodies, withCorner } from "./values.js";
import { openView } from "./view3d.js";

const data = JSON.parse(document.getElementById("data").textContent);
const $ = (id) => document.getElementById(id);
const all = (selector) => [...document.querySelectorAll(selector)];

const LOOKS = ["maps", "motion", "difference", "3d"], TABS = ["lines", "dispersion", "level", "ab"];
const PLAYED = 5; // s in which a part of the motion is played
const SLICE = 30; // ms of slow work, after which the page draws
const PAUSE = 300; // ms without a move, after which slow results are computed
const MAPS = ["kernel-map", "wave-map"];
const STEPS = { undo: -1, redo: 1 };

const starts = { ...STARTS, ...data.start };

/** All that the page shows. Only `update` changes it. */
const state = {
  values: starts, past: { steps: [starts], at: 0 }, bodies: data.bodies,
  tried: null, answer: null, // the values that were computed last, and the last answer without an error
  pinned: null, measured: null, levels: null,
  errors: {}, notice: "", // sentences, errors by control or file
  editing: null, // changes of the body that the server computes, and their AbortController
  held: false, // whether a slider is held
  look: "maps", tab: "lines", span: "automatic", highest: "600", over: "speed", decibel: 0,
  clock: 0, playing: false, last: null, // s from the start of the span; ms of the last frame that was played
  frame: 0,
};

/** Change the state and show it, after new values have been computed in the next frame. */
function update(changes) {
  Object.assign(state, changes);
  if (state.values === state.tried) show(state);
  if (state.values !== state.tried || state.playing) state.frame ||= requestAnimationFrame(onFrame);
  $("tiles").setAttribute("aria-busy", isBusy(state));
}

const onFrame = (at) => update({ frame: 0, ...computed(state), ...advanced(state, at) });

/** Whether the tiles do not yet have the numbers of the present values. */
const isBusy = ({ values, tried, answer, errors }) => values !== tried
  || !("load" in errors) && answer.mapped !== values;

/** Answer to the values, with the numbers of the last maps of the same body until there are new ones. */
function computed({ values, tried, answer, errors }) {
  if (values === tried) return {};
  const { load, ...others } = errors;
  const completed = answer?.body === bodyOf(values.body) ? answer.completed : null;
  try {
    return { tried: values, answer: { completed, ...completed, ...respond(values) }, errors: others };
  } catch (error) {
    return { tried: values, errors: { ...others, load: error.message } };
  }
}

/** The clock of a motion that plays, at the time of a frame in ms. */
function advanced({ playing, clock, last, answer }, at) {
  if (!playing) return {};
  const whole = playedOf(answer.load), elapsed = Math.min(at - (last ?? at), 100) / 1e3;
  return { clock: (clock + elapsed * whole / PLAYED) % whole, last: at };
}

const recordOf = (name) => state.bodies.find((body) => body.name === name) ?? state.bodies[0];

const opened = new WeakMap(); // bodies by record

function bodyOf(name) {
  const record = recordOf(name);
  if (!opened.has(record)) opened.set(record, openBody(record));
  return opened.get(record);
}

const respond = (values) => respondTo(values, bodyOf(values.body));

// ---- drawing --------------------------------------------------------------------------------------

const shown = new Map(); // inputs of parts of the page
const scale = keptScales();
const fit = (name, largest) => scale(name, largest, state.held);
const plots = Object.fromEntries(["commanded", "waveform", "spectrum", "dispersion", "level"].map((id) => [id,
  createPlot($(id), { announce: (text) => { $("spoken").textContent = text; } })]));
const views = {}, flat = shapeOf({});
const askForMaps = mapsBeside($("worker").textContent, (maps, { body, values }) => {
  const { answer, clock } = state;
  if (body === answer.body) {
    const whole = { ...answer, completed: maps, ...maps, mapped: values };
    update({ answer: whole, clock: clock % playedOf(answer.load) });
  }
});

/** Draw a part of the page if its inputs have changed. Returns whether they have. */
function part(name, inputs, draw) {
  if (shown.get(name)?.every((value, k) => value === inputs[k])) return false;
  shown.set(name, inputs);
  draw();
  return true;
}

/** Draw the state. */
function show({ values, past, bodies, answer, pinned, measured, errors, notice, editing, ...view }) {
  const { look, tab, span, highest, clock, playing } = view, record = recordOf(values.body);
  const isRefused = "load" in errors;
  part("bodies", [bodies], () => controls.showBodies(bodies));
  part("body", [record, editing], () => showBody(record, editing));
  part("controls", [values, errors], () => controls.show(values, isRefused ? NaN : drawnAt(answer), errors));
  part("history", [past, look, tab], () => showHistory(past));
  part("buttons", [look, tab, playing, pinned, measured, isRefused || editing], () => showButtons(state));
  part("messages", [errors, notice, answer], () => showMessages(state));
  if (!answer) return;
  const { kernel, load, body } = answer;
  part("commanded", [kernel, span], () => {
    plots.commanded.draw(commandedPlot(answer, spanOf(span, load)));
    const drive = answer.values.drive.replaceAll("_", " ");
    $("commanded-note").textContent = `${drive}, ${rounded(load.duration)} s`;
  });
  const options = { pinned, measured, highest: parseFloat(highest), log: highest.endsWith("log"),
    scale: fit };
  const room = Object.values(answer.peaks ?? {}).map(niceTop).join();
  part("plots", [kernel, span, highest, pinned, measured, answer.invalid, room], () => {
    plots.waveform.draw(waveformPlot(answer, spanOf(span, load), options));
    plots.spectrum.draw(spectrumPlot(answer, options));
  });
  part("tiles", [answer, pinned], () => showTiles(answer, pinned));
  const key = keyOfLevels(state), levels = view.levels?.key === key ? view.levels : null;
  part("due levels", [key, tab], computeLevelsSoon);
  const result = tab === "ab" ? answer : kernel, { dispersion, hasFailed } = body;
  part("pane", [tab, result, pinned, highest, levels, dispersion, hasFailed],
    () => showPane(state, levels, options.highest));
  if (look === "3d") {
    if (answer.maps) part("solid", [answer.maps], () => showSolid(answer));
  } else {
    part("time", [clock, load, span], () => showTime(state));
    const isNew = part("maps", [answer.maps, pinned, look, view.decibel, playing, playing || clock,
      innerWidth, innerHeight], () => drawMaps(drawMap));
    if (playing && !isNew) drawMaps(moveMap);
  }
  part("spoken", [answer], speakSoon);
  part("due maps", [kernel], () => askForMaps(answer, recordOf(body.name)));
}

/** Drawing frequency of an answer in Hz. */
const drawnAt = ({ load: { path } }) => path.drawn ?? drawingFrequency(path);

function showBody(record, editing) {
  document.documentElement.dataset.kind = record.thickness_mm ? "sheet" : "solid";
  $("busy").hidden = !editing;
  if (!editing) controls.showBody(record);
}

function showHistory({ steps, at }) {
  try {
    window.history.replaceState(null, "", address());
  } catch { /* some hosts forbid it */ }
  for (const [id, way] of Object.entries(STEPS)) $(id).disabled = !(at + way in steps);
}

function showButtons({ look, tab, playing, pinned, measured, errors, editing }) {
  const press = (button, isOn) => button.setAttribute("aria-pressed", String(isOn));
  for (const button of all("[data-look]")) press(button, button.dataset.look === look);
  for (const button of all("[data-tab]")) press(button, button.dataset.tab === tab);
  for (const pane of all("[data-pane]")) pane.hidden = pane.dataset.pane !== tab;
  for (const each of all(".solid")) each.hidden = look !== "3d";
  for (const each of all(".map, .foot, #map-legend")) each.toggleAttribute("hidden", look === "3d");
  $("map-scale").hidden = look !== "maps";
  $("level-tools").hidden = tab !== "level";
  press($("play"), playing);
  $("play").textContent = playing ? "❚❚ Pause" : "▶ Play";
  press($("pin"), Boolean(pinned));
  $("pin").textContent = pinned ? "Unpin A" : "Pin A";
  $("swap").disabled = !pinned;
  $("measured-clear").hidden = !measured;
  $("page").classList.toggle("stale", Boolean(editing) || "load" in errors);
}

function showMessages({ errors, notice, answer }) {
  const problem = Object.values(errors).find(Boolean) ?? "";
  const { title, error } = answer?.body ?? {}, whole = Math.hypot(error, answer?.stretching ?? 0);
  const accuracy = error && !answer.invalid
    ? `${title}: error of the lines at most ${rounded(100 * whole, 2)} %` : "";
  const warnings = [...new Set([...(answer?.body.warnings ?? []), ...(answer?.warnings ?? [])])];
  $("problem").textContent = problem;
  $("notice").textContent = problem ? "" : notice || accuracy;
  $("warned").hidden = !warnings.length;
  $("warned").textContent = warnings.length === 1 ? "1 warning" : `${warnings.length} warnings`;
  $("warnings").textContent = warnings.join(" ");
}

function showTiles(answer, pinned) {
  $("tiles").innerHTML = tiles(answer, pinned);
  $("page").classList.toggle("invalid", Boolean(answer.invalid));
  for (const badge of all("[data-badge]")) {
    badge.hidden = !answer.invalid;
    badge.textContent = answer.invalid || "";
  }
}

function showPane({ tab, over, answer, pinned }, levels, highest) {
  if (tab === "lines") $("lines").innerHTML = linesTable(answer, pinned);
  else if (tab === "dispersion") {
    requestDispersion(answer.body);
    plots.dispersion.draw(dispersionPlot(answer, highest));
  } else if (tab === "level") {
    if (levels) plots.level.draw(levelPlot(answer, over, levels));
    $("best").disabled = !levels?.best || !answer.body.is_skin;
  } else {
    $("ab").innerHTML = pinned ? comparison(pinned, answer)
      : '<p class="note">Press Pin A to keep this result. Then change the body or a value to compare.</p>';
  }
}

const paceOf = ({ load }) => `1 s shows ${rounded(1e3 * playedOf(load) / PLAYED, 2)} ms`;

function showTime({ clock, answer, span }) {
  const whole = playedOf(answer.load), time = clock ? 1e3 * timeOf({ clock, answer, span }) : null;
  $("phase").value = clock / whole;
  $("phase-text").textContent = `${(1e3 * clock).toFixed(whole > 0.1 ? 0 : 1)} ms; ${paceOf(answer)}`;
  for (const plot of [plots.commanded, plots.waveform]) plot.setCursor(time);
}

function drawMaps(draw) {
  if (state.answer.maps) pictures(state, fit).forEach((options, k) => draw($(MAPS[k]), options));
}

function showSolid({ body, maps, load, x, y }) {
  const onTime = (clock) => { update({ clock }); views.kernel?.seek(clock); };
  views.waves ??= openView($("solid"), { onTime });
  views.kernel ??= openView($("solid-kernel"), { follows: true });
  const foci = drawingFrequency(load.path) ? (t) => fociAt(load, t) : [fociAt(load, 0)];
  const common = { path: pathsOf(load), points: [[x, y]], foci };
  views.waves.show({ ...common, shape: body.shape, motion: surfaceMotion(body.shape, maps.waves) });
  views.kernel.show({ ...common, shape: flat, motion: surfaceMotion(flat, maps.kernel), unit: "Pa",
    period: views.waves.loop });
}

/** Read the result to screen readers once nothing moves. */
const speakSoon = afterPause(() => {
  if (isBusy(state)) return;
  $("spoken").textContent = all(".tile").map((each) => ["name", "value", "detail"].map((name) => (
    each.querySelector(`.${name}`).textContent)).join(" ")).join("; ");
}, 2 * PAUSE);

// ---- slow results ---------------------------------------------------------------------------------

/** Request the dispersion curves of a changed body, once. */
async function requestDispersion(body) {
  if (!body.made || body.isRequested) return;
  body.isRequested = true;
  try {
    Object.assign(body, await request(data.api, "dispersion", body.toml));
    update({});
  } catch (error) {
    body.hasFailed = true;
    update({ notice: error.message });
  }
}

const keyOfLevels = ({ values, over, answer }) => JSON.stringify({ ...values, [over]: 0, over,
  made: answer.body.made });

const computeLevelsSoon = afterPause(computeLevels, PAUSE);

/** Compute levels over a control in short slices, so that the page stays responsive. */
async function computeLevels() {
  const { over, tab, values, answer } = state, key = keyOfLevels(state);
  if (tab !== "level" || state.levels?.key === key) return;
  const levelsAt = (value) => {
    const { kernelLevel, level } = respond({ ...values, [over]: value });
    return { kernel: kernelLevel?.dB ?? NaN, waves: level?.dB ?? NaN };
  };
  let levels = { key }, until = performance.now() + SLICE;
  for (const each of levelOver(levelsAt, OVER[over], { lead: answer.body.is_skin ? "waves" : "kernel" })) {
    levels = { ...each, key };
    if (performance.now() < until) continue;
    update({ levels });
    await new Promise((resolve) => setTimeout(resolve));
    if (keyOfLevels(state) !== key) return; // another control has moved
    until = performance.now() + SLICE;
  }
  update({ levels });
}

// ---- values ---------------------------------------------------------------------------------------

/** Take values; settled ones are a step of the history. The point is moved onto another body. */
function setValues(next, isSettled = true) {
  const [hx, hy] = recordOf(next.body).extent_mm ?? [Infinity, Infinity];
  const within = (value, half) => Math.min(Math.max(value, -half), half);
  const isOther = next.body !== state.values.body;
  const values = isOther ? { ...next, x: within(next.x, hx), y: within(next.y, hy) } : next;
  const past = isSettled ? withStep(state.past, values) : state.past;
  update({ values, past, notice: "", errors: withoutInputs(state.errors) });
}

const change = (key, value, isSettled) => setValues(
  fitPaths({ ...state.values, [key]: value }, key), isSettled);

/** Errors without those of what was typed; the fields show valid values again. */
const withoutInputs = (errors) => Object.fromEntries(
  Object.entries(errors).filter(([key]) => !(key in STARTS)));

/** Step back or forward in the history, if there is such a step. */
function step(way) {
  const { steps, at } = state.past, values = steps[at + way];
  if (values) update({ values, past: { steps, at: at + way }, errors: withoutInputs(state.errors) });
}

function applyPreset({ title, values: own }) {
  const known = Object.entries(own).filter(([key]) => key in STARTS);
  const checked = Object.fromEntries(known.map(([key, value]) => [key, check(key, value)]));
  setValues({ ...state.values, ...checked });
  update({ notice: title });
}

/** Address of this page with its values and view, as far as they differ from the starts. */
const address = ({ past: { steps, at }, look, tab } = state) => addressOf(steps[at], starts, {
  view: look === "maps" ? "" : look, tab: ["lines", "ab"].includes(tab) ? "" : tab });

async function copyLink() {
  const link = address().replace(location.search, ""); // without the token of a server
  try {
    await navigator.clipboard.writeText(link);
    update({ notice: "The link is copied." });
  } catch { prompt("Copy this address:", link); }
}

// ---- A, bodies and files --------------------------------------------------------------------------

const withMaps = (answer) => ({ ...answer, ...mapsOf(answer) });

function pin() {
  if (state.pinned) update({ pinned: null, tab: "lines" });
  else {
    update({ pinned: withMaps(state.answer), tab: "ab",
      notice: "A is pinned. Change the body or a value to compare." });
  }
}

function swap() {
  const { answer, pinned } = state;
  update({ pinned: withMaps(answer) });
  setValues(pinned.values);
}

const withError = (key, message) => ({ ...state.errors, [key]: message });

/** Do what may fail. Its error is shown until it succeeds. */
async function attempt(key, act, afterError = {}) {
  try {
    await act();
    update({ errors: withError(key, "") });
  } catch (error) { update({ errors: withError(key, error.message), ...afterError }); }
}

async function edit(key, text) {
  const record = recordOf(state.values.body), known = record.keys.find((own) => own.key === key);
  const value = known.choices ? text : Number(String(text).replace(",", "."));
  const isValid = known.choices || Number.isFinite(value);
  update({ errors: withError(key, isValid ? "" : `${known.label}: "${text}" is not a number.`) });
  if (!isValid) return;
  if (value === (state.editing?.changes[key] ?? known.value)) return;
  state.editing?.abort();
  const control = new AbortController(), changes = { ...state.editing?.changes, [key]: value };
  const { toml, name, title } = record;
  const own = { changes, signal: control.signal, abort: () => control.abort() };
  update({ editing: own });
  let made = null, message = "";
  try {
    const content = JSON.stringify({ toml, name, title, changes });
    made = (await request(data.api, "body", content, own)).body;
  } catch (error) {
    message = error.name === "AbortError" ? "" : error.message;
  }
  if (own !== state.editing) return;
  update({ editing: null, errors: withError("body", message) });
  if (made) takeBody(made);
}

/** Take a body's record in place of that of the same name, or as another. */
function takeBody(record) {
  const made = { ...record, made: Date.now() };
  const at = state.bodies.findIndex(({ name }) => name === record.name);
  const bodies = at < 0 ? [...state.bodies, made] : state.bodies.with(at, made);
  nameBodies(bodies.map((body) => body.name));
  update({ bodies, values: { ...state.values } });
}

const openScene = (file) => attempt("scene", async () => {
  const { values, body } = await sendFile(data.api, "scene", file);
  if (body) takeBody(body);
  setValues({ ...state.values, ...values, body: body?.name ?? state.values.body });
  update({ notice: `${file.name} is open.` });
});

const openSession = (file) => attempt("session", async () => {
  const text = await file.text(), isScene = file.name.endsWith(".toml");
  const { a, b } = isScene ? { b: readScene(text, file.name, state.bodies) } : readSession(text, file.name);
  if (a) update({ pinned: withMaps(respond(a)) });
  setValues(b);
  update({ notice: `${file.name} is open.` });
});

const openMeasurement = (file) => attempt("measurement", async () => {
  const measured = data.api ? await sendFile(data.api, "measurement", file)
    : readMeasurement(await file.text(), file.name);
  const remarks = measured.remarks.map((text) => `${text[0].toUpperCase()}${text.slice(1)}`);
  update({ measured, notice: [`${file.name} is drawn over the waves.`, ...remarks].join(" ") });
}, { measured: null });

/** Play the displacement at the point as sound. */
function listenToPoint() {
  const { samples, rate } = samplesOf(state.answer), context = new AudioContext();
  const buffer = context.createBuffer(1, samples.length, rate), source = context.createBufferSource();
  buffer.copyToChannel(Float32Array.from(samples), 0);
  source.buffer = buffer;
  source.connect(context.destination);
  source.onended = () => context.close();
  source.start();
}

/** Film of both maps, of what Play shows. */
function film() {
  const { answer } = state, whole = playedOf(answer.load);
  update({ notice: `Recording ${PLAYED} s.` });
  return filmOf((share) => pictures({ ...state, answer, look: "motion", clock: share * whole }, fit),
    (share) => `${answer.body.title}. ${(1e3 * share * whole).toFixed(1)} ms; ${paceOf(answer)}`, PLAYED);
}

// ---- events ---------------------------------------------------------------------------------------

function listenToMaps() {
  const settle = afterPause(() => update({ past: withStep(state.past, state.values) }), PAUSE);
  const move = (next) => { setValues(next, false); settle(); };
  const at = (v) => Math.min(Math.max(Math.round(1e4 * v) / 10, -50), 50);
  for (const id of MAPS) {
    mapControls($(id), (x, y) => move({ ...state.values, x: at(x), y: at(y) }), (k, x, y) => {
      try { move(withCorner(state.values, k, [x, y])); } catch { /* the path would leave its area */ }
    });
  }
}

function listen() {
  const on = (id, name, act) => $(id).addEventListener(name, act);
  const setLook = (look) => update({ look, playing: state.playing && look === "motion" });
  const play = (playing) => update(playing ? { playing, look: "motion", last: null } : { playing });
  const setToBest = () => {
    const { levels: { best }, over } = state;
    change(over, check(over, Number(best.at.toPrecision(4))), true);
  };
  const clicks = { pin, swap, link: copyLink, best: setToBest, "about-open": () => $("about").showModal(),
    cancel: () => state.editing?.abort(), listen: listenToPoint, play: () => play(!state.playing),
    "measured-clear": () => { $("measurement").value = ""; update({ measured: null }); } };
  for (const [id, act] of Object.entries(clicks)) on(id, "click", act);
  for (const [id, way] of Object.entries(STEPS)) on(id, "click", () => step(way));
  on("phase", "input", ({ target }) => update({ playing: false, look: "motion",
    clock: Number(target.value) * playedOf(state.answer.load) }));
  for (const key of ["span", "highest", "over"]) {
    on(key, "change", ({ target }) => update({ [key]: target.value }));
  }
  on("map-decibel", "change", ({ target }) => update({ decibel: Number(target.value) }));
  on("sheet-toggle", "click", ({ currentTarget }) => {
    currentTarget.setAttribute("aria-expanded", String($("sheet").classList.toggle("open")));
  });
  for (const button of all("[data-look]")) button.onclick = () => setLook(button.dataset.look);
  for (const button of all("[data-tab]")) button.onclick = () => update({ tab: button.dataset.tab });
  document.addEventListener("click", ({ target }) => {
    const button = target.closest("[data-preset], [data-save]");
    button?.closest("[popover]").hidePopover();
    if (button?.dataset.preset) applyPreset(data.presets[button.dataset.preset]);
  });
  on("page", "dragover", (event) => event.preventDefault());
  on("page", "drop", (event) => {
    event.preventDefault();
    if (event.dataTransfer.files[0]) openMeasurement(event.dataTransfer.files[0]);
  });
  on("controls", "submit", (event) => event.preventDefault());
  const openers = { scene: openScene, session: openSession, measurement: openMeasurement };
  on("controls", "change", ({ target }) => target.files?.[0] && openers[target.id](target.files[0]));
  listenToMaps();
  addEventListener("keydown", (event) => {
    const way = { z: event.shiftKey ? 1 : -1, y: 1 }[event.key.toLowerCase()];
    if (!way || !(event.ctrlKey || event.metaKey) || event.altKey
      || /^(text|)$/.test(event.target.type ?? "-")) return;
    step(way);
    event.preventDefault();
  });
  addEventListener("resize", () => update({}));
  addEventListener("hashchange", begin);
}

function begin() {
  const { values: own, refused, view } = readAddress(starts);
  const values = { ...own, body: recordOf(own.body).name };
  update({ values, past: { steps: [values], at: 0 }, notice: refused, playing: false,
    look: LOOKS.includes(view.view) ? view.view : "maps",
    tab: TABS.includes(view.tab) ? view.tab : "lines" });
  onFrame(performance.now());
  if (view.selftest !== undefined) runSelftest(data, bodyOf, loadOf);
}

nameBodies(data.bodies.map((body) => body.name));
const controls = buildControls($("controls"), {
  editable: Boolean(data.api), current: () => state.values, change, edit,
  refuse: (key, sentence) => update({ errors: withError(key, sentence) }),
  hold: (held) => update(state.held && !held ? { held, values: { ...state.values } } : { held }),
});
$("map-legend").innerHTML = MAP_LEGEND;
$("over").innerHTML = Object.keys(OVER).map((key) =>
  `<option value="${key}" title="${LABELS[key]}">${key === "am" ? "AM" : key}</option>`).join("");
$("highest").value = state.highest;
$("presets").innerHTML = data.presets.map(({ title }, k) => (
  `<button type="button" data-preset="${k}">${escaped(title)}</button>`)).join("");
offerSaves($("save"), {
  answer: () => { update({ playing: false }); return { ...state.answer, pinned: state.pinned }; },
  notify: (notice) => update({ notice }),
  writers: [["Film of both maps, WebM", "waves.webm", "video/webm", film], ...WRITERS],
});
listen();
begin();
