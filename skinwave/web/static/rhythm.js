// The rhythm as a timeline that is its own editor: pulses are blocks, their ends and the ends of
// the gaps after them are handles. The text of the control ("100/50, 40/110" in ms) stays what is
// said: it is read here, and written anew with every move.
(() => {
  const WIDE = 296, LOW = 44, HIGH = 10; // pixels: the whole, where the level is 0 and 1
  const MARGIN = 8, ROOM = 1.1; // pixels at both ends; how much longer the axis is than the pulses
  const FIRST = { on: 100, gap: 100 }; // ms of a pulse where there was none
  const LONGEST = 5000; // ms of a pulse or a gap that is drawn
  const OFTEN = 60; // ms between what is told of a handle that is being drawn
  const MOST = 200; // blocks

  const read = (text) => text.split(",").filter((part) => part.trim()).map((part) => {
    const [on, gap] = part.split("/").map(Number);
    return { on, gap };
  });
  const written = (pulses) => pulses.map(({ on, gap }) => `${on}/${gap}`).join(", ");
  const state = () => window.trame.state;
  const now = () => read(state().get("pulses") || "");
  const tell = (pulses) => state().set("pulses", written(pulses));
  const short = (ms) => `${Number(ms.toPrecision(6))}`;

  // The least of 1, 2, 5, 10 ... that is no less.
  function round(least) {
    const power = 10 ** Math.floor(Math.log10(least));
    return power * [1, 1.5, 2, 3, 5, 7.5, 10].find((step) => step * power >= least * (1 - 1e-9));
  }

  function block(x, start, on, ramp) {
    const rise = Math.min(ramp, on / 2);
    const corners = [[start, LOW], [start + rise, HIGH], [start + on - rise, HIGH], [start + on, LOW]];
    return corners.map(([t, y]) => `${x(t).toFixed(2)},${y}`).join(" ");
  }

  // All that is drawn of a rhythm, on an axis of `held` ms if that is not 0.
  function view(text, ramp, held) {
    const pulses = read(text || "");
    const period = pulses.reduce((sum, { on, gap }) => sum + on + gap, 0);
    const span = held || (period ? round(ROOM * period) : 400);
    const x = (t) => MARGIN + (Math.min(t, span) / span) * (WIDE - 2 * MARGIN);
    const blocks = [], ends = [];
    let start = 0;
    pulses.forEach(({ on, gap }, pulse) => {
      blocks.push({ pulse, own: true, points: block(x, start, on, ramp) });
      ends.push({ pulse, kind: "on", x: x(start + on), value: on, said: `${short(on)} ms`,
                  name: `Length of pulse ${pulse + 1}, ms` });
      ends.push({ pulse, kind: "gap", x: x(start + on + gap), value: gap, said: `${short(gap)} ms`,
                  name: `Gap after pulse ${pulse + 1}, ms` });
      start += on + gap;
    });
    for (let k = 0; pulses.length && start < span && k < MOST; k++) { // it is played again
      const { on, gap } = pulses[k % pulses.length];
      blocks.push({ pulse: -1, own: false, points: block(x, start, Math.min(on, span - start), 0) });
      start += on + gap;
    }
    const step = round(span / 5), ticks = [];
    for (let t = 0; t <= span * (1 + 1e-9); t += step) ticks.push({ x: x(t), said: short(t) });
    return { period, span, blocks, ends, ticks, end: x(period), longest: LONGEST };
  }

  const limited = (kind, ms) => Math.min(Math.max(Math.round(ms), kind === "on" ? 1 : 0), LONGEST);

  function put(pulse, kind, ms) {
    const pulses = now();
    if (!pulses[pulse]) return;
    pulses[pulse][kind] = limited(kind, ms);
    tell(pulses);
  }

  let drawn = null; // the handle that is being drawn

  function press(event, pulse, kind, span) {
    const handle = event.currentTarget, matrix = handle.ownerSVGElement.getScreenCTM();
    const perPixel = span / (WIDE - 2 * MARGIN) / matrix.a;
    handle.setPointerCapture(event.pointerId);
    handle.focus();
    event.preventDefault();
    drawn = { pulse, kind, from: event.clientX, before: now()[pulse][kind], perPixel, told: 0 };
    state().set("rhythm_span", span); // the axis stays while a handle is drawn along it
  }

  function move(event) {
    if (!drawn) return;
    drawn.to = drawn.before + (event.clientX - drawn.from) * drawn.perPixel;
    if (event.timeStamp - drawn.told < OFTEN) return;
    drawn.told = event.timeStamp;
    put(drawn.pulse, drawn.kind, drawn.to);
  }

  function release() {
    if (!drawn) return;
    if (drawn.to !== undefined) put(drawn.pulse, drawn.kind, drawn.to);
    drawn = null;
    state().set("rhythm_span", 0);
  }

  function key(event, pulse, kind) {
    const value = now()[pulse]?.[kind], step = event.shiftKey ? 10 : 1;
    const moved = { ArrowRight: step, ArrowUp: step, ArrowLeft: -step, ArrowDown: -step,
                    PageUp: 10, PageDown: -10, Home: -Infinity };
    if (event.key === "Delete" || event.key === "Backspace") remove(pulse);
    else if (event.key in moved) put(pulse, kind, value + moved[event.key]);
    else return;
    event.preventDefault();
  }

  function add() {
    const pulses = now();
    state().set("pulse", pulses.length);
    tell([...pulses, pulses.at(-1) || FIRST]);
  }

  // Without one of its pulses; the last if there is none of this number any more.
  function remove(pulse) {
    const pulses = now(), gone = Math.min(pulse, pulses.length - 1);
    state().set("pulse", Math.max(0, gone - 1));
    tell(pulses.filter((_, k) => k !== gone));
  }

  window.trame.utils.rhythm = { view, press, move, release, key, add, remove };
})();
