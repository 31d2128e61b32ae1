// A moving body in three dimensions, drawn by WebGL 2 in the live page and in reports.

import { SIGNED, TABLE_LENGTH } from "./palette.js";
import { bounds, dots, locate, shade, strongLines, synthesise } from "./surface3d.js";
import { withUnit } from "./text.js";

const VERTEX = `#version 300 es
  in vec3 place; in vec2 state; in vec3 normal; // state: lift in mm, place on the colour scale
  uniform mat3 turn; uniform vec3 middle; uniform vec3 size;
  out float value; out vec3 facing, at;
  void main() {
    at = turn * (place + vec3(0.0, 0.0, state.x) - middle);
    value = state.y; facing = turn * normal;
    gl_Position = vec4(at.xy * size.xy, -at.z * size.z, 1.0);
  }`;
const FRAGMENT = `#version 300 es
  precision highp float;
  in float value; in vec3 facing, at;
  uniform sampler2D colours; out vec4 colour;
  void main() {
    vec3 flat_way = normalize(cross(dFdx(at), dFdy(at)));
    vec3 way = normalize(dot(facing, flat_way) < 0.0 ? -facing : facing);
    if (!(dot(way, flat_way) > 0.55)) way = flat_way; // beyond a sharp edge
    float light = 0.36 + 0.72 * max(0.0, dot(way, normalize(vec3(-0.55, 0.5, 0.67))));
    colour = vec4(texture(colours, vec2(clamp(value, 0.002, 0.998), 0.5)).rgb * light, 1.0);
  }`;
const HOME = { turned: -0.5, tipped: 0.95, near: 1 };
const LARGEST_LIFT = 0.06; // of the width: drawn size of the largest motion
const LOOP = 0.1; // s that are repeated at least
const SLOWER = [10, 30, 100, 300, 1000], FIRST_RATE = 0.7; // Hz at which the strongest line moves at first
const BARS = [1, 2, 5, 10, 20, 50, 100]; // mm
const NO_WEBGL = "This browser has no WebGL 2, which pictures in three dimensions need. "
  + "The map shows the same motion from above.";
const PANEL = `<div class="view3d">
  <div class="stage"><canvas data-part="canvas" tabindex="0" role="application" aria-label="Moving body.
    Arrow keys turn it, plus and minus zoom, Home resets the view, space plays and pauses."></canvas>
    <svg data-part="over" aria-hidden="true"></svg></div>
  <div class="colours" data-part="colours" aria-hidden="true"></div><div class="ends" data-part="ends"
    title="≥: larger values have the last colour"></div>
  <div class="row"><button type="button" data-part="play"></button>
    <input type="range" class="time" max="1000" value="0" data-part="slider" aria-label="Time">
    <output data-part="now"></output>
    <select data-part="slow" aria-label="Slow motion">${SLOWER.map((times) => (
    `<option value="${times}">${times} × slower</option>`)).join("")}</select>
    <button type="button" data-part="above" title="Look from above">Above</button>
    <button type="button" data-part="home" title="Reset the view">Reset</button></div>
  <div data-part="caption"></div></div>`;

/** CSS gradient of a table of colours. */
const gradient = (table) => Array.from({ length: 17 }, (_, k) => {
  const at = 4 * Math.round(k / 16 * (TABLE_LENGTH - 1));
  return `rgb(${table[at]},${table[at + 1]},${table[at + 2]})`;
}).join(",");

class View {
  constructor(container, options) {
    const playing = !options.follows && !matchMedia("(prefers-reduced-motion: reduce)").matches;
    Object.assign(this, { options, playing, time: 0, slower: 0, view: { ...HOME } });
    container.innerHTML = PANEL;
    container.firstElementChild.classList.toggle("follows", Boolean(options.follows));
    for (const part of container.querySelectorAll("[data-part]")) this[part.dataset.part] = part;
    this.gl = this.canvas.getContext("webgl2", { antialias: true });
    if (!this.gl) {
      container.textContent = NO_WEBGL;
      return;
    }
    this.begin();
    this.listen();
  }

  begin() {
    const { gl } = this, program = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    ["place", "state", "normal"].forEach((name, k) => {
      gl.bindAttribLocation(program, k, name);
      gl.enableVertexAttribArray(k);
    });
    gl.linkProgram(program);
    gl.useProgram(program);
    const names = ["turn", "middle", "size"];
    this.uniforms = Object.fromEntries(names.map((name) => [name, gl.getUniformLocation(program, name)]));
    this.buffers = { places: gl.createBuffer(), state: gl.createBuffer() };
    const { places, state } = this.buffers;
    [[places, 3, 0, 0], [state, 2, 20, 0], [state, 3, 20, 8]].forEach(([buffer, size, stride, offset], k) => {
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      gl.vertexAttribPointer(k, size, gl.FLOAT, false, stride, offset);
    });
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
    const looks = { MIN_FILTER: gl.LINEAR, WRAP_S: gl.CLAMP_TO_EDGE, WRAP_T: gl.CLAMP_TO_EDGE };
    for (const [key, value] of Object.entries(looks)) {
      gl.texParameteri(gl.TEXTURE_2D, gl[`TEXTURE_${key}`], value);
    }
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, TABLE_LENGTH, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE,
      new Uint8Array(SIGNED));
    this.colours.style.background = `linear-gradient(90deg, ${gradient(SIGNED)})`;
    gl.enable(gl.DEPTH_TEST);
  }

  /**
   * Show a body and its motion.
   * @param {object} scene shape: points in mm and triangles; motion: f (l,) in Hz, re and im (l * n) in
   *   metre upwards; path: paths of points [x, y] in metre; foci: places [x, y] in metre, as a function of
   *   the time in s or a list for equal parts of the period; points: places [x, y] in metre to mark;
   *   period: s of the loop; unit: "Pa" for a pressure, with less pressure drawn upwards
   */
  show(scene) {
    const { gl } = this;
    if (!gl) return;
    const { places, state } = this.buffers;
    const isNew = scene.shape !== this.scene?.shape;
    this.scene = scene;
    if (isNew) {
      this.mesh = { ...scene.shape, ...bounds(scene.shape) };
      this.moved = Float32Array.from(scene.shape.points);
      this.state = new Float32Array(5 * this.moved.length / 3);
      gl.bindBuffer(gl.ARRAY_BUFFER, places);
      gl.bufferData(gl.ARRAY_BUFFER, this.mesh.points, gl.STATIC_DRAW);
      gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, this.mesh.triangles, gl.STATIC_DRAW);
      gl.bindBuffer(gl.ARRAY_BUFFER, state); // which stays bound for each frame
      this.fit();
    }
    this.measure();
    const here = ([x, y]) => locate(this.mesh, x, y);
    this.marks = { paths: (scene.path || []).map((each) => dots(each).map(here).filter(Boolean)),
      points: (scene.points || []).map(([x, y]) => here([1e3 * x, 1e3 * y])).filter(Boolean) };
    this.describe();
    this.draw();
    this.run();
  }

  /** Compute what is the same at all times: lines, end of the colours, exaggeration and loop. */
  measure() {
    const { motion, period } = this.scene, strong = strongLines(motion);
    const width = this.mesh.high[0] - this.mesh.low[0];
    const loudest = strong.lines.reduce((a, b) => (b.largest > a.largest ? b : a), { f: 100, largest: 0 });
    if (!this.slower) {
      const off = (slower) => Math.abs(Math.log(slower * FIRST_RATE / loudest.f));
      this.slower = SLOWER.reduce((a, b) => (off(b) < off(a) ? b : a));
      this.slow.value = this.slower;
    }
    const { crest } = strong, exact = 1e-3 * LARGEST_LIFT * width / crest;
    const factor = crest && !this.options.follows ? Number(exact.toPrecision(1)) : 0;
    Object.assign(this, { strong, factor, largest: crest || 1, u: new Float32Array(strong.n),
      loop: period || Math.max(LOOP, 1 / Math.min(...strong.lines.map(({ f }) => f))) });
    this.time %= this.loop;
  }

  /** Write the caption and the ends of the colour scale. */
  describe() {
    const { unit = "m" } = this.scene, end = withUnit(this.largest, unit);
    const exaggerated = `Exaggerated ${this.factor.toLocaleString("en")} times, mean removed.`;
    const ofPressure = `${this.factor ? "Relief of the pressure" : "Pressure"}. The kernel does not move.`;
    this.caption.textContent = unit === "Pa" ? ofPressure : this.factor ? exaggerated : "Nothing moves.";
    const words = unit === "Pa" ? [`≥ ${end} less`, "mean pressure", `≥ ${end} more`]
      : [`≥ ${end} out of the body`, "0", `≥ ${end} into the body`];
    this.ends.innerHTML = words.map((text) => `<span>${text}</span>`).join("");
  }

  /** Compute middle and extent of the body in the first view, which fills the canvas. */
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
    const { mesh, state, moved, u, scene, factor } = this;
    synthesise(this.strong, scene.motion, this.time, u);
    for (let p = 0; 3 * p < moved.length; p++) {
      const lift = u[p] || 0;
      state[5 * p] = 1e3 * factor * lift;
      moved[3 * p + 2] = mesh.points[3 * p + 2] + state[5 * p];
      state[5 * p + 1] = 0.5 - lift / (2 * this.largest);
    }
    shade(mesh, moved, state);
  }

  draw() {
    const { gl, canvas, mesh } = this, [wide, tall] = [canvas.clientWidth, canvas.clientHeight];
    if (!mesh || !wide || !tall) return;
    const ratio = window.devicePixelRatio || 1;
    const [width, height] = [wide, tall].map((length) => Math.round(ratio * length));
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    gl.viewport(0, 0, width, height);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    this.place();
    const { view } = this, turn = this.turn(view), room = 0.88;
    this.scale = room * view.near * Math.min(wide / 2 / this.reach[0], (tall - 24) / 2 / this.reach[1]);
    const size = [2 * this.scale / wide, 2 * this.scale / tall, 0.9 / this.deep];
    gl.uniformMatrix3fv(this.uniforms.turn, false, turn);
    gl.uniform3fv(this.uniforms.middle, this.middle);
    gl.uniform3fv(this.uniforms.size, size);
    gl.bufferData(gl.ARRAY_BUFFER, this.state, gl.DYNAMIC_DRAW);
    gl.drawElements(gl.TRIANGLES, mesh.triangles.length, gl.UNSIGNED_INT, 0);
    const marks = view.tipped < Math.PI / 2 ? this.drawMarks(wide, tall, turn) : ""; // on the upper side
    this.over.innerHTML = marks + this.drawScale(wide, tall, turn);
    this.slider.value = 1000 * (this.time / this.loop);
    this.now.textContent = `${(1e3 * this.time).toFixed(2)} ms`;
    this.slider.setAttribute("aria-valuetext", this.now.textContent);
    canvas.dataset.time = this.time;
  }

  foci() {
    const { foci = [] } = this.scene;
    if (typeof foci === "function") return foci(this.time);
    return foci.length ? foci[Math.floor(this.time / this.loop * foci.length) % foci.length] : [];
  }

  /** Markup of paths, points and foci on the moved surface. */
  drawMarks(wide, tall, turn) {
    const project = ({ corners, weights, x, y }) => {
      const z = corners.reduce((sum, c, j) => sum + weights[j] * this.moved[3 * c + 2], 0);
      const at = [x, y, z].map((v, axis) => v - this.middle[axis]);
      const along = (row) => this.scale * at.reduce((sum, v, axis) => sum + v * turn[3 * axis + row], 0);
      return [wide / 2 + along(0), tall / 2 - along(1)].map((v) => v.toFixed(1));
    };
    const circle = (colour, radius) => (mark) => {
      const [x, y] = project(mark);
      return `<circle cx="${x}" cy="${y}" r="${radius}" fill="${colour}" stroke="#fff" stroke-width="1.5"/>`;
    };
    const foci = this.foci().map(([x, y]) => locate(this.mesh, 1e3 * x, 1e3 * y)).filter(Boolean);
    const paths = this.marks.paths.filter((each) => each.length).map((each) => (
      `<path d="M${each.map(project).join("L")}" fill="none" stroke="#111" stroke-width="2"/>`));
    const points = this.marks.points.map(circle("#d55e00", 5));
    return [...paths, ...points, ...foci.map(circle("#111", 6))].join("");
  }

  /** Markup of the scale bar and the axes. */
  drawScale(wide, tall, turn) {
    const bar = [...BARS].reverse().find((length) => length * this.scale < 0.3 * wide) || BARS[0];
    const y = tall - 8, length = bar * this.scale, [u, v] = [wide - 34, tall - 34];
    const lines = [`M10,${y - 4}v8m0,-4h${length}m0,-4v8`], texts = [[10 + length / 2, y - 6, `${bar} mm`]];
    ["x", "y", "z"].forEach((name, axis) => {
      const across = 22 * turn[3 * axis], up = 22 * turn[3 * axis + 1];
      if (Math.hypot(across, up) < 5) return; // end on
      lines.push(`M${u},${v}l${across},${-up}`);
      texts.push([u + 1.35 * across, v - 1.35 * up + 4, name]);
    });
    return `<path d="${lines.join("")}" fill="none" stroke="currentColor" stroke-width="1.5"/>`
      + texts.map(([x, at, words]) => `<text x="${x}" y="${at}" text-anchor="middle" font-size="11"`
        + ` fill="currentColor">${words}</text>`).join("");
  }

  /** Play from frame to frame while the canvas is visible. */
  run() {
    this.play.textContent = this.playing ? "❚❚ Pause" : "▶ Play";
    if (!this.playing || this.frame || !this.mesh) return;
    let last = null;
    const next = (now) => {
      this.frame = null;
      if (!this.playing || !this.canvas.isConnected || !this.canvas.clientWidth) return;
      const elapsed = last === null ? 0 : Math.min(now - last, 100) / 1e3;
      last = now;
      this.time = (this.time + elapsed / this.slower) % this.loop;
      this.draw();
      this.options.onTime?.(this.time);
      this.frame = requestAnimationFrame(next);
    };
    this.frame = requestAnimationFrame(next);
  }

  listen() {
    const { canvas, view } = this;
    const turnBy = (x, y) => {
      view.turned += 0.01 * x;
      view.tipped = Math.min(Math.PI, Math.max(0, view.tipped - 0.01 * y));
      this.draw();
    };
    const nearer = (factor) => {
      view.near = Math.min(12, Math.max(0.4, view.near * factor));
      this.draw();
    };
    const toggle = () => { this.playing = !this.playing; this.run(); };
    const look = (changes) => { Object.assign(view, HOME, changes); this.draw(); };
    canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
    canvas.addEventListener("pointermove", ({ buttons, movementX, movementY }) => {
      if (buttons) turnBy(movementX, movementY);
    });
    canvas.addEventListener("wheel", (event) => {
      if (document.activeElement !== canvas && !event.ctrlKey) return;
      event.preventDefault();
      nearer(Math.exp(-0.0015 * event.deltaY));
    }, { passive: false });
    const turns = { ArrowLeft: [-15, 0], ArrowRight: [15, 0], ArrowUp: [0, -15], ArrowDown: [0, 15] };
    canvas.addEventListener("keydown", (event) => {
      if (event.ctrlKey || event.metaKey || event.altKey) return;
      if (turns[event.key]) turnBy(...turns[event.key]);
      else if (event.key === "+" || event.key === "=") nearer(1.15);
      else if (event.key === "-") nearer(1 / 1.15);
      else if (event.key === " ") toggle();
      else if (event.key === "Home") look({});
      else return;
      event.preventDefault();
    });
    this.play.onclick = toggle;
    this.home.onclick = () => look({});
    this.above.onclick = () => look({ turned: 0, tipped: 0 });
    this.slow.onchange = () => { this.slower = Number(this.slow.value); };
    this.slider.oninput = () => {
      this.playing = false;
      this.seek(this.slider.value / 1000 * this.loop);
      this.run();
    };
    canvas.asSvg = () => {
      this.draw(); // the picture can be read in the same task only
      return `<image href="${canvas.toDataURL()}" width="${canvas.clientWidth}" height="${
        canvas.clientHeight}"/>${this.over.innerHTML}`;
    };
    new ResizeObserver(() => { this.draw(); this.run(); }).observe(canvas);
  }

  /** Show a time in s. */
  seek(time) {
    if (!this.loop) return;
    this.time = time % this.loop;
    this.draw();
    this.options.onTime?.(this.time);
  }
}

/**
 * Open a view in an element that sets its size. `show` fills it.
 * @param {HTMLElement} container
 * @param {object} options onTime: called with the time in s as it changes; follows: whether another view
 *   sets the time, so that there are no controls
 */
export const openView = (container, options = {}) => new View(container, options);
