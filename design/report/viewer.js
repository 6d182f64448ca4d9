(() => {
  const element = (id) => document.getElementById(id);
  const canvas = element("canvas");
  // kept after drawing, or it would be printed empty
  const gl = canvas.getContext("webgl2", { antialias: true, preserveDrawingBuffer: true });
  if (!gl) {
    canvas.hidden = true;
    return;
  }
  const scene = JSON.parse(element("scene").textContent);
  const DEG = Math.PI / 180;
  const FIELD_OF_VIEW = 30 * DEG;

  // ---- matrices, column by column ----

  const product = (a, b) =>
    Array.from({ length: 16 }, (_, i) => [0, 1, 2, 3].reduce((sum, k) => sum + a[4 * k + (i % 4)] * b[4 * (i >> 2) + k], 0));
  const between = (a, b, share) => a.map((value, i) => value + share * (b[i] - value));
  const aboutZ = (angle) => {
    const [c, s] = [Math.cos(angle), Math.sin(angle)];
    return [c, s, 0, 0, -s, c, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];
  };
  const perspective = (aspect, near, far) => {
    // the field of view holds in the narrower direction, so that a phone shows the whole scanner
    const f = Math.min(1, aspect) / Math.tan(FIELD_OF_VIEW / 2);
    return [f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (far + near) / (near - far), -1, 0, 0, (2 * far * near) / (near - far), 0];
  };
  const orbit = ({ yaw, pitch, distance }, centre) => {
    const [cy, sy, cp, sp] = [Math.cos(yaw), Math.sin(yaw), Math.cos(pitch), Math.sin(pitch)];
    const [right, up, back] = [[-sy, cy, 0], [-cy * sp, -sy * sp, cp], [cy * cp, sy * cp, sp]];
    const along = (axis) => -(axis[0] * centre[0] + axis[1] * centre[1] + axis[2] * centre[2]);
    return [0, 1, 2].flatMap((i) => [right[i], up[i], back[i], 0]).concat(along(right), along(up), along(back) - distance, 1);
  };

  // ---- what is drawn ----

  const bytes = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const shader = (kind, source) => {
    const made = gl.createShader(kind);
    gl.shaderSource(made, source);
    gl.compileShader(made);
    return made;
  };
  const program = gl.createProgram();
  gl.attachShader(program, shader(gl.VERTEX_SHADER, `#version 300 es
    layout(location = 0) in vec3 position;
    layout(location = 1) in float stopped;
    uniform mat4 model, view, projection;
    out vec3 eye;
    flat out float dark;
    void main() {
      vec4 seen = view * model * vec4(position, 1.0);
      eye = seen.xyz;
      dark = stopped;
      gl_Position = projection * seen;
    }`));
  gl.attachShader(program, shader(gl.FRAGMENT_SHADER, `#version 300 es
    precision highp float;
    in vec3 eye;
    flat in float dark;
    uniform vec4 colour, stopped_colour;
    uniform bool lit;
    out vec4 shown;
    void main() {
      vec4 own = dark > 0.5 ? stopped_colour : colour;
      // faces are flat: their normal is that of the triangle; the light is at the eye
      float facing = lit ? abs(normalize(cross(dFdx(eye), dFdy(eye))).z) : 1.0;
      shown = vec4(mix(own.rgb, vec3(1.0), lit ? 0.12 : 0.0) * (0.35 + 0.65 * facing), own.a);
    }`));
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) {
    canvas.hidden = true;
    return;
  }
  gl.useProgram(program);
  const uniform = Object.fromEntries(
    ["model", "view", "projection", "colour", "stopped_colour", "lit"].map((name) => [name, gl.getUniformLocation(program, name)]),
  );

  const filled = (target, values, usage = gl.STATIC_DRAW) => {
    const buffer = gl.createBuffer();
    gl.bindBuffer(target, buffer);
    gl.bufferData(target, values, usage);
    return buffer;
  };
  const shape = (vertices, indices) => {
    const array = gl.createVertexArray();
    gl.bindVertexArray(array);
    filled(gl.ARRAY_BUFFER, vertices);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
    if (indices) filled(gl.ELEMENT_ARRAY_BUFFER, indices);
    return array;
  };
  const bodies = scene.bodies.map((body) => {
    const faces = bytes(body.faces);
    const indices = body.wide ? new Uint32Array(faces.buffer) : new Uint16Array(faces.buffer);
    return {
      ...body,
      array: shape(new Float32Array(bytes(body.vertices).buffer), indices),
      count: indices.length,
      type: body.wide ? gl.UNSIGNED_INT : gl.UNSIGNED_SHORT,
    };
  });
  const axisLine = shape(new Float32Array([0, 0, -scene.reach, 0, 0, scene.reach]));

  // one triangle a beam, half a step to either side of it
  const fan = scene.fan && (() => {
    const bearings = new Float32Array(bytes(scene.fan.bearings).buffer);
    const half = bearings.length > 1 ? (bearings[1] - bearings[0]) / 2 : 0.002;
    const edge = (angle) => [scene.reach * Math.cos(angle), scene.reach * Math.sin(angle), 0];
    const corners = [...bearings].flatMap((bearing) => [0, 0, 0, ...edge(bearing - half), ...edge(bearing + half)]);
    const array = shape(new Float32Array(corners));
    const stopped = new Uint8Array(3 * bearings.length);
    const buffer = filled(gl.ARRAY_BUFFER, stopped, gl.DYNAMIC_DRAW);
    gl.enableVertexAttribArray(1);
    gl.vertexAttribPointer(1, 1, gl.UNSIGNED_BYTE, false, 0, 0);
    const hidden = Object.entries(scene.fan.hidden).map(([beam, bits]) => [Number(beam), bytes(bits)]);
    return { array, buffer, stopped, hidden, beams: bearings.length, count: 3 * bearings.length };
  })();

  // ---- what the person chose ----

  const camera = { yaw: 40 * DEG, pitch: 22 * DEG, zoom: 1 };
  const axis = element("axis");
  const apart = element("apart");
  const fanShown = element("fan");
  let spinning = false;
  let forth = 1;
  let last = 0;
  let waiting = false;

  const markStopped = (degrees) => {
    const steps = scene.fan.steps;
    const step = ((Math.round((degrees / 360) * steps) % steps) + steps) % steps;
    let count = 0;
    for (const [beam, bits] of fan.hidden) {
      const is = (bits[step >> 3] >> (7 - (step & 7))) & 1;
      fan.stopped.fill(is, 3 * beam, 3 * beam + 3);
      count += is;
    }
    gl.bindBuffer(gl.ARRAY_BUFFER, fan.buffer);
    gl.bufferSubData(gl.ARRAY_BUFFER, 0, fan.stopped);
    element("fan-shown").textContent = `${count} of ${fan.beams} beams hidden`;
  };

  const draw = () => {
    const scale = Math.min(2, window.devicePixelRatio || 1);
    const [width, height] = [canvas.clientWidth, canvas.clientHeight].map((side) => Math.max(1, Math.round(side * scale)));
    if (canvas.width !== width || canvas.height !== height) {
      canvas.width = width;
      canvas.height = height;
    }
    gl.viewport(0, 0, width, height);
    gl.clearColor(1, 1, 1, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.disable(gl.BLEND);
    gl.depthMask(true);

    const degrees = Number(axis.value);
    const share = apart ? Number(apart.value) : 0;
    const centre = between(scene.fit.centre, scene.fit_apart.centre, share);
    const radius = scene.fit.radius + share * (scene.fit_apart.radius - scene.fit.radius);
    const distance = (1.05 * radius) / Math.sin(FIELD_OF_VIEW / 2) / camera.zoom;
    const turn = product(product(scene.axis, aboutZ(degrees * DEG)), scene.axis_inverse);
    gl.uniformMatrix4fv(uniform.projection, false, perspective(width / height, distance / 50, distance + 10 * radius));
    gl.uniformMatrix4fv(uniform.view, false, orbit({ ...camera, distance }, centre));
    gl.uniform1i(uniform.lit, 1);
    gl.vertexAttrib1f(1, 0);
    for (const body of bodies) {
      const place = between(body.matrix, body.apart, share);
      gl.uniformMatrix4fv(uniform.model, false, body.turns ? product(turn, place) : place);
      gl.uniform4f(uniform.colour, ...body.colour, 1);
      gl.bindVertexArray(body.array);
      gl.drawElements(gl.TRIANGLES, body.count, body.type, 0);
    }
    gl.uniform1i(uniform.lit, 0);
    gl.uniformMatrix4fv(uniform.model, false, scene.axis);
    gl.uniform4f(uniform.colour, 0, 0, 0, 1);
    gl.bindVertexArray(axisLine);
    gl.drawArrays(gl.LINES, 0, 2);
    if (fan && fanShown.checked && share === 0) {
      gl.bindVertexArray(fan.array);
      markStopped(degrees);
      gl.enable(gl.BLEND);
      gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
      gl.depthMask(false);
      gl.uniformMatrix4fv(uniform.model, false, product(turn, scene.laser));
      gl.uniform4f(uniform.colour, 0.95, 0.7, 0.1, 0.4);
      gl.uniform4f(uniform.stopped_colour, 0, 0, 0, 0.85);
      gl.drawArrays(gl.TRIANGLES, 0, fan.count);
    } else if (fan) {
      element("fan-shown").textContent = "";
    }
    element("axis-shown").textContent = `${degrees.toFixed(1)} deg`;
  };

  const frame = (now) => {
    waiting = false;
    if (spinning) {
      const [low, high] = scene.limits_deg;
      const speed = ((scene.to_and_fro ? 2 : 1) * (high - low)) / scene.period_s;
      let degrees = Number(axis.dataset.exact ?? axis.value) + (last ? (forth * speed * (now - last)) / 1000 : 0);
      if (scene.to_and_fro) {
        if (degrees >= high || degrees <= low) forth = degrees >= high ? -1 : 1;
        degrees = Math.min(high, Math.max(low, degrees));
      } else {
        degrees = low + ((((degrees - low) % (high - low)) + high - low) % (high - low));
      }
      axis.dataset.exact = degrees;
      axis.value = degrees;
      last = now;
    }
    draw();
    if (spinning) redraw();
  };
  const redraw = () => {
    if (!waiting) {
      waiting = true;
      window.requestAnimationFrame(frame);
    }
  };
  const spin = (on) => {
    spinning = on;
    last = 0;
    delete axis.dataset.exact;
    element("spin").setAttribute("aria-pressed", String(on));
    element("spin").textContent = on ? "Stop the axis" : "Turn the axis";
    redraw();
  };
  const turnBy = (yaw, pitch) => {
    camera.yaw += yaw;
    camera.pitch = Math.min(89 * DEG, Math.max(-89 * DEG, camera.pitch + pitch));
    redraw();
  };
  const zoomBy = (factor) => {
    camera.zoom = Math.min(20, Math.max(0.3, camera.zoom * factor));
    redraw();
  };

  const fingers = new Map();
  const spread = () => {
    const [a, b] = [...fingers.values()];
    return Math.hypot(a.x - b.x, a.y - b.y);
  };
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
  });
  canvas.addEventListener("pointermove", (event) => {
    const before = fingers.get(event.pointerId);
    if (!before) return;
    const apartBefore = fingers.size === 2 ? spread() : 0;
    fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    if (fingers.size === 1) turnBy((before.x - event.clientX) * 0.5 * DEG, (event.clientY - before.y) * 0.5 * DEG);
    else if (apartBefore > 0) zoomBy(spread() / apartBefore);
  });
  for (const name of ["pointerup", "pointercancel"]) {
    canvas.addEventListener(name, (event) => fingers.delete(event.pointerId));
  }
  // the bare wheel scrolls the page; with Ctrl, or by a pinch on a touch pad, it zooms
  canvas.addEventListener("wheel", (event) => {
    if (!event.ctrlKey) return;
    event.preventDefault();
    zoomBy(Math.exp(-event.deltaY / 200));
  }, { passive: false });
  const keys = {
    ArrowLeft: () => turnBy(-5 * DEG, 0),
    ArrowRight: () => turnBy(5 * DEG, 0),
    ArrowUp: () => turnBy(0, 5 * DEG),
    ArrowDown: () => turnBy(0, -5 * DEG),
    "+": () => zoomBy(1.2),
    "-": () => zoomBy(1 / 1.2),
  };
  canvas.addEventListener("keydown", (event) => {
    if (!keys[event.key]) return;
    event.preventDefault();
    keys[event.key]();
  });
  element("nearer").addEventListener("click", () => zoomBy(1.2));
  element("farther").addEventListener("click", () => zoomBy(1 / 1.2));
  element("spin").addEventListener("click", () => spin(!spinning));
  axis.addEventListener("input", () => (spinning ? spin(false) : redraw()));
  for (const control of [apart, fanShown]) control?.addEventListener("input", redraw);
  new ResizeObserver(redraw).observe(canvas);
  element("hint").hidden = true;
  element("controls").hidden = false;
  redraw();
})();
