// A body in three dimensions, moving: WebGL 2, in the live page and in reports.

import { locate, prepare, shade } from "./mesh3d.js";
import { dots, rmsOf, strongLines, synthesise } from "./motion3d.js";
import { largestOf } from "./numeric.js";
import { SEQUENTIAL, SIGNED, TABLE_LENGTH } from "./palette.js";
import { SLOWER, element, gradient, panel } from "./panel3d.js";
import { withUnit } from "./text.js";

const SURFACE_VERTEX = `#version 300 es
  in vec3 place; in vec2 state; in vec3 normal; // state: lift in mm, place on the scale of colours
  uniform mat3 turn; uniform vec3 middle; uniform vec3 size;
  out float value, along; out vec3 facing;
  void main() {
    vec3 at = turn * (place + vec3(0.0, 0.0, state.x) - middle);
    value = state.y; along = place.y; facing = turn * normal;
    gl_Position = vec4(at.xy * size.xy, -at.z * size.z, 1.0);
  }`;
const SURFACE_FRAGMENT = `#version 300 es
  precision highp float;
  in float value, along; in vec3 facing;
  uniform sampler2D colours; uniform float cut; uniform bool closed; out vec4 colour;
  void main() {
    if (along < cut) discard;
    if (closed && !gl_FrontFacing) { colour = vec4(0.62, 0.55, 0.50, 1.0); return; } // the section
    vec3 way = normalize(gl_FrontFacing ? facing : -facing);
    float light = 0.36 + 0.72 * max(0.0, dot(way, normalize(vec3(-0.55, 0.5, 0.67))));
    colour = vec4(texture(colours, vec2(clamp(value, 0.002, 0.998), 0.5)).rgb * light, 1.0);
  }`;
const MARK_VERTEX = `#version 300 es
  in vec3 place; uniform mat3 turn; uniform vec3 middle; uniform vec3 size;
  uniform float width, lead; // lead: mm nearer than the surface, which would hide a half of each mark
  out float along;
  void main() {
    vec3 at = turn * (place - middle);
    along = place.y;
    gl_Position = vec4(at.xy * size.xy, -(at.z + lead) * size.z, 1.0);
    gl_PointSize = width;
  }`;
const MARK_FRAGMENT = `#version 300 es
  precision highp float;
  in float along; uniform vec3 ink; uniform float cut; uniform float edge; out vec4 colour;
  void main() {
    float r = 2.0 * length(gl_PointCoord - 0.5);
    if (r > 1.0 || along < cut) discard;
    colour = vec4(r > edge ? vec3(1.0) : ink, 1.0);
  }`;
const HOME = { turned: -0.5, tipped: 0.95, near: 1, moved: [0, 0] };
const DRAWN = 0.06; // of the width: how far the largest motion is drawn at most
const CREST = 2; // times the largest RMS: where colours end
const LOOP = 0.1; // s that are repeated, or a period of the slowest line
const SHOWN_RATE = 0.7; // Hz at which the strongest line is seen at first
const BARS = [1, 2, 5, 10, 20, 50, 100]; // mm
const NO_WEBGL = "This browser does not draw in three dimensions: WebGL 2 is off or missing. "
  + "The map shows the same motion from above.";

class View {
  constructor(container, options) {
    const playing = !matchMedia("(prefers-reduced-motion: reduce)").matches;
    Object.assign(this, { options, playing, time: 0, slower: 0, hue: "motion", cut: 0, relief: 1 });
    this.view = { ...HOME, moved: [0, 0] };
    Object.assign(this, panel(container));
    this.gl = this.canvas.getContext("webgl2", { antialias: true });
    if (!this.gl) {
      container.replaceChildren(element("p", { role: "note" }, NO_WEBGL));
      return;
    }
    this.begin();
    this.listen();
  }

  begin() {
    const { gl } = this, made = (vertex, fragment) => {
      const program = gl.createProgram();
      for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
        const shader = gl.createShader(kind);
        gl.shaderSource(shader, source);
        gl.compileShader(shader);
        gl.attachShader(program, shader);
      }
      ["place", "state", "normal"].forEach((name, k) => gl.bindAttribLocation(program, k, name));
      gl.linkProgram(program);
      const count = gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS), at = {};
      for (let k = 0; k < count; k++) {
        const { name } = gl.getActiveUniform(program, k);
        at[name] = gl.getUniformLocation(program, name);
      }
      return { program, at };
    };
    this.surface = made(SURFACE_VERTEX, SURFACE_FRAGMENT);
    this.marks = made(MARK_VERTEX, MARK_FRAGMENT);
    this.buffers = {};
    for (const name of ["places", "state", "triangles", "marks"]) this.buffers[name] = gl.createBuffer();
    gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
    const looks = { MIN_FILTER: gl.LINEAR, WRAP_S: gl.CLAMP_TO_EDGE, WRAP_T: gl.CLAMP_TO_EDGE };
    for (const [key, value] of Object.entries(looks)) {
      gl.texParameteri(gl.TEXTURE_2D, gl[`TEXTURE_${key}`], value);
    }
    gl.enable(gl.DEPTH_TEST);
    this.send();
  }

  /** Send what stays the same from frame to frame. */
  send() {
    const { gl, mesh, buffers } = this, table = this.table(), kind = [gl.RGBA, gl.UNSIGNED_BYTE];
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, TABLE_LENGTH, 1, 0, ...kind, new Uint8Array(table));
    this.colours.style.background = `linear-gradient(90deg, ${gradient(table)})`;
    if (!mesh) return;
    gl.bindBuffer(gl.ARRAY_BUFFER, buffers.places);
    gl.bufferData(gl.ARRAY_BUFFER, mesh.places, gl.STATIC_DRAW);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, buffers.triangles);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, mesh.triangles, gl.STATIC_DRAW);
  }

  table() { return this.hue === "motion" ? SIGNED : SEQUENTIAL; }

  /**
   * Show a body and its motion.
   * @param {object} given shape: points in mm and triangles; motion: f (l,) in Hz, re and im (l * n) in
   *   metre upwards; path: paths of points [x, y] in metre; foci: places [x, y] in metre as a
   *   function of the time in s, or a list of them for equal parts of the period; points: places [x, y]
   *   to mark; period: s, of the loop; unit: "Pa" of a pressure, less of which is upwards
   */
  show(given) {
    if (!this.gl) return;
    const isNew = given.shape !== this.given?.shape;
    this.given = given;
    if (isNew) {
      this.mesh = prepare(given.shape);
      this.moved = Float32Array.from(this.mesh.places);
      this.state = new Float32Array(5 * this.mesh.source.length);
    }
    this.measure();
    if (isNew) {
      this.send();
      this.fit();
    }
    const here = ([x, y]) => locate(this.mesh, x, y);
    this.riders = { path: dots(given.path || []).map(here).filter(Boolean),
      points: (given.points || []).map(([x, y]) => here([1e3 * x, 1e3 * y])).filter(Boolean) };
    this.say();
    this.draw();
    this.run();
  }

  /** What is the same at all times: lines, RMS, the end of the colours, exaggeration, and the loop. */
  measure() {
    const { motion, period } = this.given, strong = strongLines(motion), rms = rmsOf(strong, motion);
    const most = largestOf(rms), width = this.mesh.high[0] - this.mesh.low[0];
    const loudest = strong.lines.reduce((a, b) => (b.largest > a.largest ? b : a), { f: 100, largest: 0 });
    if (!this.slower) {
      const off = (slower) => Math.abs(Math.log(slower * SHOWN_RATE / loudest.f));
      this.slower = SLOWER.reduce((a, b) => (off(b) < off(a) ? b : a));
      this.slow.value = this.slower;
    }
    Object.assign(this, { strong, rms, u: new Float32Array(strong.n), most, largest: CREST * most || 1,
      factor: most ? 1e-3 * DRAWN * width / (CREST * most) : 0,
      loop: period || Math.max(LOOP, 1 / Math.min(...strong.lines.map(({ f }) => f))) });
    this.time %= this.loop;
  }

  get drawnTimes() { return Number((this.factor * this.relief).toPrecision(1)); }

  say() {
    const { unit = "m" } = this.given, end = withUnit(this.largest, unit);
    const drawn = `Exaggerated ${this.drawnTimes.toLocaleString("en")} times, mean removed.`;
    this.said.textContent = unit === "Pa" ? "A relief of the pressure; nothing moves." : drawn;
    if (!this.most) this.said.textContent = "Nothing moves.";
    let words = unit === "Pa" ? [`≥ ${end} less`, "mean pressure", `≥ ${end} more`]
      : [`≥ ${end} out of the body`, "0", `≥ ${end} into the body`];
    if (this.hue === "rms") words = ["0", "RMS", withUnit(this.most, unit)];
    this.ends.title = "≥: rare larger values have the last colour";
    this.ends.replaceChildren(...words.map((text) => element("span", {}, text)));
  }

  /** Scale, in pixels per mm at the first view, so that the body fills the canvas. */
  fit() {
    const { low, high } = this.mesh, turn = this.turn(HOME), reach = [0, 0];
    this.middle = low.map((v, k) => (v + high[k]) / 2);
    for (let k = 0; k < 8; k++) {
      const corner = low.map((v, axis) => ((k >> axis) & 1 ? high[axis] : v) - this.middle[axis]);
      for (const row of [0, 1]) {
        const at = corner.reduce((sum, v, axis) => sum + v * turn[3 * axis + row], 0);
        reach[row] = Math.max(reach[row], Math.abs(at));
      }
    }
    this.reach = reach;
    this.deep = Math.hypot(...high.map((v, k) => v - low[k]));
  }

  turn({ turned, tipped }) {
    const [c, s, d, e] = [Math.cos(turned), Math.sin(turned), Math.cos(tipped), Math.sin(tipped)];
    return [c, s * d, -s * e, -s, c * d, -c * e, 0, e, d];
  }

  /** Move the points to a time, and colour them. */
  place() {
    const { mesh, state, moved, u, hue, rms, given } = this, { source, places } = mesh, n = u.length;
    synthesise(this.strong, given.motion, this.time, u);
    const scale = 1e3 * this.drawnTimes;
    for (let p = 0; p < source.length; p++) {
      const k = source[p], lift = k < n ? u[k] : 0;
      state[5 * p] = scale * lift;
      moved[3 * p + 2] = places[3 * p + 2] + scale * lift;
      if (hue === "motion") state[5 * p + 1] = 0.5 - lift / (2 * this.largest);
      else state[5 * p + 1] = k < n ? rms[k] / (this.most || 1) : 0;
    }
    shade(mesh, moved, state);
  }

  draw() {
    const { gl, canvas, mesh } = this, [wide, tall] = [canvas.clientWidth, canvas.clientHeight];
    if (!mesh || !wide || !tall || gl.isContextLost()) return;
    const ratio = window.devicePixelRatio || 1;
    const [width, height] = [wide, tall].map((length) => Math.round(ratio * length));
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    gl.viewport(0, 0, width, height);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    this.place();
    const { view, buffers } = this, turn = this.turn(view), room = 0.88;
    this.scale = room * view.near * Math.min(wide / 2 / this.reach[0], (tall - 24) / 2 / this.reach[1]);
    const size = [2 * this.scale / wide, 2 * this.scale / tall, 0.9 / this.deep];
    // Moving the view moves what is in its middle.
    const middle = this.middle.map((v, axis) => v - turn[3 * axis] * view.moved[0]
      - turn[3 * axis + 1] * view.moved[1]);
    const cut = mesh.low[1] - 1 + (this.cut && 1 + this.cut * (mesh.high[1] - mesh.low[1]));
    const common = ({ program, at }) => {
      gl.useProgram(program);
      gl.uniformMatrix3fv(at.turn, false, turn);
      gl.uniform3fv(at.middle, middle);
      gl.uniform3fv(at.size, size);
      gl.uniform1f(at.cut, cut);
    };
    common(this.surface);
    gl.uniform1i(this.surface.at.closed, mesh.isClosed);
    gl.bindBuffer(gl.ARRAY_BUFFER, buffers.places);
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
    gl.bindBuffer(gl.ARRAY_BUFFER, buffers.state);
    gl.bufferData(gl.ARRAY_BUFFER, this.state, gl.DYNAMIC_DRAW);
    gl.vertexAttribPointer(1, 2, gl.FLOAT, false, 20, 0);
    gl.vertexAttribPointer(2, 3, gl.FLOAT, false, 20, 8);
    for (const k of [0, 1, 2]) gl.enableVertexAttribArray(k);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, buffers.triangles);
    gl.drawElements(gl.TRIANGLES, mesh.triangles.length, gl.UNSIGNED_INT, 0);
    gl.disableVertexAttribArray(1);
    gl.disableVertexAttribArray(2);
    common(this.marks);
    const foci = this.foci().map(([x, y]) => locate(mesh, 1e3 * x, 1e3 * y)).filter(Boolean);
    this.drawMarks(this.riders.path, 2.6 * ratio, [0.05, 0.05, 0.05], 2);
    if (view.tipped < Math.PI / 2) gl.disable(gl.DEPTH_TEST); // seen in the hollows that they make
    this.drawMarks(this.riders.points, 11 * ratio, [0.84, 0.37, 0], 0.72);
    this.drawMarks(foci, 13 * ratio, [0.05, 0.05, 0.05], 0.75);
    gl.enable(gl.DEPTH_TEST);
    this.drawOver(wide, tall, turn);
    this.slider.value = 1000 * (this.time / this.loop);
    this.now.textContent = `${(1e3 * this.time).toFixed(2)} ms`;
    this.slider.setAttribute("aria-valuetext", this.now.textContent);
    canvas.dataset.time = this.time;
  }

  foci() {
    const { foci = [] } = this.given;
    if (typeof foci === "function") return foci(this.time);
    return foci.length ? foci[Math.floor(this.time / this.loop * foci.length) % foci.length] : [];
  }

  /** Round marks of a width in pixels where riders are on the moved surface. */
  drawMarks(riders, width, ink, edge) {
    if (!riders.length) return;
    const { gl, moved, marks, buffers } = this, values = new Float32Array(3 * riders.length);
    riders.forEach(({ corners, weights, x, y }, k) => {
      values.set([x, y, corners.reduce((sum, c, j) => sum + weights[j] * moved[3 * c + 2], 0.1)], 3 * k);
    });
    gl.bindBuffer(gl.ARRAY_BUFFER, buffers.marks);
    gl.bufferData(gl.ARRAY_BUFFER, values, gl.DYNAMIC_DRAW);
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
    gl.uniform1f(marks.at.width, width);
    gl.uniform1f(marks.at.lead, 0.3 + width / this.scale);
    gl.uniform3fv(marks.at.ink, ink);
    gl.uniform1f(marks.at.edge, edge);
    gl.drawArrays(gl.POINTS, 0, riders.length);
  }

  /** The scale bar and the axes, over the picture. */
  drawOver(wide, tall, turn) {
    const bar = [...BARS].reverse().find((length) => length * this.scale < 0.3 * wide) || BARS[0];
    const y = tall - 8, length = bar * this.scale, [u, v] = [wide - 34, tall - 34];
    const lines = [`M10,${y - 4}v8m0,-4h${length}m0,-4v8`], texts = [[10 + length / 2, y - 6, `${bar} mm`]];
    ["x", "y", "z"].forEach((name, axis) => {
      const across = 22 * turn[3 * axis], up = 22 * turn[3 * axis + 1];
      if (Math.hypot(across, up) < 5) return; // seen end on
      lines.push(`M${u},${v}l${across},${-up}`);
      texts.push([u + 1.35 * across, v - 1.35 * up + 4, name]);
    });
    this.over.innerHTML = `<path d="${lines.join("")}" fill="none" stroke="currentColor" stroke-width="1.5"/>`
      + texts.map(([x, at, words]) => `<text x="${x}" y="${at}" text-anchor="middle" font-size="11"`
        + ` fill="currentColor">${words}</text>`).join("");
  }

  /** Play from frame to frame as long as anybody sees it. */
  run() {
    this.play.textContent = this.playing ? "❚❚ Pause" : "▶ Play";
    if (!this.playing || this.frame || !this.mesh) return;
    let last = null;
    const next = (now) => {
      this.frame = null;
      if (!this.playing || !this.canvas.isConnected || !this.canvas.clientWidth) return;
      const passed = last === null ? 0 : Math.min(now - last, 100) / 1e3;
      last = now;
      this.time = (this.time + passed / this.slower) % this.loop;
      this.draw();
      this.options.onTime?.(this.time);
      this.frame = requestAnimationFrame(next);
    };
    this.frame = requestAnimationFrame(next);
  }

  listen() {
    const { canvas, view } = this, pointers = new Map();
    const turnBy = (x, y) => {
      view.turned += 0.01 * x;
      view.tipped = Math.min(Math.PI, Math.max(0, view.tipped - 0.01 * y));
      this.draw();
    };
    const moveBy = (x, y) => {
      view.moved = [view.moved[0] + x / this.scale, view.moved[1] - y / this.scale];
      this.draw();
    };
    const nearer = (factor) => {
      view.near = Math.min(12, Math.max(0.4, view.near * factor));
      this.draw();
    };
    const toggle = () => { this.playing = !this.playing; this.run(); };
    const look = (changes) => { Object.assign(view, HOME, { moved: [0, 0] }, changes); this.draw(); };
    const apart = () => {
      const [a, b] = [...pointers.values()];
      return Math.hypot(a[0] - b[0], a[1] - b[1]);
    };
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      pointers.set(event.pointerId, [event.clientX, event.clientY]);
    });
    canvas.addEventListener("pointermove", (event) => {
      const before = pointers.get(event.pointerId);
      if (!before) return;
      const was = pointers.size === 2 && apart(), by = [event.clientX - before[0], event.clientY - before[1]];
      pointers.set(event.pointerId, [event.clientX, event.clientY]);
      if (was) {
        nearer(apart() / was);
        moveBy(by[0] / 2, by[1] / 2);
      } else if (event.shiftKey) moveBy(...by);
      else turnBy(...by);
    });
    for (const name of ["pointerup", "pointercancel"]) {
      canvas.addEventListener(name, (event) => pointers.delete(event.pointerId));
    }
    canvas.addEventListener("wheel", (event) => {
      if (this.options.wheel === "focused" && document.activeElement !== canvas && !event.ctrlKey) return;
      event.preventDefault();
      nearer(Math.exp(-0.0015 * event.deltaY));
    }, { passive: false });
    const turns = { ArrowLeft: [-15, 0], ArrowRight: [15, 0], ArrowUp: [0, -15], ArrowDown: [0, 15] };
    canvas.addEventListener("keydown", (event) => {
      if (event.ctrlKey || event.metaKey || event.altKey) return;
      if (turns[event.key]) (event.shiftKey ? moveBy : turnBy)(...turns[event.key]);
      else if (event.key === "+" || event.key === "=") nearer(1.15);
      else if (event.key === "-") nearer(1 / 1.15);
      else if (event.key === " ") toggle();
      else if (event.key === "Home") look({});
      else return;
      event.preventDefault();
    });
    const changed = () => { this.send(); this.say(); this.draw(); };
    this.play.onclick = toggle;
    this.home.onclick = () => look({});
    this.above.onclick = () => look({ turned: 0, tipped: 0 });
    this.slow.onchange = () => { this.slower = Number(this.slow.value); };
    this.hues.onchange = () => { this.hue = this.hues.value; changed(); };
    this.high.onchange = () => { this.relief = Number(this.high.value); changed(); };
    this.cutter.oninput = () => { this.cut = this.cutter.value / 100; this.draw(); };
    this.slider.oninput = () => {
      this.playing = false;
      this.seek(this.slider.value / 1000 * this.loop);
      this.run();
    };
    canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
    canvas.addEventListener("webglcontextrestored", () => { this.begin(); this.draw(); });
    canvas.asSvg = () => `<image href="${this.png()}" width="${canvas.clientWidth}" height="${
      canvas.clientHeight}"/>${this.over.innerHTML}`;
    new ResizeObserver(() => { this.draw(); this.run(); }).observe(canvas);
  }

  /** Show a time in s. */
  seek(time) {
    if (!this.loop) return;
    this.time = time % this.loop;
    this.draw();
    this.options.onTime?.(this.time);
  }

  /** The picture as a PNG, a data URL. */
  png() {
    this.draw();
    return this.canvas.toDataURL();
  }
}

/**
 * Open a view in an element, which gives it its size; `show` fills it.
 * @param {HTMLElement} container
 * @param {object} options onTime: called with the time in s as it changes; wheel: "focused" if the wheel
 *   zooms only while the view has the focus
 */
export function openView(container, options = {}) {
  return new View(container, options);
}
