// Menus to save figures, data and device files, and the waveform as sound.

import { asSound } from "./files.js";
import { figureOf, pngOf } from "./plots.js";

const RATE = 8000; // Hz of the sound
const LONGEST_SOUND = 3; // s
const FADE = 0.01; // s
let playing = null;

function download(name, content, type) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(content instanceof Blob ? content : new Blob([content], { type }));
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1e4);
}

/** The parts of the page that make its figure, as they are shown. */
const seen = () => [...document.querySelectorAll(
  "#tiles .tile > span, .map, #solid canvas, .plot-card h2, .plot, #pane .plot")];

const figure = () => figureOf(seen(), getComputedStyle(document.documentElement).getPropertyValue("--card"));

/**
 * Fill the menu of saves. `answer()` is what is shown, `writers` texts of files by kind:
 * [[heading, [[title, name, type, (answer) => text or bytes]]]].
 */
export function offerSaves(menu, { answer, say, writers }) {
  const own = ["Figure", [
    ["Maps and plots, SVG", "skinwave.svg", "image/svg+xml", () => figure().text],
    ["Maps and plots, PNG", "skinwave.png", "image/png", () => pngOf(figure())],
    ["Print or PDF", null, null, () => print()],
  ]];
  const groups = [own, ...writers], items = groups.flatMap(([, each]) => each);
  const button = (item) => `<button type="button" data-save="${items.indexOf(item)}">${item[0]}</button>`;
  menu.innerHTML = groups.map(([heading, each]) => `<h2>${heading}</h2>${each.map(button).join("")}`).join("");
  menu.addEventListener("click", async ({ target }) => {
    const item = items[target.dataset?.save];
    if (!item) return;
    const [title, name, type, write] = item;
    try {
      const content = await write(answer());
      if (!name) return;
      download(name, content, type);
      say(`${name} is saved.`);
    } catch (error) { say(`${title}: ${error.message}`); }
  });
}

/** Play the waveform at the point, or stop; `button` shows which. */
export function playSound({ waves, x, y, load }, button) {
  const end = () => { playing = null; button.setAttribute("aria-pressed", "false"); };
  if (playing) { playing.close(); end(); return; }
  const context = playing = new AudioContext();
  const count = Math.ceil(RATE * Math.min(load.duration, LONGEST_SOUND));
  const sound = asSound(waves.waveform(x, y, Float64Array.from({ length: count }, (_, k) => k / RATE)));
  const buffer = context.createBuffer(1, count, RATE), samples = buffer.getChannelData(0);
  for (let k = 0; k < count; k++) {
    samples[k] = 0.6 * sound[k] * Math.min(1, k / RATE / FADE, (count - k) / RATE / FADE);
  }
  const source = context.createBufferSource();
  source.buffer = buffer;
  source.connect(context.destination);
  source.onended = () => { if (playing === context) { context.close(); end(); } };
  source.start();
  button.setAttribute("aria-pressed", "true");
}
