// Functions of the page itself: its address, the point under a pointer, reloading after a loss.
const SLOWED = 250; // times that time is slowed down at least
const LEAST = 3000; // ms that a drawing of the path takes at least
const EVERY = 60; // ms between pictures
const STILL = window.matchMedia("(prefers-reduced-motion: reduce)").matches;
window.trame.utils.skinwave = {
  address(query) {
    const at = window.location.pathname + (query ? "?" + query : "");
    window.history.replaceState({}, document.title, at);
  },
  // The place in mm under a pointer on a map whose view box is in mm, y downwards.
  place(event) {
    const matrix = event.currentTarget.getScreenCTM().inverse();
    const at = new DOMPoint(event.clientX, event.clientY).matrixTransform(matrix);
    return [at.x, -at.y];
  },
  // Move the selected point: every press counts, however many come before an update does.
  step(dx, dy, limit) {
    const { state } = window.trame;
    const moved = (key, by) => {
      const value = Math.round(100 * (state.get(key) + by)) / 100;
      state.set(key, Math.min(limit, Math.max(-limit, value)));
    };
    if (dx) moved("x", dx);
    if (dy) moved("y", dy);
  },
  // Play foci, cursors and the body together, slowed down so that a drawing of the path is seen.
  play(on = !this.playing) {
    if (on === !!this.playing) return;
    this.playing = on;
    for (const button of document.querySelectorAll(".sw-play")) {
      button.textContent = on ? "❚❚ Pause" : "▶ Play";
    }
    if (!on) return this.stopped();
    let last = performance.now(), told = 0;
    const next = (now) => {
      if (!this.playing) return;
      // Waves that are being computed come first, and what is not current rests.
      const rests = document.hidden || window.trame.state.get("waves_stale");
      if (!rests) this.time = this.after(now - last);
      last = now;
      if (!rests && now - told > EVERY) {
        told = now;
        this.show(this.time);
      }
      requestAnimationFrame(next);
    };
    requestAnimationFrame(next);
  },
  // As waves come for the first time they move, unless the reader's system asks for stillness.
  came() {
    if (!this.begun && !STILL) this.play(true);
    this.begun = true;
  },
  // The slider of the foci stays where they are.
  stopped() {
    const { state, utils } = window.trame;
    utils.plots.point(utils.plots.shown.waveform_plot, null);
    state.set("phase", this.phase(this.time ?? 0));
  },
  // Time of the Tacton in ms after so many ms on the screen; it begins again where its plot ends.
  after(passed) {
    const { state, utils } = window.trame, { figure, zoom } = utils.plots.shown.waveform_plot;
    const [from, to] = zoom || figure?.x.range || [0, 1];
    const slowed = Math.max(SLOWED, (LEAST * state.get("drawing_frequency")) / 1000);
    const time = (this.time ?? from) + passed / slowed;
    return time >= from && time < to ? time : from;
  },
  // Per cent of a drawing of the path at a time in ms.
  phase: (time) => Math.floor(((time / 1000) * window.trame.state.get("drawing_frequency") * 100) % 100),
  // Foci, cursors and the body at a time in ms. Foci are moved on their own: with anything else of
  // the state, all of the page would be made anew.
  show(time) {
    const { state, utils } = window.trame;
    this.time = time;
    if (!document.querySelector(".sw-plots canvas:is(:hover, :focus-visible)"))
      utils.plots.point(utils.plots.shown.waveform_plot, time, true);
    const at = state.get("foci_track")[this.phase(time)] || [];
    for (const circle of document.querySelectorAll(".sw-focus")) {
      const [x, y] = at[circle.dataset.focus] || [];
      if (x === undefined) continue;
      circle.setAttribute("cx", x);
      circle.setAttribute("cy", y);
    }
    utils.body.show(time);
  },
  // What the browser alone knows of what is on the screen, for a figure: parts of plots that are
  // zoomed to and, of the body, its time in ms, how it is turned and tipped, and where it is cut.
  view() {
    const { plots, body } = window.trame.utils, { turned, tipped, cut, hue } = body.view;
    const time = this.time ?? 0;
    const foci = this.playing ? this.phase(time) : window.trame.state.get("phase");
    return [...plots.zooms(), `foci:${foci}`,
            `body:${[time, turned, tipped, cut, Number(hue)].join(":")}`].join(" ");
  },
  // The waveform at the point as sound, at its own speed.
  async hear() {
    const bytes = await window.trame.trigger("waveform_wav");
    const heard = bytes instanceof Blob ? await bytes.arrayBuffer() : new Uint8Array(bytes).buffer;
    this.sound ??= new AudioContext();
    const made = this.sound.createBufferSource();
    made.buffer = await this.sound.decodeAudioData(heard);
    made.connect(this.sound.destination);
    this.heard?.stop();
    this.heard = made;
    made.start();
  },
  prefersDark: () => window.matchMedia("(prefers-color-scheme: dark)").matches,
  // Curves and address follow the state by themselves: nothing else of the page has to for them.
  begin(state, plots) {
    this.unwatch?.();
    this.unwatch = state.watch(["query"], (query) => query !== undefined && this.address(query));
    window.trame.utils.plots.begin(state, plots);
  },
};
document.title = "skinwave";
document.addEventListener("keydown", (event) => {
  if (!(event.ctrlKey || event.metaKey) || event.target.tagName === "INPUT") return;
  const key = event.key.toLowerCase();
  const name = key === "y" || (key === "z" && event.shiftKey) ? "redo" : key === "z" ? "undo" : "";
  if (name) {
    event.preventDefault();
    document.getElementById(name)?.click();
  }
});
// A lost connection leaves a note with this id: as soon as there is a server again, begin anew at
// the same address.
setInterval(async () => {
  if (!document.getElementById("sw-lost")) return;
  try {
    const response = await fetch("alive", { cache: "no-store" });
    if (response.ok) window.location.reload();
    else document.getElementById("sw-lost-why").textContent = await response.text();
  } catch {}
}, 1500);
