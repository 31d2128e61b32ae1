// Functions of the page itself: its address, the point under a pointer, reloading after a loss.
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
