// The body in three dimensions: its surface as drawing.py sends it, moved through one period.
(() => {
  const VERTEX = `#version 300 es
    in vec3 place; in float before; in float after;
    uniform mat3 turn; uniform vec3 middle; uniform vec2 size; uniform float part, drawn;
    out float motion, along; out vec3 seen;
    void main() {
      motion = mix(before, after, part);
      along = place.y;
      vec3 at = turn * (place + vec3(0.0, 0.0, motion * drawn) - middle);
      seen = at;
      gl_Position = vec4(at.xy * size, -at.z * 0.004, 1.0);
      gl_PointSize = 9.0;
    }`;
  // Red into the body, blue out of it, as in the pictures of a report; drawings.py has them, too.
  const FRAGMENT = `#version 300 es
    precision highp float;
    in float motion, along; in vec3 seen; uniform vec4 own; uniform float cut, hue; out vec4 colour;
    void main() {
      if (own.a > 0.0) { colour = own; return; }
      if (along > cut) discard;
      vec3 still = vec3(0.97), way = motion < 0.0 ? vec3(0.70, 0.09, 0.17) : vec3(0.13, 0.40, 0.67);
      vec3 facing = normalize(cross(dFdx(seen), dFdy(seen)));
      float light = 0.45 + 0.55 * max(0.0, dot(facing, normalize(vec3(-0.4, 0.5, 0.8))));
      vec3 shown = mix(still, way, min(1.0, sqrt(abs(motion))));
      if (hue > 0.5) { // cividis, by three of its colours
        float part = 0.5 - 0.5 * motion;
        shown = part < 0.5 ? mix(vec3(0.0, 0.13, 0.30), vec3(0.49, 0.48, 0.47), 2.0 * part)
          : mix(vec3(0.49, 0.48, 0.47), vec3(1.0, 0.92, 0.28), 2.0 * part - 1.0);
      }
      colour = vec4(shown * light, 1.0);
    }`;
  let shown = null; // the body that is drawn
  const view = { turned: -0.5, tipped: 0.95, near: 1, at: 0, cut: 1, hue: 0 };

  function program(gl) {
    const made = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(made, shader);
    }
    ["place", "before", "after"].forEach((name, k) => gl.bindAttribLocation(made, k, name));
    gl.linkProgram(made);
    return made;
  }

  // What is sent arrives as bytes wherever it lies in a message: copied, to be aligned.
  const as = (Kind, bytes) => new Kind(new Uint8Array(bytes).buffer);

  function buffer(gl, values, target = gl.ARRAY_BUFFER) {
    const made = gl.createBuffer();
    gl.bindBuffer(target, made);
    gl.bufferData(target, values, gl.STATIC_DRAW);
    return made;
  }

  function shaped(at, shape) {
    const { gl } = at, places = as(Float32Array, shape.points);
    for (const old of [at.points, at.corners]) gl.deleteBuffer(old);
    at.points = buffer(gl, places);
    at.corners = buffer(gl, as(Uint32Array, shape.triangles), gl.ELEMENT_ARRAY_BUFFER);
    at.count = places.length / 3;
    at.triangles = shape.triangles.byteLength / 4;
    const ends = [0, 1, 2].map((axis) => {
      let low = Infinity, high = -Infinity;
      for (let k = axis; k < places.length; k += 3) {
        low = Math.min(low, places[k]);
        high = Math.max(high, places[k]);
      }
      return [low, high];
    });
    at.along = ends[1];
    at.middle = ends.map(([low, high]) => (low + high) / 2);
    at.reach = Math.hypot(...ends.map(([low, high]) => (high - low) / 2));
  }

  function moved(at, motion) {
    const { gl } = at;
    gl.deleteBuffer(at.frames);
    at.frames = buffer(gl, as(Int8Array, motion.frames));
    at.path = as(Float32Array, motion.path);
    at.foci = as(Float32Array, motion.foci);
    at.motion = motion;
  }

  function marks(at, kind, values, colour) {
    const { gl } = at;
    if (!values.length) return;
    const made = buffer(gl, values);
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
    gl.disableVertexAttribArray(1);
    gl.disableVertexAttribArray(2);
    gl.uniform4f(at.place.own, ...colour, 1);
    gl.drawArrays(kind, 0, values.length / 3);
    gl.deleteBuffer(made);
  }

  function draw(at) {
    const { gl, canvas, motion } = at;
    if (!motion || !at.count || !canvas.clientWidth) return;
    const ratio = window.devicePixelRatio || 1;
    canvas.width = Math.round(canvas.clientWidth * ratio);
    canvas.height = Math.round(canvas.clientHeight * ratio);
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    const [c, s, d, e] = [Math.cos(view.turned), Math.sin(view.turned), Math.cos(view.tipped),
                          Math.sin(view.tipped)];
    gl.uniformMatrix3fv(at.place.turn, false, [c, s * d, -s * e, -s, c * d, -c * e, 0, e, d]);
    const scale = (1.15 * view.near) / at.reach, wide = canvas.width / canvas.height;
    gl.uniform2f(at.place.size, scale / Math.max(1, wide), scale * Math.min(1, wide));
    gl.uniform3fv(at.place.middle, at.middle);
    const frames = motion.count, exact = view.at * frames, k = Math.floor(exact) % frames;
    gl.uniform1f(at.place.part, exact - Math.floor(exact));
    gl.uniform1f(at.place.drawn, motion.drawn);
    gl.uniform4f(at.place.own, 0, 0, 0, 0);
    const [first, last] = at.along;
    gl.uniform1f(at.place.cut, view.cut < 1 ? first + view.cut * (last - first) : 1e9);
    gl.uniform1f(at.place.hue, view.hue);
    gl.bindBuffer(gl.ARRAY_BUFFER, at.points);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
    gl.bindBuffer(gl.ARRAY_BUFFER, at.frames);
    [k, (k + 1) % frames].forEach((frame, which) => {
      gl.enableVertexAttribArray(1 + which);
      gl.vertexAttribPointer(1 + which, 1, gl.BYTE, true, 0, frame * at.count);
    });
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, at.corners);
    gl.drawElements(gl.TRIANGLES, at.triangles, gl.UNSIGNED_INT, 0);
    gl.disable(gl.DEPTH_TEST); // path and foci are seen wherever the surface is
    marks(at, gl.LINES, at.path, [0.05, 0.05, 0.05]);
    const each = at.foci.length / frames;
    marks(at, gl.POINTS, at.foci.subarray(k * each, (k + 1) * each), [0.05, 0.05, 0.05]);
    gl.enable(gl.DEPTH_TEST);
    said(at);
    canvas.dispatchEvent(new CustomEvent("drawn"));
  }

  function said({ motion }) {
    const slider = document.getElementById("body-time"), time = view.at * motion.period;
    const now = `${time.toFixed(2)} of ${motion.period.toFixed(2)} ms`;
    if (document.activeElement !== slider || window.trame.utils.skinwave.playing)
      slider.value = 1000 * view.at;
    slider.setAttribute("aria-valuetext", now);
    document.getElementById("body-now").textContent = now;
  }

  function listen(at) {
    const { canvas } = at;
    const turn = (x, y) => {
      view.turned += 0.01 * x;
      view.tipped = Math.min(Math.PI / 2, Math.max(0, view.tipped - 0.01 * y));
      draw(at);
    };
    const nearer = (factor) => {
      view.near = Math.min(6, Math.max(0.5, view.near * factor));
      draw(at);
    };
    canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
    canvas.addEventListener("pointermove", (event) => {
      if (event.buttons) turn(event.movementX, event.movementY);
    });
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      nearer(event.deltaY < 0 ? 1.1 : 1 / 1.1);
    }, { passive: false });
    const keys = { ArrowLeft: [-15, 0], ArrowRight: [15, 0], ArrowUp: [0, -15], ArrowDown: [0, 15] };
    canvas.addEventListener("keydown", (event) => {
      if (keys[event.key]) turn(...keys[event.key]);
      else if (event.key === "+") nearer(1.1);
      else if (event.key === "-") nearer(1 / 1.1);
      else if (event.key === " ") window.trame.utils.skinwave.play();
      else return;
      event.preventDefault();
    });
    document.getElementById("body-time").oninput = (event) => {
      const { skinwave } = window.trame.utils;
      skinwave.play(false);
      skinwave.show((event.target.value / 1000) * at.motion.period);
    };
    document.getElementById("body-clip").oninput = (event) => {
      view.cut = event.target.value / 100;
      draw(at);
    };
    new ResizeObserver(() => draw(at)).observe(canvas);
    shown = at;
  }

  // The body as it is at a time in ms, if it is seen.
  function show(time) {
    if (!shown?.motion || !shown.canvas.isConnected) return;
    view.at = (time / shown.motion.period) % 1;
    draw(shown);
  }

  function full() {
    const whole = document.querySelector(".sw-body");
    if (document.fullscreenElement) document.exitFullscreen(); else whole.requestFullscreen();
  }

  // Begin to draw on a canvas that has just come; `end` as it goes.
  function begin(state) {
    const canvas = document.getElementById("body-view");
    const gl = canvas.getContext("webgl2", { antialias: true, preserveDrawingBuffer: true });
    if (!gl) {
      document.getElementById("body-now").textContent = "this browser draws no 3-D (WebGL 2)";
      return;
    }
    const at = { canvas, gl, place: {}, count: 0 }, made = program(gl);
    gl.useProgram(made);
    gl.enable(gl.DEPTH_TEST);
    for (const name of ["turn", "middle", "size", "part", "drawn", "own", "cut", "hue"])
      at.place[name] = gl.getUniformLocation(made, name);
    listen(at);
    const ends = [
      state.watch(["hue"], (hue) => {
        view.hue = hue || 0;
        draw(at);
      }),
      state.watch(["body_shape"], (shape) => shape?.points && shaped(at, shape)),
      state.watch(["body_motion"], (motion) => {
        if (!motion?.frames) return;
        moved(at, motion);
        draw(at);
        window.trame.utils.skinwave.came();
      }),
    ];
    at.end = () => {
      ends.forEach((end) => end?.());
      gl.getExtension("WEBGL_lose_context")?.loseContext();
    };
  }

  window.trame.utils.body = { begin, view, show, full, end: () => shown?.end() };
})();
