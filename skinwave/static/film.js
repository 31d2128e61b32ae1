// A film of maps, recorded in real time by the browser.

import { canvasOf, drawFrame } from "./maps.js";

const SIDE = 440, GAP = 20, HEAD = 30, FOOT = 34, RATE = 30; // px; frames per second
const NO_RECORDER = "This browser cannot record films. Use skinwave report, which writes one.";

/**
 * Record maps side by side for some seconds as a WebM blob. `mapsAt(share)` gives the options of `drawMap` at
 * a share, 0 to 1, of the film; `caption(share)` a text below. Throws an Error with a sentence for users.
 */
export async function filmOf(mapsAt, caption, seconds) {
  if (!window.MediaRecorder?.isTypeSupported("video/webm")) throw new Error(NO_RECORDER);
  const canvas = canvasOf(2 * SIDE + 3 * GAP, HEAD + SIDE + FOOT), context = canvas.getContext("2d");
  const frame = (share) => {
    context.fillStyle = "#fff";
    context.fillRect(0, 0, canvas.width, canvas.height);
    mapsAt(share).forEach((options, k) => {
      drawFrame(context, { x: GAP + k * (SIDE + GAP), y: HEAD, side: SIDE }, options);
    });
    context.fillText(caption(share), GAP, HEAD + SIDE + 23);
  };
  frame(0);
  const recorder = new MediaRecorder(canvas.captureStream(RATE), { mimeType: "video/webm" }), parts = [];
  recorder.ondataavailable = ({ data }) => parts.push(data);
  const stopped = new Promise((resolve) => { recorder.onstop = resolve; });
  recorder.start();
  const start = performance.now();
  for (let share = 0; share < 1; share = (performance.now() - start) / 1e3 / seconds) {
    frame(share);
    await new Promise((resolve) => setTimeout(resolve, 1e3 / RATE));
  }
  recorder.stop();
  await stopped;
  return new Blob(parts, { type: "video/webm" });
}
