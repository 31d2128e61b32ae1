// Functions of the page itself: its address, the point under a pointer, reloading after a loss.
const SLOWED = 100; // times that time is slowed down at least
const LEAST = 3000; // ms that a drawing of the path takes at least
const EVERY = 80; // ms between pictures
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
  play() {
    this.playing = !this.playing;
    const button = document.getElementById("play");
    button.textContent = this.playing ? "❚❚" : "▶";
    button.setAttribute("aria-pressed", String(this.playing));
    const { state, utils } = window.trame, plot = utils.plots.shown.waveform_plot;
    let last = performance.now(), told = 0;
    const next = (now) => {
      if (!this.playing || !button.isConnected) return void utils.plots.point(plot, null);
      const rate = state.get("drawing_frequency"), [from, to] = plot.zoom || plot.figure.x.range;
      this.time = (this.time ?? from) + (now - last) / Math.max(SLOWED, LEAST * rate / 1000);
      if (!(this.time >= from && this.time < to)) this.time = from;
      last = now;
      if (now - told > EVERY && !document.hidden) {
        told = now;
        utils.plots.point(plot, this.time);
        if (rate) state.set("phase", Math.floor(((this.time / 1000) * rate * 100) % 100));
        utils.body.show(this.time);
      }
      requestAnimationFrame(next);
    };
    requestAnimationFrame(next);
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
