// The page: reads its data, computes an answer at every move of a control, and shows it.

import { addressOf, createHistory, readAddress } from "./address.js";
import { NUMBERS_OF_MAPS, mapsOf, respond as respondTo } from "./answer.js";
import { mapsBeside } from "./beside.js";
import { openBody, surfaceMotion } from "./bodies.js";
import { buildControls } from "./controls.js";
import { MAP_LINE, levelOver } from "./evaluate.js";
import { filmOf } from "./film.js";
import { OVER, commandedPlot, difference, dispersionPlot, factorOf, fociAt, levelPlot, pathsOf, spanOf,
  spectrumPlot, waveformPlot } from "./figures.js";
import { WRITERS, readMeasurement, readScene, readSession, samplesOf } from "./files.js";
import { drawingFrequency, levelFactor, rhythmLevel, rhythmPeriod } from "./load.js";
import { MAP_LEGEND, drawMap, mapControls, moveMap } from "./maps.js";
import { largestOf } from "./numeric.js";
import { createPlot, keptScales, niceTop } from "./plots.js";
import { offerSaves } from "./saving.js";
import { runSelftest } from "./selftest.js";
import { request, sendFile } from "./server.js";
import { synthesise } from "./surface3d.js";
import { comparison, linesTable, tiles } from "./tables.js";
import { escaped, rounded } from "./text.js";
import { LABELS, STARTS, check, cornersOf, fitPaths, loadOf, nameBodies, withCorner } from "./values.js";
import { openView } from "./view3d.js";

const data = JSON.parse(document.getElementById("data").textContent);
const $ = (id) => document.getElementById(id);
const all = (selector) => [...document.querySelectorAll(selector)];

const LOOKS = ["maps", "motion", "difference", "3d"];
const SPANS = ["automatic", "last 60 ms", "all"];
const PLAYED = 5, SHORTEST = 0.06; // s in which a part of the motion is played, and its least length
const SLICE = 30; // ms of slow work, after which the page draws
const STEPS = { undo: -1, redo: 1 };
const PAUSE = 300; // ms without a move, after which slow results are computed

const opened = new Map(); // bodies by name
const starts = { ...STARTS, ...data.start };
const view = { look: "maps", tab: "lines", span: "automatic", highest: "600", over: "speed", mapDecibel: 0 };
const errors = new Map(); // sentences by control or file
const scale = keptScales();
let values = starts, answer = null, pinned = null, measured = null, history = null, controls = null;
let curvesDue = 0, levelsDue = 0, announcementDue = 0, moving = false;
let levels = null, solid = null, solidKernel = null, solidMaps = null;
let playing = 0, clock = 0, editing = null, notice = "";

const askForMaps = mapsBeside($("worker").textContent, takeMaps);

/** The surface of maps as a flat sheet for pictures of the kernel in three dimensions, in mm. */
const flatSheet = (() => {
  const n = MAP_LINE.length, points = new Float32Array(3 * n * n), triangles = [];
  const at = (k) => 1e3 * MAP_LINE[k];
  for (let p = 0; p < n * n; p++) points.set([at(p % n), at(Math.floor(p / n)), 0], 3 * p);
  for (let p = 0; p < n * (n - 1); p++) {
    if ((p + 1) % n) triangles.push(p, p + 1, p + n, p + 1, p + n + 1, p + n);
  }
  return { points, triangles: Uint32Array.from(triangles) };
})();

const recordOf = (name) => data.bodies.find((body) => body.name === name) ?? data.bodies[0];

function bodyOf(name) {
  const record = recordOf(name);
  if (!opened.has(record.name)) opened.set(record.name, openBody(record));
  return opened.get(record.name);
}

const respond = (own) => respondTo(own, bodyOf(own.body));

function change(key, value, settled) {
  const next = { ...values, [key]: value };
  set(["foci", "paths"].includes(key) ? fitPaths(next, key) : next, settled);
}

/** Take values; settled ones are a step of the history. */
function set(next, settled = true) {
  const isOther = next.body !== values.body;
  values = isOther ? { ...next, ...pointOnBody(next) } : next;
  notice = "";
  clearInputErrors();
  if (settled) {
    history.add(values);
    writeAddress();
  }
  if (isOther) showBody();
  schedule();
}

/** The point, moved onto the body if it is outside. */
function pointOnBody({ body, x, y }) {
  const [hx, hy] = recordOf(body).extent_mm ?? [Infinity, Infinity];
  const within = (value, half) => Math.min(Math.max(value, -half), half);
  return { x: within(x, hx), y: within(y, hy) };
}

/** Mark the result as old while a body is computed, or while the values have no answer. */
function markOld() {
  $("page").classList.toggle("stale", Boolean(editing) || errors.has("load"));
}

/** Mark the tiles as busy until they show the numbers of the present values. */
const showBusy = (isBusy) => $("tiles").setAttribute("aria-busy", isBusy);

function schedule() {
  showBusy(true);
  curvesDue ||= requestAnimationFrame(showCurves);
}

/** Address of this page with its values and view, as far as they differ from the starts. */
const address = () => addressOf(values, starts, { view: view.look === "maps" ? "" : view.look,
  tab: ["lines", "ab"].includes(view.tab) ? "" : view.tab });

function writeAddress() {
  try {
    window.history.replaceState(null, "", address());
  } catch { /* some hosts forbid it */ }
  for (const [id, way] of Object.entries(STEPS)) $(id).disabled = !history.has(way);
}

function notify(text) {
  notice = text;
  showMessages();
}

function fail(key, message) {
  errors.set(key, message);
  showMessages();
}

function showMessages() {
  const problem = [...errors.values()].find(Boolean) ?? "";
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

/** Numbers of the latest maps of the same body, shown until new maps are there. */
function numbersOfMaps() {
  if (answer?.body !== bodyOf(values.body)) return {};
  return Object.fromEntries(NUMBERS_OF_MAPS.map((key) => [key, answer[key]]));
}

function showCurves() {
  curvesDue = 0;
  try {
    answer = { ...numbersOfMaps(), ...respond(values) };
    errors.delete("load");
  } catch (error) {
    errors.set("load", error.message);
  }
  markOld();
  controls.show(values, drawnAt());
  showMessages();
  if (errors.has("load")) {
    showBusy(false);
    return;
  }
  const { load } = answer;
  plots.commanded.draw(commandedPlot(answer, spanOf(view.span, load)));
  showPlots();
  $("commanded-note").textContent = `${values.drive.replaceAll("_", " ")}, ${rounded(load.duration)} s`;
  showTiles();
  showPane();
  askForMaps(answer, recordOf(answer.body.name));
  clearTimeout(levelsDue);
  levels = levels?.key === keyOfLevels() ? levels : null;
  if (view.tab === "level" && !levels) levelsDue = setTimeout(computeLevels, PAUSE);
}

function showPlots() {
  const options = { pinned, measured, ...frequencies(),
    scale: (name, largest) => scale(name, largest, moving) };
  plots.waveform.draw(waveformPlot(answer, spanOf(view.span, answer.load), options));
  plots.spectrum.draw(spectrumPlot(answer, options));
}

/** Highest frequency in Hz of the spectrum, and whether its axis is logarithmic. */
const frequencies = () => ({ highest: parseFloat(view.highest), log: view.highest.endsWith("log") });

/** Drawing frequency in Hz; NaN while the values contradict each other. */
function drawnAt() {
  if (errors.has("load")) return NaN;
  const { path } = answer.load;
  return path.drawn ?? drawingFrequency(path);
}

/** Take maps and their numbers; those of another body are old. */
function takeMaps(maps, done) {
  if (done.body !== answer.body) return;
  const keyOf = ({ invalid, peaks = {} }) => [invalid ?? "", ...Object.values(peaks).map(niceTop)].join();
  const before = keyOf(answer);
  Object.assign(answer, maps);
  if (keyOf(answer) !== before) showPlots(); // which are hatched and scaled, too
  showMessages();
  clock %= played();
  showClock();
  showTiles();
  announce();
  if (view.tab === "ab") showPane();
  if (view.look === "3d") showSolid();
  if (done === answer && !curvesDue) showBusy(false);
}

const short = (title) => (title.length > 22 ? `${title.slice(0, 21)}…` : title);

/** What every map shows of an answer: its path, corners, point and the kernel's region. */
const placesOf = (own) => ({ path: pathsOf(own.load), corners: own === answer ? cornersOf(values) : [],
  point: [own.x, own.y], influenced: own.maps.kernel.rms });

/** Draw the map of the kernel, or of the waves of A, beside that of the waves. */
function drawMaps() {
  if (!answer?.maps || view.look === "3d") return;
  const a = pinned?.maps ? pinned : null, isDifference = view.look === "difference";
  if (view.look === "motion") {
    drawMotion();
    return;
  }
  const top = (name, rms) => scale(`map ${name}`, largestOf(rms), moving);
  const topOf = (own) => top(`waves ${own.body.name}`, own.maps.waves.rms);
  const common = (own) => ({ ...placesOf(own), decibel: view.mapDecibel });
  const motion = (own, map, unit, largest) => (
    { rms: map.rms, level: own.body.is_skin ? map.level : null, unit, largest, hatched: own.invalid });
  const { maps, load, body } = answer, foci = fociAt(load, clock);
  let [topB, topA] = [topOf(answer), a ? topOf(a) : 0];
  if (factorOf(topA, topB) === 1) topB = topA = Math.max(topA, topB);
  const left = a ? { ...motion(a, a.maps.waves, "m", topA), title: `A: ${short(a.body.title)}` }
    : { ...motion(answer, maps.kernel, "Pa", top("kernel", maps.kernel.rms)), foci, title: "Kernel, RMS",
      hatched: "" };
  const right = isDifference
    ? { rms: difference(maps.waves.rms, a ? a.maps.waves.rms : maps.kernel.rms), unit: "dB", largest: 40,
      signed: true, hatched: answer.invalid, title: a ? "B − A" : "Waves − kernel" }
    : { ...motion(answer, maps.waves, "m", topB), title: a ? `B: ${short(body.title)}` : "Waves, RMS" };
  drawMap($("kernel-map"), { ...common(a ?? answer), ...left });
  drawMap($("wave-map"), { ...common(answer), ...right, foci });
}

/** Draw the pressure of the kernel, or the waves of A, and the waves at the time of the clock. */
function drawMotion() {
  motionMaps().forEach((options, k) => drawMap($(["kernel-map", "wave-map"][k]), options));
}

/** Options of both maps at the time of the clock. */
function motionMaps() {
  const a = pinned?.maps ? pinned : null;
  const b = answer, isPlaying = Boolean(playing);
  const top = (name, largest) => scale(`motion ${name}`, largest, moving);
  const common = (own) => ({ ...placesOf(own), foci: fociAt(own.load, now()), moving: isPlaying,
    hatched: own.invalid });
  const topOf = (own) => top(`waves ${own.body.name}`, own.maps.waves.crest);
  const isAlike = a && factorOf(topOf(a), topOf(b)) === 1;
  const waves = (own, title) => ({ ...common(own), rms: wavesNow(own), unit: "m", signed: true, title,
    largest: isAlike ? Math.max(topOf(a), topOf(b)) : topOf(own) });
  const left = a ? waves(a, `A: ${short(a.body.title)}, motion`) : { ...common(b), hatched: "",
    rms: kernelNow(b), unit: "Pa", largest: top("kernel", b.peaks.kernel), title: "Kernel, pressure" };
  return [left, waves(b, a ? `B: ${short(b.body.title)}, motion` : "Waves, motion into the body")];
}

/** Film of both maps, of what Play shows. */
function film() {
  const before = clock;
  notify(`Recording ${PLAYED} s.`);
  return filmOf((share) => { clock = share * played(); return motionMaps(); },
    () => `${answer.body.title}. ${(1e3 * clock).toFixed(1)} ms; ${pace()}`, PLAYED)
    .finally(() => { clock = before; });
}

const places = () => new Float32Array(MAP_LINE.length ** 2);

/** Pressure of the kernel in Pa on the map at the time of the clock. */
function kernelNow({ kernel }) {
  const values = places();
  kernel.snapshot(now(), MAP_LINE, MAP_LINE, values);
  return values;
}

/** Steady motion in metre about the mean on the map at the time of the clock, with the level of a rhythm. */
function wavesNow({ maps, load }) {
  const values = places(), level = load.pulses ? levelFactor(load, rhythmLevel(load, now())) : 1;
  synthesise(maps.waves, maps.waves, now(), values);
  return level === 1 ? values : values.map((v) => level * v);
}

function showSolid() {
  if (!answer?.maps) return;
  solid ??= openView($("solid"), { onTime: (t) => { clock = t; solidKernel?.seek(t); } });
  solidKernel ??= openView($("solid-kernel"), { follows: true });
  if (solidMaps === answer.maps) return;
  solidMaps = answer.maps;
  const { body, maps: { kernel, waves }, load, x, y } = answer, fd = drawingFrequency(load.path);
  const foci = fd ? (t) => fociAt(load, t) : [fociAt(load, 0)];
  const common = { path: pathsOf(load), points: [[x, y]], foci };
  solid.show({ ...common, shape: body.shape, motion: surfaceMotion(body.shape, waves) });
  const { f, re, im } = kernel, up = (values) => values.map((v) => -v);
  solidKernel.show({ ...common, shape: flatSheet, motion: { f, re: up(re), im: up(im) }, unit: "Pa",
    period: solid.loop });
}

function showTiles() {
  $("tiles").innerHTML = tiles(answer, pinned);
  $("page").classList.toggle("invalid", Boolean(answer.invalid));
  for (const badge of all("[data-badge]")) {
    badge.hidden = !answer.invalid;
    badge.textContent = answer.invalid || "";
  }
}

/** Read the result to screen readers once nothing moves. */
function announce() {
  clearTimeout(announcementDue);
  announcementDue = setTimeout(() => {
    $("spoken").textContent = all(".tile").map((each) => ["name", "value", "detail"].map((part) => (
      each.querySelector(`.${part}`).textContent)).join(" ")).join("; ");
  }, 2 * PAUSE);
}

function showPane() {
  if (view.tab === "lines") $("lines").innerHTML = linesTable(answer, pinned);
  else if (view.tab === "dispersion") {
    requestDispersion(answer.body);
    plots.dispersion.draw(dispersionPlot(answer, frequencies().highest));
  } else if (view.tab === "level") {
    if (levels) plots.level.draw(levelPlot(answer, view.over, levels));
    $("best").disabled = !levels?.best || !answer.body.is_skin;
  } else {
    $("ab").innerHTML = pinned ? comparison(pinned, answer)
      : '<p class="note">Press Pin A to keep this result. Then change the body or a value to compare.</p>';
  }
}

/** Request the dispersion curves of a changed body, once. */
async function requestDispersion(body) {
  if (!body.made || body.isRequested) return;
  body.isRequested = true;
  try {
    Object.assign(body, await request(data.api, "dispersion", body.toml));
    schedule();
  } catch (error) {
    body.hasFailed = true;
    notify(error.message);
  }
}

const keyOfLevels = () => JSON.stringify({ ...values, [view.over]: 0, over: view.over,
  made: answer?.body.made });

/** Compute levels over a control in short slices, so that the page stays responsive. */
async function computeLevels() {
  const over = view.over, base = values, lead = answer.body.is_skin ? "waves" : "kernel";
  const levelsAt = (value) => {
    const { kernelLevel, level } = respond({ ...base, [over]: value });
    return { kernel: kernelLevel?.dB ?? NaN, waves: level?.dB ?? NaN };
  };
  const result = levels = { key: keyOfLevels(), x: [], kernel: [], waves: [], best: null };
  let until = performance.now() + SLICE;
  for (const part of levelOver(levelsAt, OVER[over], { lead })) {
    Object.assign(result, part);
    if (performance.now() < until) continue;
    showPane();
    await new Promise((resolve) => setTimeout(resolve));
    if (levels !== result) return; // another control has moved
    until = performance.now() + SLICE;
  }
  showPane();
}

function showBody() {
  const body = recordOf(values.body);
  document.documentElement.dataset.kind = body.thickness_mm ? "sheet" : "solid";
  controls?.showBody(body);
}

// ---- time -----------------------------------------------------------------------------------------

/** Length in s of the part of the motion that is played, from the start of the plots' span. */
function played() {
  const { load } = answer, fd = drawingFrequency(load.path);
  const period = load.pulses ? rhythmPeriod(load) : 1 / (fd || load.am || load.envelope || 100);
  return Math.min(Math.max(period, SHORTEST), load.duration);
}

const pace = () => `1 s shows ${rounded(1e3 * played() / PLAYED, 2)} ms`;

/** Time in s that the clock shows. */
const now = () => spanOf(view.span, answer.load)[0] + clock;

/** Show the time on the slider and in the plots, and draw the maps. */
function showClock() {
  showTime();
  drawMaps();
}

function showTime() {
  const whole = played();
  $("phase").value = clock / whole;
  $("phase-text").textContent = `${(1e3 * clock).toFixed(whole > 0.1 ? 0 : 1)} ms; ${pace()}`;
  for (const plot of [plots.commanded, plots.waveform]) plot.setCursor(clock ? 1e3 * now() : null);
}

/** Move both maps to the time of the clock. */
function moveMaps() {
  showTime();
  motionMaps().forEach((options, k) => moveMap($(["kernel-map", "wave-map"][k]), options));
}

function play(on) {
  $("play").setAttribute("aria-pressed", String(on));
  $("play").textContent = on ? "❚❚ Pause" : "▶ Play";
  cancelAnimationFrame(playing);
  const wasPlaying = playing;
  playing = 0;
  if (!on) {
    if (wasPlaying && answer) drawMaps();
    return;
  }
  let last = performance.now();
  const next = (at) => {
    const whole = played();
    playing = requestAnimationFrame(next);
    clock = (clock + Math.min(at - last, 100) / 1e3 * whole / PLAYED) % whole;
    last = at;
    moveMaps();
  };
  playing = requestAnimationFrame(next);
  look("motion");
}

// ---- bodies, scenes and measurements --------------------------------------------------------------

const changes = {};
async function edit(key, text) {
  const record = recordOf(values.body), known = record.keys.find((own) => own.key === key);
  const value = known.choices ? text : Number(String(text).replace(",", "."));
  if (!known.choices && !Number.isFinite(value)) {
    fail(key, `${known.label}: "${text}" is not a number.`);
    return;
  }
  errors.delete(key);
  if (value === (changes[key] ?? known.value)) return;
  changes[key] = value;
  editing?.abort();
  const own = editing = new AbortController(), { toml, name, title } = record;
  markOld();
  $("busy").hidden = false;
  try {
    const result = await request(data.api, "body", JSON.stringify({ toml, name, title, changes }), own);
    if (own !== editing) return;
    takeBody(result.body);
  } catch (error) {
    if (own !== editing) return;
    errors.set("body", error.name === "AbortError" ? "" : error.message);
    controls.showBody(record);
  }
  editing = null;
  for (const each of Object.keys(changes)) delete changes[each];
  $("busy").hidden = true;
  showMessages();
  markOld();
  schedule();
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

async function openScene(file) {
  try {
    const { values: own, body } = await sendFile(data.api, "scene", file);
    if (body) takeBody(body);
    set({ ...values, ...own, body: body?.name ?? values.body });
    notify(`${file.name} is open.`);
  } catch (error) { fail("scene", error.message); }
}

async function openMeasurement(file) {
  try {
    measured = data.api ? await sendFile(data.api, "measurement", file)
      : readMeasurement(await file.text(), file.name);
    const remarks = measured.remarks.map((text) => `${text[0].toUpperCase()}${text.slice(1)}`);
    errors.delete("measurement");
    notify([`${file.name} is drawn over the waves.`, ...remarks].join(" "));
  } catch (error) {
    measured = null;
    fail("measurement", error.message);
  }
  $("measured-clear").hidden = !measured;
  schedule();
}

async function openSession(file) {
  try {
    const text = await file.text(), isScene = file.name.endsWith(".toml");
    const session = isScene ? { b: readScene(text, file.name, data.bodies) } : readSession(text, file.name);
    if (session.a) {
      answer = respond(session.a);
      pinned = withMaps();
    }
    set(session.b);
    showPinned();
    notify(`${file.name} is open.`);
  } catch (error) { fail("session", error.message); }
}

/** Play the displacement at the point as sound. */
function listenToPoint() {
  const { samples, rate } = samplesOf(answer), context = new AudioContext();
  const buffer = context.createBuffer(1, samples.length, rate), source = context.createBufferSource();
  buffer.copyToChannel(Float32Array.from(samples), 0);
  source.buffer = buffer;
  source.connect(context.destination);
  source.onended = () => context.close();
  source.start();
}

function removeMeasurement() {
  measured = null;
  $("measured-clear").hidden = true;
  $("measurement").value = "";
  schedule();
}

// ---- the page itself ------------------------------------------------------------------------------

const plots = Object.fromEntries(["commanded", "waveform", "spectrum", "dispersion", "level"].map((id) => [id,
  createPlot($(id), { announce: (text) => { $("spoken").textContent = text; } })]));

/** Mark one button of a group as pressed. */
function press(group, name) {
  for (const button of all(`[data-${group}]`)) {
    button.setAttribute("aria-pressed", String(button.dataset[group] === name));
  }
}

function look(name) {
  view.look = name;
  press("look", name);
  const isSolid = name === "3d";
  for (const id of ["solid", "solid-kernel"]) $(id).hidden = !isSolid;
  for (const part of all(".map, .foot, #map-legend")) part.toggleAttribute("hidden", isSolid);
  $("map-scale").hidden = name !== "maps";
  if (name !== "motion") play(false);
  if (answer) { if (isSolid) showSolid(); else drawMaps(); writeAddress(); }
}

function tab(name) {
  view.tab = name;
  press("tab", name);
  for (const pane of all("[data-pane]")) pane.hidden = pane.dataset.pane !== name;
  $("level-tools").hidden = name !== "level";
  if (answer) { schedule(); writeAddress(); }
}

const withMaps = () => ({ ...answer, ...mapsOf(answer) });

function pin() {
  pinned = pinned ? null : withMaps();
  showPinned();
  if (pinned) notify("A is pinned. Change the body or a value to compare.");
  tab(pinned ? "ab" : "lines");
}

function showPinned() {
  $("pin").setAttribute("aria-pressed", String(Boolean(pinned)));
  $("pin").textContent = pinned ? "Unpin A" : "Pin A";
  $("swap").disabled = !pinned;
}

function swap() {
  const other = pinned.values;
  pinned = withMaps();
  set(other);
}

/** Forget errors of what was typed; the fields show valid values again. */
function clearInputErrors() {
  for (const key of errors.keys()) {
    if (!(key in STARTS)) continue;
    errors.delete(key);
    controls.mark(key, "");
  }
}

function restore(step) {
  if (!step) return;
  values = step;
  clearInputErrors();
  showBody();
  writeAddress();
  schedule();
}

function applyPreset({ title, values: own }) {
  const known = Object.entries(own).filter(([key]) => key in STARTS);
  set({ ...values, ...Object.fromEntries(known.map(([key, value]) => [key, check(key, value)])) });
  notify(title);
}

async function copyLink() {
  const link = address().replace(location.search, ""); // without the token of a server
  try {
    await navigator.clipboard.writeText(link);
    notify("The link is copied.");
  } catch { prompt("Copy this address:", link); }
}

function setToBest() {
  if (levels?.best) change(view.over, check(view.over, Number(levels.best.at.toPrecision(4))), true);
}

function listenToMaps() {
  for (const id of ["kernel-map", "wave-map"]) {
    let settling = 0;
    const move = (next) => {
      set(next, false);
      clearTimeout(settling);
      settling = setTimeout(() => set(values), PAUSE);
    };
    const at = (v) => Math.min(Math.max(Math.round(1e4 * v) / 10, -50), 50);
    mapControls($(id), (x, y) => move({ ...values, x: at(x), y: at(y) }), (k, x, y) => {
      try { move(withCorner(values, k, [x, y])); } catch { /* the path would leave its area */ }
    });
  }
}

function listenToKeys() {
  addEventListener("keydown", (event) => {
    if (!(event.ctrlKey || event.metaKey) || event.altKey
      || /^(text|)$/.test(event.target.type ?? "-")) return;
    const key = event.key.toLowerCase();
    if (key !== "z" && key !== "y") return;
    restore(history.go(key === "y" || event.shiftKey ? 1 : -1));
    event.preventDefault();
  });
}

function listen() {
  const on = (id, name, act) => $(id).addEventListener(name, act);
  for (const [id, way] of Object.entries(STEPS)) on(id, "click", () => restore(history.go(way)));
  const clicks = { pin, swap, link: copyLink, best: setToBest, "about-open": () => $("about").showModal(),
    cancel: () => editing?.abort(), listen: listenToPoint, play: () => play(!playing) };
  for (const [id, act] of Object.entries(clicks)) on(id, "click", act);
  on("phase", "input", () => {
    play(false);
    clock = Number($("phase").value) * played();
    if (view.look === "motion") showClock(); else look("motion");
    showTime();
  });
  for (const key of ["span", "highest", "over"]) {
    on(key, "change", ({ target }) => {
      view[key] = target.value;
      schedule();
    });
  }
  on("map-decibel", "change", ({ target }) => { view.mapDecibel = Number(target.value); drawMaps(); });
  on("sheet-toggle", "click", () => {
    $("sheet-toggle").setAttribute("aria-expanded", String($("sheet").classList.toggle("open")));
  });
  for (const button of all("[data-look]")) button.onclick = () => look(button.dataset.look);
  for (const button of all("[data-tab]")) button.onclick = () => tab(button.dataset.tab);
  document.addEventListener("click", ({ target }) => {
    const button = target.closest("[data-preset], [data-save]");
    button?.closest("[popover]").hidePopover();
    if (button?.dataset.save) play(false); // figures contain the maps
    if (button?.dataset.preset) applyPreset(data.presets[button.dataset.preset]);
  });
  on("page", "dragover", (event) => event.preventDefault());
  on("page", "drop", (event) => {
    event.preventDefault();
    if (event.dataTransfer.files[0]) openMeasurement(event.dataTransfer.files[0]);
  });
  on("controls", "submit", (event) => event.preventDefault());
  on("controls", "change", ({ target }) => {
    if (target.id === "scene" && target.files[0]) openScene(target.files[0]);
    if (target.id === "session" && target.files[0]) openSession(target.files[0]);
    if (target.id === "measurement" && target.files[0]) openMeasurement(target.files[0]);
  });
  on("measured-clear", "click", removeMeasurement);
  listenToMaps();
  listenToKeys();
  addEventListener("resize", drawMaps);
  addEventListener("hashchange", begin);
}

function begin() {
  const { values: own, refused, view: given } = readAddress(starts);
  values = { ...own, body: recordOf(own.body).name };
  notice = refused.join(" ");
  showBody();
  look(LOOKS.includes(given.view) ? given.view : "maps");
  tab(["lines", "dispersion", "level", "ab"].includes(given.tab) ? given.tab : "lines");
  history = createHistory(values);
  writeAddress();
  showCurves();
  if (given.selftest !== undefined) runSelftest(data, bodyOf, loadOf);
}

nameBodies(data.bodies.map((body) => body.name));
controls = buildControls($("controls"), {
  bodies: data.bodies, editable: Boolean(data.api), change, edit,
  refuse: (key, sentence) => { controls.mark(key, sentence); fail(key, sentence); },
  moving: (on) => { if (moving && !on) schedule(); moving = on; },
});
$("map-legend").innerHTML = MAP_LEGEND;
$("span").innerHTML = SPANS.map((words) => `<option>${words}</option>`).join("");
$("over").innerHTML = Object.keys(OVER).map((key) =>
  `<option value="${key}" title="${LABELS[key]}">${key === "am" ? "AM" : key}</option>`).join("");
$("highest").value = view.highest;
$("presets").innerHTML = data.presets.map(({ title }, k) => (
  `<button type="button" data-preset="${k}">${escaped(title)}</button>`)).join("");
offerSaves($("save"), { answer: () => ({ ...answer, pinned }), notify,
  writers: [["Film of both maps, WebM", "waves.webm", "video/webm", film], ...WRITERS] });
listen();
begin();
