// The scanner: turned, taken apart, its axis spun, its fan shown, and the bodies of a check picked out.
(() => {
  const element = (id) => document.getElementById(id);
  const canvas = element("canvas");
  const gl = webgl.started(canvas);
  const uniform = gl && webgl.program(gl, `#version 300 es
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
    }`, `#version 300 es
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
    }`, ["model", "view", "projection", "colour", "stopped_colour", "lit"]);
  if (!uniform) return; // the still picture remains
  const scene = JSON.parse(element("scene").textContent);
  const PALE = [0.6, 0.6, 0.6, 0.13];

  // ---- what is drawn ----

  const bodies = scene.bodies.map((body) => {
    const faces = webgl.bytes(body.faces);
    const indices = body.wide ? new Uint32Array(faces.buffer) : new Uint16Array(faces.buffer);
    return {
      ...body,
      array: webgl.shape(gl, new Float32Array(webgl.bytes(body.vertices).buffer), indices),
      count: indices.length,
      type: body.wide ? gl.UNSIGNED_INT : gl.UNSIGNED_SHORT,
    };
  });
  const axisLine = webgl.shape(gl, new Float32Array([0, 0, -scene.reach, 0, 0, scene.reach]));

  // squares under the scanner, and an arrow ahead on them
  const grid = (() => {
    const { z, square, squares } = scene.grid;
    const side = square * squares;
    const corners = [];
    for (let i = -squares; i <= squares; i += 1) corners.push(i * square, -side, z, i * square, side, z, -side, i * square, z, side, i * square, z);
    const lines = webgl.shape(gl, new Float32Array(corners));
    const [tip, neck, wide] = [side, side - square, square / 3];
    const arrow = webgl.shape(gl, new Float32Array([tip, 0, z, neck, wide, z, neck, -wide, z, neck, wide / 4, z, 0, wide / 4, z, 0, -wide / 4, z, neck, wide / 4, z, 0, -wide / 4, z, neck, -wide / 4, z]));
    return { lines, count: corners.length / 3, arrow, tip: [side + square / 2, 0, z] };
  })();
  const ahead = element("ahead");

  // one triangle a beam, half a step to either side of it
  const fan = scene.fan && (() => {
    const bearings = new Float32Array(webgl.bytes(scene.fan.bearings).buffer);
    const half = bearings.length > 1 ? (bearings[1] - bearings[0]) / 2 : 0.002;
    const edge = (angle) => [scene.reach * Math.cos(angle), scene.reach * Math.sin(angle), 0];
    const corners = [...bearings].flatMap((bearing) => [0, 0, 0, ...edge(bearing - half), ...edge(bearing + half)]);
    const array = webgl.shape(gl, new Float32Array(corners));
    const stopped = new Uint8Array(3 * bearings.length);
    const buffer = webgl.filled(gl, gl.ARRAY_BUFFER, stopped, gl.DYNAMIC_DRAW);
    gl.enableVertexAttribArray(1);
    gl.vertexAttribPointer(1, 1, gl.UNSIGNED_BYTE, false, 0, 0);
    const hidden = Object.entries(scene.fan.hidden).map(([beam, bits]) => [Number(beam), webgl.bytes(bits)]);
    return { array, buffer, stopped, hidden, beams: bearings.length, count: 3 * bearings.length };
  })();

  // ---- what the person chose ----

  const camera = { yaw: 40 * webgl.DEG, pitch: 22 * webgl.DEG, zoom: 1 };
  const axis = element("axis");
  const apart = element("apart");
  const fanShown = element("fan");
  let picked = null; // names of the bodies of a check
  let spinning = false;
  let forth = 1;
  let last = 0;

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

  const seeThrough = () => {
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    gl.depthMask(false);
  };
  const draw = () => {
    const aspect = webgl.cleared(gl);
    const degrees = Number(axis.value);
    const share = apart ? Number(apart.value) : 0;
    const centre = webgl.between(scene.fit.centre, scene.fit_apart.centre, share);
    const radius = scene.fit.radius + share * (scene.fit_apart.radius - scene.fit.radius);
    const distance = webgl.distanceTo(1.05 * radius) / camera.zoom;
    const turn = webgl.product(webgl.product(scene.axis, webgl.aboutZ(degrees * webgl.DEG)), scene.axis_inverse);
    const projection = webgl.perspective(aspect, distance / 50, distance + 10 * radius);
    const view = webgl.orbit({ ...camera, distance }, centre);
    gl.uniformMatrix4fv(uniform.projection, false, projection);
    gl.uniformMatrix4fv(uniform.view, false, view);
    gl.uniform1i(uniform.lit, 1);
    gl.vertexAttrib1f(1, 0);
    const drawBody = (body, colour) => {
      const place = webgl.between(body.matrix, body.apart, share);
      gl.uniformMatrix4fv(uniform.model, false, body.turns ? webgl.product(turn, place) : place);
      gl.uniform4f(uniform.colour, ...colour);
      gl.bindVertexArray(body.array);
      gl.drawElements(gl.TRIANGLES, body.count, body.type, 0);
    };
    const inFront = (body) => !picked || picked.has(body.name);
    for (const body of bodies.filter(inFront)) drawBody(body, [...body.colour, 1]);
    gl.uniform1i(uniform.lit, 0);
    const ink = webgl.ink(canvas);
    gl.uniformMatrix4fv(uniform.model, false, scene.axis);
    gl.uniform4f(uniform.colour, ...ink, 1);
    gl.bindVertexArray(axisLine);
    gl.drawArrays(gl.LINES, 0, 2);
    seeThrough();
    ahead.hidden = share > 0;
    if (share === 0) {
      gl.uniformMatrix4fv(uniform.model, false, webgl.aboutZ(0));
      gl.uniform4f(uniform.colour, ...ink, 0.25);
      gl.bindVertexArray(grid.lines);
      gl.drawArrays(gl.LINES, 0, grid.count);
      gl.uniform4f(uniform.colour, ...ink, 0.8);
      gl.bindVertexArray(grid.arrow);
      gl.drawArrays(gl.TRIANGLES, 0, 9);
      webgl.placed(ahead, webgl.product(projection, view), grid.tip);
    }
    for (const body of bodies.filter((other) => !inFront(other))) drawBody(body, PALE);
    if (fan && fanShown.checked && share === 0 && (!picked || picked.has("lidar_body"))) {
      gl.bindVertexArray(fan.array);
      markStopped(degrees);
      gl.uniformMatrix4fv(uniform.model, false, webgl.product(turn, scene.laser));
      gl.uniform4f(uniform.colour, 0.95, 0.7, 0.1, 0.4);
      gl.uniform4f(uniform.stopped_colour, 0, 0, 0, 0.85);
      gl.drawArrays(gl.TRIANGLES, 0, fan.count);
    } else if (fan) {
      element("fan-shown").textContent = "";
    }
    element("axis-shown").textContent = `${degrees.toFixed(1)} deg`;
  };

  const frame = (now) => {
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
  const redraw = webgl.onceAFrame(frame);
  const spin = (on) => {
    spinning = on;
    last = 0;
    delete axis.dataset.exact;
    element("spin").setAttribute("aria-pressed", String(on));
    element("spin").textContent = on ? "Stop" : "Turn";
    redraw();
  };
  const pick = (names) => {
    picked = names && new Set(names);
    element("picked").hidden = !names;
    element("picked-shown").textContent = names ? names.join(", ") : "";
    redraw();
  };

  const { zoomBy } = webgl.moved(canvas, camera, redraw);
  element("nearer").addEventListener("click", () => zoomBy(1.2));
  element("farther").addEventListener("click", () => zoomBy(1 / 1.2));
  element("spin").addEventListener("click", () => spin(!spinning));
  element("everything").addEventListener("click", () => pick(null));
  axis.addEventListener("input", () => (spinning ? spin(false) : redraw()));
  for (const control of [apart, fanShown]) control?.addEventListener("input", redraw);
  for (const button of document.querySelectorAll("button[data-bodies]")) {
    button.addEventListener("click", () => {
      element("view-scanner").checked = true;
      pick(button.dataset.bodies.split(" "));
      canvas.scrollIntoView({ block: "center" });
    });
    button.disabled = false;
  }
  element("still").hidden = true;
  for (const part of ["canvas", "controls"]) element(part).hidden = false;
  redraw();
})();
