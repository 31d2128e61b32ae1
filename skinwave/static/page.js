// The page: reads its data, answers at every move of a control, and shows the answer.

import { OF_MAPS, mapsOf, respond as respondTo } from "./answer.js";
import { openBody } from "./bodies.js";
import { buildControls } from "./controls.js";
import { WRITERS, readMeasurement } from "./files.js";
import { addressOf, createHistory, readAddress } from "./history.js";
import { drawingFrequency, rhythmPeriod } from "./load.js";
import { MAP_LEGEND, drawMap, mapControls } from "./maps.js";
import { levelOver } from "./numbers.js";
import { largestOf } from "./numeric.js";
import { createPlot, keptScales } from "./plots.js";
import { OVER, commandedPlot, difference, dispersionPlot, factorOf, fociAt, levelPlot, pathsOf, spanOf,
  spectrumPlot, waveformPlot } from "./results.js";
import { offerSaves } from "./saving.js";
import { runSelftest } from "./selftest.js";
import { request, sendFile } from "./server.js";
import { comparison, linesTable, tiles } from "./tables.js";
import { escaped, rounded } from "./text.js";
import { LABELS, STARTS, check, fitPaths, loadOf, nameBodies } from "./values.js";
import { openView } from "./view3d.js";

const data = JSON.parse(document.getElementById("data").textContent);
const $ = (id) => document.getElementById(id);
const all = (selector) => [...document.querySelectorAll(selector)];

const SPANS = ["automatic", "last 60 ms", "all"];
const PLAYED = 3.5; // s that a period takes when played
const TURN = 30; // ms of slow work, between which the page draws
const STEPS = { undo: -1, redo: 1 };
const QUIET = 300; // ms without a move, after which slow results are computed

const opened = new Map(); // bodies by name
const starts = { ...STARTS, ...data.start };
const view = { look: "maps", tab: "lines", span: "automatic", highest: 600, over: "speed",
  mapDecibel: 0 };
const errors = new Map(); // what is typed wrong, by control
const scale = keptScales();
let values = starts, answer = null, pinned = null, measured = null, history = null, controls = null;
let frameDue = 0, mapsDue = 0, slowDue = 0, told = 0, moving = false;
let levels = null, solid = null, solidOf = null;
let playing = 0, clock = 0, editing = null, notice = "";

const recordOf = (name) => data.bodies.find((body) => body.name === name) ?? data.bodies[0];

function bodyOf(name) {
  const record = recordOf(name);
  if (!opened.has(record.name)) opened.set(record.name, openBody(record));
  return opened.get(record.name);
}

const respond = (own) => respondTo(own, bodyOf(own.body));

function change(key, value, settled) {
  let next = { ...values, [key]: value };
  if (key === "foci" || key === "paths") next = fitPaths(next, key);
  set(next, settled);
}

/** Take values; `settled` ones are a step that can be undone. */
function set(next, settled = true) {
  const other = next.body !== values.body;
  values = other ? { ...next, ...onBody(next) } : next;
  notice = "";
  forgetTyped();
  if (settled) {
    history.add(values);
    writeAddress();
  }
  if (other) showBody();
  ask();
}

/** The point, moved inside the body if it is outside. */
function onBody({ body, x, y }) {
  const [hx, hy] = recordOf(body).extent_mm ?? [Infinity, Infinity];
  const within = (value, half) => Math.min(Math.max(value, -half), half);
  return { x: within(x, hx), y: within(y, hy) };
}

/** Mark what a body shows as old while another is computed, or while the values have no answer. */
function markOld() {
  $("page").classList.toggle("stale", Boolean(editing) || errors.has("load"));
}

const ask = () => { frameDue ||= requestAnimationFrame(showCurves); };

/** Address of this page with what is shown, apart from what is usual. */
function address() {
  return addressOf(values, starts, { view: view.look === "maps" ? "" : view.look,
    tab: ["lines", "ab"].includes(view.tab) ? "" : view.tab });
}

function writeAddress() {
  try {
    window.history.replaceState(null, "", address());
  } catch { /* some hosts forbid it */ }
  for (const [id, way] of Object.entries(STEPS)) $(id).disabled = !history.has(way);
}

const say = (text) => { notice = text; showSlot(); };

function showSlot() {
  const wrong = [...errors.values()].find(Boolean) ?? "";
  $("problem").textContent = wrong;
  const { title, error } = answer?.body ?? {};
  const expected = error && !answer.invalid
    ? `${title}: lines are within ${rounded(100 * error, 2)} % of the full model` : "";
  $("notice").textContent = wrong ? "" : notice || expected;
  const warned = [...new Set([...(answer?.body.warnings ?? []), ...(answer?.warnings ?? [])])];
  $("warned").hidden = !warned.length;
  $("warned").textContent = warned.length === 1 ? "1 warning" : `${warned.length} warnings`;
  $("warnings").textContent = warned.join(" ");
}

/** What mapsOf found before, of the same body: it stays until there is a new one, a frame later. */
function mapsBefore() {
  if (answer?.body !== bodyOf(values.body)) return {};
  return Object.fromEntries(OF_MAPS.map((key) => [key, answer[key]]));
}

function showCurves() {
  frameDue = 0;
  try {
    answer = { ...mapsBefore(), ...respond(values) };
    errors.delete("load");
    markOld();
  } catch (error) {
    errors.set("load", error.message);
    markOld();
    showSlot();
    controls.show(values, drawn());
    return;
  }
  const { load } = answer, span = spanOf(view.span, load);
  const fit = (name, largest) => scale(name, largest, moving);
  const given = { pinned, measured, scale: fit, highest: view.highest };
  plots.commanded.draw(commandedPlot(answer, span));
  plots.waveform.draw(waveformPlot(answer, span, given));
  plots.spectrum.draw(spectrumPlot(answer, given));
  controls.show(values, drawn());
  $("commanded-said").textContent = `${values.drive.replaceAll("_", " ")}, ${rounded(load.duration)} s`;
  showTiles();
  showPane();
  showSlot();
  mapsDue ||= requestAnimationFrame(showMaps);
  clearTimeout(slowDue);
  levels = levels?.of === keyOfLevels() ? levels : null;
  if (view.tab === "level" && !levels) slowDue = setTimeout(computeLevels, QUIET);
}

/** The drawing frequency in Hz, 0 while values contradict each other, which is said elsewhere. */
function drawn() {
  try {
    const { path } = answer?.values === values ? answer.load : loadOf(values);
    return path.drawn ?? drawingFrequency(path);
  } catch { return 0; }
}

function showMaps() {
  mapsDue = 0;
  const own = answer, before = own.invalid;
  Object.assign(own, mapsOf(own));
  if (own.invalid !== (before ?? "")) ask(); // plots are hatched, too
  drawMaps();
  showTiles();
  announce();
  if (view.tab === "ab") showPane();
  if (view.look === "3d") showSolid();
}

const short = (title) => (title.length > 22 ? `${title.slice(0, 21)}…` : title);

function drawMaps() {
  if (!answer?.maps || view.look === "3d") return;
  const { maps, load, x, y, body } = answer, at = pinned?.maps ? pinned : null;
  const marks = { path: pathsOf(load), point: [x, y], foci: fociAt(load, clock), influenced: maps.kernel.rms,
    decibel: view.mapDecibel };
  const top = (name, rms) => scale(`map ${name}`, largestOf(rms), moving);
  let wavesTop = top(`waves ${body.name}`, maps.waves.rms);
  let topOfA = at ? top(`waves ${at.body.name}`, at.maps.waves.rms) : 0;
  if (factorOf(topOfA, wavesTop) === 1) wavesTop = topOfA = Math.max(wavesTop, topOfA);
  if (at) {
    drawMap($("kernel-map"), { ...marks, path: pathsOf(at.load), foci: [], point: [at.x, at.y],
      influenced: at.maps.kernel.rms, rms: at.maps.waves.rms, unit: "m", largest: topOfA,
      level: at.body.is_skin ? at.maps.waves.level : null,
      title: `A: ${short(at.body.title)}`, hatched: at.invalid });
  } else {
    const level = body.is_skin ? maps.kernel.level : null;
    drawMap($("kernel-map"), { ...marks, rms: maps.kernel.rms, level, unit: "Pa",
      largest: top("kernel", maps.kernel.rms), title: "Kernel, RMS" });
  }
  const waves = view.look === "difference"
    ? { rms: difference(maps.waves.rms, at ? at.maps.waves.rms : maps.kernel.rms), unit: "dB", largest: 40,
      signed: true, title: at ? "B − A" : "Waves − kernel" }
    : { rms: maps.waves.rms, level: body.is_skin ? maps.waves.level : null, unit: "m", largest: wavesTop,
      title: at ? `B: ${short(body.title)}` : "Waves, RMS" };
  drawMap($("wave-map"), { ...marks, ...waves, hatched: answer.invalid });
}

function showSolid() {
  if (!answer) return;
  solid ??= openView($("solid"), { onTime: (t) => { clock = t; showClock(); } });
  if (solidOf === answer) return;
  solidOf = answer;
  const { body, waves, load, x, y } = answer, fd = drawingFrequency(load.path);
  solid.show({ shape: body.shape, motion: { f: waves.f, ...waves.surface() }, path: pathsOf(load),
    points: [[x, y]], foci: fd ? (t) => fociAt(load, t) : [fociAt(load, 0)] });
}

function showTiles() {
  $("tiles").innerHTML = tiles(answer, pinned);
  $("page").classList.toggle("invalid", Boolean(answer.invalid));
  for (const badge of all("[data-badge]")) {
    badge.hidden = !answer.invalid;
    badge.textContent = answer.invalid || "";
  }
}

/** Tell screen readers the result, once nothing moves. */
function announce() {
  clearTimeout(told);
  told = setTimeout(() => {
    $("spoken").textContent = all(".tile").map((each) => ["name", "value", "detail"].map((part) => (
      each.querySelector(`.${part}`).textContent)).join(" ")).join("; ");
  }, 2 * QUIET);
}

function showPane() {
  if (view.tab === "lines") $("lines").innerHTML = linesTable(answer, pinned);
  else if (view.tab === "dispersion") {
    plots.dispersion.draw(dispersionPlot(answer, view.highest));
    askDispersion(answer.body);
  } else if (view.tab === "level") {
    if (levels) plots.level.draw(levelPlot(answer, view.over, levels));
    $("best").disabled = !levels?.best || !answer.body.is_skin;
  } else {
    $("ab").innerHTML = pinned ? comparison(pinned, answer) : `<p class="note">Press Pin A to keep what is
      shown. Then change the body or a value to compare.</p>`;
  }
}

/** Ask for the curves of a changed body, once. */
async function askDispersion(body) {
  if (!body.made || body.isAsked) return;
  body.isAsked = true;
  try {
    Object.assign(body, await request(data.api, "dispersion", body.toml));
    ask();
  } catch (error) { say(error.message); }
}

const keyOfLevels = () => JSON.stringify({ ...values, [view.over]: 0, over: view.over,
  made: answer?.body.made });

/** Levels over a control, refined about the highest, in short turns so that the page stays alive. */
async function computeLevels() {
  const key = view.over, of = keyOfLevels(), base = values;
  const lead = answer.body.is_skin ? "waves" : "kernel";
  const levelsAt = (value) => {
    const own = { ...base, [key]: value };
    loadOf(own, recordOf(base.body)); // throws for a path that leaves the body
    const { kernelLevel, level } = respond(own);
    return { kernel: kernelLevel?.dB ?? NaN, waves: level?.dB ?? NaN };
  };
  const asked = levels = { of, x: [], kernel: [], waves: [], best: null };
  let until = performance.now() + TURN;
  for (const found of levelOver(levelsAt, OVER[key], { of: lead })) {
    Object.assign(asked, found);
    if (performance.now() < until) continue;
    showPane();
    await new Promise((resolve) => setTimeout(resolve));
    if (levels !== asked) return; // another control has moved
    until = performance.now() + TURN;
  }
  showPane();
}

function showBody() {
  const body = recordOf(values.body);
  document.documentElement.dataset.kind = body.thickness_mm ? "sheet" : "solid";
  controls?.showBody(body);
}

// ---- time -----------------------------------------------------------------------------------------

/** Period in s of what is played. */
function period() {
  const { load } = answer, fd = drawingFrequency(load.path);
  if (load.pulses) return rhythmPeriod(load);
  return 1 / (fd || load.am || load.envelope || 100);
}

function showClock() {
  const whole = period();
  $("phase").value = (clock / whole) % 1;
  $("phase-said").textContent = `${(1e3 * clock).toFixed(whole > 0.1 ? 0 : 2)} of ${rounded(1e3 * whole)} ms`;
  for (const plot of [plots.commanded, plots.waveform]) plot.setCursor(1e3 * clock);
  if (view.look !== "3d") drawMaps();
}

function play(on) {
  $("play").setAttribute("aria-pressed", String(on));
  $("play").textContent = on ? "❚❚ Pause" : "▶ Play";
  cancelAnimationFrame(playing);
  playing = 0;
  if (!on) return;
  let last = performance.now();
  const next = (now) => {
    const whole = period();
    clock = (clock + Math.min(now - last, 100) / 1e3 * whole / PLAYED) % whole;
    last = now;
    showClock();
    playing = requestAnimationFrame(next);
  };
  playing = requestAnimationFrame(next);
}

// ---- bodies from the server -----------------------------------------------------------------------

const changes = {};
async function edit(key, text) {
  const record = recordOf(values.body), known = record.keys.find((own) => own.key === key);
  const value = known.choices ? text : Number(String(text).replace(",", "."));
  if (!known.choices && !Number.isFinite(value)) {
    errors.set(key, `${known.label}: "${text}" is not a number.`);
    showSlot();
    return;
  }
  errors.delete(key);
  if (value === (changes[key] ?? known.value)) return;
  Object.assign(changes, { [key]: value });
  editing?.abort();
  const own = editing = new AbortController(), { toml, name, title } = record;
  markOld();
  $("busy").hidden = false;
  try {
    const found = await request(data.api, "body", JSON.stringify({ toml, name, title, changes }), own);
    if (own !== editing) return;
    takeBody(found.body);
  } catch (error) {
    if (own !== editing) return;
    errors.set("body", error.name === "AbortError" ? "" : error.message);
    controls.showBody(record);
  }
  editing = null;
  for (const each of Object.keys(changes)) delete changes[each];
  $("busy").hidden = true;
  showSlot();
  markOld();
  ask();
}

/** Take a body's record in place of that of the same name, or as another. */
function takeBody(record) {
  const at = data.bodies.findIndex((body) => body.name === record.name);
  if (at < 0) data.bodies.push(record); else data.bodies[at] = record;
  opened.set(record.name, Object.assign(openBody(record), { made: Date.now() }));
  nameBodies(data.bodies.map((body) => body.name));
  controls.showBodies(data.bodies);
  errors.delete("body");
  showBody();
}

async function takeScene(file) {
  try {
    const { values: own, body } = await sendFile(data.api, "scene", file);
    takeBody(body);
    set({ ...values, ...own, body: body.name });
    say(`${file.name} is open.`);
  } catch (error) { errors.set("scene", error.message); showSlot(); }
}

async function takeMeasurement(file) {
  try {
    measured = data.api ? await sendFile(data.api, "measurement", file)
      : readMeasurement(await file.text(), file.name);
    const remarks = measured.remarks.map((text) => `${text[0].toUpperCase()}${text.slice(1)}`);
    say([`${file.name} is drawn over the waves.`, ...remarks].join(" "));
  } catch (error) { errors.set("measurement", error.message); measured = null; }
  $("measured-clear").hidden = !measured;
  showSlot();
  ask();
}

// ---- the page itself ------------------------------------------------------------------------------

const plots = Object.fromEntries(["commanded", "waveform", "spectrum", "dispersion", "level"].map((id) => [id,
  createPlot($(id), { announce: (text) => { $("spoken").textContent = text; } })]));

/** Mark the pressed button of a group. */
function choose(group, name) {
  for (const button of all(`[data-${group}]`)) {
    button.setAttribute("aria-pressed", String(button.dataset[group] === name));
  }
}

function look(name) {
  view.look = name;
  choose("look", name);
  const deep = name === "3d";
  $("solid").hidden = !deep;
  for (const part of all(".map, .foot, #map-legend")) part.toggleAttribute("hidden", deep);
  $("map-scale").hidden = deep || name === "difference";
  if (deep) play(false);
  if (answer) { if (deep) showSolid(); else drawMaps(); writeAddress(); }
}

function tab(name) {
  view.tab = name;
  choose("tab", name);
  for (const pane of all("[data-pane]")) pane.hidden = pane.dataset.pane !== name;
  $("level-tools").hidden = name !== "level";
  if (answer) { ask(); writeAddress(); }
}

function pin() {
  pinned = pinned ? null : { ...answer, ...mapsOf(answer) };
  $("pin").setAttribute("aria-pressed", String(Boolean(pinned)));
  $("pin").textContent = pinned ? "Unpin A" : "Pin A";
  $("swap").disabled = !pinned;
  if (pinned) say("A is pinned. Change the body or a value to compare.");
  tab(pinned ? "ab" : "lines");
  showCurves();
}

function swap() {
  const other = pinned.values;
  pinned = { ...answer, ...mapsOf(answer) };
  set({ ...other });
}

/** Fields show their values again: what was typed wrong in one is gone with the next valid value. */
function forgetTyped() {
  for (const key of errors.keys()) {
    if (!(key in STARTS)) continue;
    errors.delete(key);
    controls.mark(key, "");
  }
}

function restore(found) {
  if (!found) return;
  values = found;
  forgetTyped();
  showBody();
  writeAddress();
  ask();
}

function fillMenus() {
  $("presets").innerHTML = data.presets.map(({ title }, k) => (
    `<button type="button" data-preset="${k}">${escaped(title)}</button>`)).join("");
  document.addEventListener("click", ({ target }) => {
    const button = target.closest("[data-preset], [data-save]");
    button?.closest("[popover]").hidePopover();
    const preset = data.presets[button?.dataset.preset];
    if (!preset) return;
    set({ ...values, ...Object.fromEntries(Object.entries(preset.values)
      .filter(([key]) => key in STARTS).map(([key, value]) => [key, check(key, value)])) });
    say(preset.title);
  });
}

function listen() {
  const on = (id, name, act) => $(id).addEventListener(name, act);
  for (const [id, way] of Object.entries(STEPS)) on(id, "click", () => restore(history.go(way)));
  on("pin", "click", pin);
  on("swap", "click", swap);
  on("link", "click", async () => {
    const link = address().replace(location.search, ""); // without the token of a server
    try {
      await navigator.clipboard.writeText(link);
      say("The link is copied.");
    } catch { prompt("Copy this address:", link); }
  });
  on("about-open", "click", () => $("about").showModal());
  on("cancel", "click", () => editing?.abort());
  on("play", "click", () => play(!playing));
  on("phase", "input", () => {
    play(false);
    clock = Number($("phase").value) * period();
    showClock();
  });
  on("span", "change", () => { view.span = $("span").value; ask(); });
  on("highest", "change", () => { view.highest = Number($("highest").value); ask(); });
  on("map-decibel", "change", () => { view.mapDecibel = Number($("map-decibel").value); drawMaps(); });
  on("over", "change", () => { view.over = $("over").value; ask(); });
  on("best", "click", () => {
    const best = levels?.best;
    if (best) set({ ...values, [view.over]: check(view.over, Number(best.at.toPrecision(4))) });
  });
  on("sheet-toggle", "click", () => {
    $("sheet-toggle").setAttribute("aria-expanded", String($("sheet").classList.toggle("open")));
  });
  on("controls", "submit", (event) => event.preventDefault());
  for (const button of all("[data-look]")) button.onclick = () => look(button.dataset.look);
  for (const button of all("[data-tab]")) button.onclick = () => tab(button.dataset.tab);
  for (const id of ["kernel-map", "wave-map"]) {
    let resting = 0;
    mapControls($(id), (x, y) => {
      const at = (v) => Math.min(Math.max(Math.round(1e4 * v) / 10, -50), 50);
      set({ ...values, x: at(x), y: at(y) }, false);
      clearTimeout(resting);
      resting = setTimeout(() => set(values), QUIET);
    });
  }
  addEventListener("keydown", (event) => {
    if (!(event.ctrlKey || event.metaKey) || event.altKey
      || /^(text|)$/.test(event.target.type ?? "-")) return;
    const key = event.key.toLowerCase();
    if (key !== "z" && key !== "y") return;
    restore(history.go(key === "y" || event.shiftKey ? 1 : -1));
    event.preventDefault();
  });
  $("page").addEventListener("dragover", (event) => event.preventDefault());
  $("page").addEventListener("drop", (event) => {
    event.preventDefault();
    if (event.dataTransfer.files[0]) takeMeasurement(event.dataTransfer.files[0]);
  });
  $("controls").addEventListener("change", ({ target }) => {
    if (target.id === "scene" && target.files[0]) takeScene(target.files[0]);
    if (target.id === "measurement" && target.files[0]) takeMeasurement(target.files[0]);
  });
  $("controls").addEventListener("click", ({ target }) => {
    if (target.id !== "measured-clear") return;
    measured = null;
    target.hidden = true;
    $("measurement").value = "";
    ask();
  });
  addEventListener("resize", drawMaps);
  addEventListener("hashchange", begin);
}

function begin() {
  const { values: own, refused, view: shown } = readAddress(starts);
  values = { ...own, body: recordOf(own.body).name };
  notice = refused.join(" ");
  showBody();
  look(["maps", "3d", "difference"].includes(shown.view) ? shown.view : "maps");
  tab(["lines", "dispersion", "level", "ab"].includes(shown.tab) ? shown.tab : "lines");
  history = createHistory(values);
  writeAddress();
  showCurves();
  if (shown.selftest !== undefined) runSelftest(data, bodyOf, loadOf);
}

nameBodies(data.bodies.map((body) => body.name));
controls = buildControls($("controls"), {
  bodies: data.bodies, editable: Boolean(data.api), change, edit,
  refuse: (key, sentence) => { errors.set(key, sentence); controls.mark(key, sentence); showSlot(); },
  moving: (on) => { if (moving && !on) ask(); moving = on; },
});
$("map-legend").innerHTML = MAP_LEGEND;
$("span").innerHTML = SPANS.map((words) => `<option>${words}</option>`).join("");
$("over").innerHTML = Object.keys(OVER).map((key) =>
  `<option value="${key}" title="${LABELS[key]}">${key === "am" ? "AM" : key}</option>`).join("");
$("highest").value = view.highest;
fillMenus();
offerSaves($("save"), { answer: () => answer, say, writers: WRITERS });
listen();
begin();
