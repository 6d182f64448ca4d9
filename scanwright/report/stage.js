// The stage: the scanner with names, selection, explode and cut; the room that it sees, coloured by a map of all
// directions; one scan as a cloud. One canvas and one program; the report and a saved live page share it.
const inflated = async (text) => {
  const stream = new Blob([Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0))]).stream();
  return new Response(stream.pipeThrough(new DecompressionStream("gzip"))).text();
};
(async () => {
  const DEG = Math.PI / 180;
  const FIELD_OF_VIEW = 30 * DEG;
  const BELOW_TABS = 0.12; // of half the height: how far down the middle is
  const [FLAT, LIT, ROOM, POINTS] = [0, 1, 2, 3];
  const NAMES = { lidar_body: "lidar", ring_stator: "slip ring", servo_case: "servo", base_mount: "mount", counterweight: "counterweight" };
  const PALE = [0.6, 0.6, 0.6, 0.13];
  const element = (id) => document.getElementById(id);
  const canvas = element("canvas");
  if (!canvas) return;
  // kept after drawing, or it would be printed empty; opaque, or the page would shine through what is half transparent
  const gl = canvas.getContext("webgl2", { alpha: false, antialias: true, preserveDrawingBuffer: true });
  const program = gl && (() => {
    const made = gl.createProgram();
    const vertex = `#version 300 es
      layout(location = 0) in vec4 position;
      layout(location = 1) in float stopped;
      uniform mat4 model, view, projection;
      uniform float point_px;
      out vec3 eye, world;
      out float level;
      flat out float dark;
      void main() {
        vec4 place = model * vec4(position.xyz, 1.0);
        vec4 seen = view * place;
        world = place.xyz;
        eye = seen.xyz;
        level = position.w;
        dark = stopped;
        gl_Position = projection * seen;
        gl_PointSize = clamp(point_px / gl_Position.w, 1.5, 12.0);
      }`;
    const fragment = `#version 300 es
      precision highp float;
      in vec3 eye, world;
      in float level;
      flat in float dark;
      uniform int mode;
      uniform vec4 colour, stopped_colour, cut;
      uniform vec3 centre, stops[7];
      uniform sampler2D picture;
      out vec4 shown;
      const float PI = 3.14159265;
      void main() {
        if (mode == ${POINTS}) {
          float at = clamp(level, 0.0, 0.999) * 6.0;
          shown = vec4(mix(stops[int(at)], stops[int(at) + 1], fract(at)), 1.0);
        } else if (mode == ${ROOM}) {
          vec3 away = world - centre, n = normalize(away);
          vec4 own = texture(picture, vec2(atan(n.y, n.x) / (2.0 * PI) + 0.5, acos(clamp(n.z, -1.0, 1.0)) / PI));
          vec3 wide = fwidth(away), off = abs(away - round(away)) / max(wide, vec3(1e-6));
          off = mix(off, vec3(9.0), lessThan(wide, vec3(1e-5))); // not across the wall itself
          float line = clamp(1.5 - min(off.x, min(off.y, off.z)), 0.0, 1.0);
          shown = vec4(own.rgb * (1.0 - 0.3 * line), 1.0);
        } else {
          if (mode == ${LIT} && dot(cut.xyz, world) > cut.w) discard;
          vec4 own = dark > 0.5 ? stopped_colour : colour;
          // faces are flat: their normal is that of the triangle; the light is at the eye
          float facing = mode == ${LIT} ? abs(normalize(cross(dFdx(eye), dFdy(eye))).z) : 1.0;
          float inner = mode == ${LIT} && cut.w < 1e6 && !gl_FrontFacing ? 0.75 : 1.0;
          shown = vec4(mix(own.rgb, vec3(1.0), mode == ${LIT} ? 0.12 : 0.0) * (0.35 + 0.65 * facing) * inner, own.a);
        }
      }`;
    for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(made, shader);
    }
    gl.linkProgram(made);
    return gl.getProgramParameter(made, gl.LINK_STATUS) && made;
  })();
  if (!program) return; // the still pictures remain
  gl.useProgram(program);
  const uniform = new Proxy({}, { get: (known, name) => (known[name] ??= gl.getUniformLocation(program, name)) });
  const scene = JSON.parse(await inflated(element("scene").textContent));

  // ---- numbers ----

  const product = (a, b) =>
    Array.from({ length: 16 }, (_, i) => [0, 1, 2, 3].reduce((sum, k) => sum + a[4 * k + (i % 4)] * b[4 * (i >> 2) + k], 0));
  const between = (a, b, share) => a.map((value, i) => value + share * (b[i] - value));
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const aboutZ = (angle) => [Math.cos(angle), Math.sin(angle), 0, 0, -Math.sin(angle), Math.cos(angle), 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];
  const scaled = ([x, y, z], [a, b, c]) => [a, 0, 0, 0, 0, b, 0, 0, 0, 0, c, 0, x, y, z, 1];
  const STILL = scaled([0, 0, 0], [1, 1, 1]);
  const awayFrom = ({ yaw, pitch }) => [Math.cos(yaw) * Math.cos(pitch), Math.sin(yaw) * Math.cos(pitch), Math.sin(pitch)];
  const looking = (camera, eye) => {
    const back = awayFrom(camera);
    const right = [-Math.sin(camera.yaw), Math.cos(camera.yaw), 0];
    const up = [-Math.cos(camera.yaw) * Math.sin(camera.pitch), -Math.sin(camera.yaw) * Math.sin(camera.pitch), Math.cos(camera.pitch)];
    return [0, 1, 2].flatMap((i) => [right[i], up[i], back[i], 0]).concat(-dot(right, eye), -dot(up, eye), -dot(back, eye), 1);
  };
  const perspective = (aspect, near, far) => {
    // the field of view holds in the narrower direction, so that a phone shows all of it
    const f = Math.min(1, aspect) / Math.tan(FIELD_OF_VIEW / 2);
    return [f / aspect, 0, 0, 0, 0, f, 0, 0, 0, BELOW_TABS, (far + near) / (near - far), -1, 0, 0, (2 * far * near) / (near - far), 0];
  };
  // the place of a point as shares of the width and the height of the picture
  const onPicture = (both, [x, y, z]) => {
    const [cx, cy, , w] = [0, 1, 2, 3].map((i) => both[i] * x + both[4 + i] * y + both[8 + i] * z + both[12 + i]);
    return [(cx / w + 1) / 2, (1 - cy / w) / 2];
  };
  const bytes = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer;
  const colourOf = (name) => getComputedStyle(canvas)[name].match(/[\d.]+/g).slice(0, 3).map((part) => part / 255);

  // ---- what is drawn ----

  const filled = (target, values, usage = gl.STATIC_DRAW) => {
    gl.bindBuffer(target, gl.createBuffer());
    gl.bufferData(target, values, usage);
  };
  const shape = (corners, indices, size = 3, kind = gl.FLOAT) => {
    const array = gl.createVertexArray();
    gl.bindVertexArray(array);
    filled(gl.ARRAY_BUFFER, corners);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, size, kind, kind !== gl.FLOAT, 0, 0);
    if (indices) filled(gl.ELEMENT_ARRAY_BUFFER, indices);
    return array;
  };
  const shaped = (body) => {
    const indices = new (body.wide ? Uint32Array : Uint16Array)(bytes(body.faces));
    const array = shape(new Uint16Array(bytes(body.vertices)), indices, 3, gl.UNSIGNED_SHORT);
    return { ...body, array, count: indices.length, type: body.wide ? gl.UNSIGNED_INT : gl.UNSIGNED_SHORT };
  };
  const bodies = (scene.bodies ?? []).map(shaped);
  const robot = (scene.robot ?? []).map(shaped);
  const lines = shape(new Float32Array([0, 0, -1, 0, 0, 1]));
  const arrow = shape(new Float32Array([1, 0, 0, 0.75, 0.08, 0, 0.75, -0.08, 0, 0.75, 0.02, 0, 0, 0.02, 0, 0, -0.02, 0, 0.75, 0.02, 0, 0, -0.02, 0, 0.75, -0.02, 0]));
  const grid = scene.grid && (() => {
    const { z, square, squares } = scene.grid;
    const side = square * squares;
    const corners = [];
    for (let i = -squares; i <= squares; i += 1) corners.push(i * square, -side, z, i * square, side, z, -side, i * square, z, side, i * square, z);
    return { array: shape(new Float32Array(corners)), count: corners.length / 3, side, tip: [side + square / 2, 0, z] };
  })();
  // one triangle a beam, half a step to either side of it
  const fan = scene.fan && (() => {
    const bearings = [...new Float32Array(bytes(scene.fan.bearings))];
    const half = bearings.length > 1 ? (bearings[1] - bearings[0]) / 2 : 0.002;
    const edge = (angle) => [scene.reach * Math.cos(angle), scene.reach * Math.sin(angle), 0];
    const array = shape(new Float32Array(bearings.flatMap((bearing) => [0, 0, 0, ...edge(bearing - half), ...edge(bearing + half)])));
    const stopped = new Uint8Array(3 * bearings.length);
    const buffer = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.bufferData(gl.ARRAY_BUFFER, stopped, gl.DYNAMIC_DRAW);
    gl.enableVertexAttribArray(1);
    gl.vertexAttribPointer(1, 1, gl.UNSIGNED_BYTE, false, 0, 0);
    const hidden = Object.entries(scene.fan.hidden).map(([beam, bits]) => [Number(beam), new Uint8Array(bytes(bits))]);
    return { array, buffer, stopped, hidden, beams: bearings.length };
  })();
  // walls of the room as squares about the middle of each, seen if the camera is on their inner side
  const walls = scene.room && [0, 1, 2].flatMap((axis) => ["low", "high"].map((end) => {
    const [a, b] = [0, 1, 2].filter((k) => k !== axis);
    const corners = [["low", "low"], ["high", "low"], ["high", "high"], ["low", "high"]].flatMap((ends) => {
      const corner = [0, 0, 0];
      [corner[axis], corner[a], corner[b]] = [scene.room[end][axis], scene.room[ends[0]][a], scene.room[ends[1]][b]];
      return corner;
    });
    const inner = (eye) => (end === "low" ? eye[axis] > scene.room.low[axis] : eye[axis] < scene.room.high[axis]);
    return { array: shape(new Float32Array(corners)), inner };
  }));
  const cloud = scene.cloud && (() => {
    const values = new Uint16Array(bytes(scene.cloud.points));
    return { ...scene.cloud, array: shape(values, null, 4, gl.UNSIGNED_SHORT), count: values.length / 4 };
  })();
  gl.uniform3fv(uniform.stops, scene.stops.flat().map((part) => part / 255));

  // ---- what the person chose ----

  const value = (id, otherwise) => Number(element(id)?.value ?? otherwise);
  const axis = element("axis");
  const start = { scanner: { yaw: 40 * DEG, pitch: 22 * DEG }, room: scene.look, scan: scene.look };
  const cameras = Object.fromEntries(Object.entries(start).map(([name, look]) => [name, { ...look, zoom: 1 }]));
  const fits = {
    scanner: scene.fit && (() => {
      const share = value("apart", 0);
      return { centre: between(scene.fit.centre, scene.fit_apart.centre, share), radius: 0.9 * (scene.fit.radius + share * (scene.fit_apart.radius - scene.fit.radius)) };
    }),
    room: () => ({ centre: between(scene.room.low, scene.room.high, 0.5), radius: 0.47 * Math.hypot(...scene.room.high.map((high, k) => high - scene.room.low[k])) }),
    scan: () => ({ ...scene.cloud.fit, radius: 0.8 * scene.cloud.fit.radius }),
  };
  let view = "scanner";
  let picked = null; // names of the bodies in front
  let hovered = null;
  let spinning = false;
  let forth = 1;
  let last = 0;
  let ready = !scene.maps; // the map of the room is loaded

  // ---- drawing ----

  const markStopped = (degrees) => {
    const { steps } = scene.fan;
    const step = ((Math.round((degrees / 360) * steps) % steps) + steps) % steps;
    let count = 0;
    for (const [beam, bits] of fan.hidden) {
      const is = (bits[step >> 3] >> (7 - (step & 7))) & 1;
      fan.stopped.fill(is, 3 * beam, 3 * beam + 3);
      count += is;
    }
    gl.bindBuffer(gl.ARRAY_BUFFER, fan.buffer);
    gl.bufferSubData(gl.ARRAY_BUFFER, 0, fan.stopped);
    element("fan-shown").textContent = count ? `${count} of ${fan.beams} beams hidden` : "";
  };
  const use = (mode, model, colour) => {
    gl.uniform1i(uniform.mode, mode);
    gl.uniformMatrix4fv(uniform.model, false, model);
    if (colour) gl.uniform4fv(uniform.colour, colour);
  };
  const drawn = (array, kind, count, first = 0) => {
    gl.bindVertexArray(array);
    gl.drawArrays(kind, first, count);
  };
  const turned = () => product(product(scene.axis, aboutZ(value("axis", 0) * DEG)), scene.axis_inverse);
  const placeOf = (body, turn) => {
    const place = between(body.matrix, body.apart, view === "scanner" ? value("apart", 0) : 0);
    return body.turns ? product(turn, place) : place;
  };
  const drawBody = (body, turn, colour, mode = LIT) => {
    use(mode, placeOf(body, turn), colour);
    gl.bindVertexArray(body.array);
    gl.drawElements(gl.TRIANGLES, body.count, body.type, 0);
  };
  const inFront = (body) => !picked || picked.has(body.name);

  // the section goes through the axis and faces the first view; without one nothing is cut
  const section = () => {
    const share = view === "scanner" ? value("cut", 0) : 0;
    if (!share || !scene.axis) return [0, 0, 0, 1e9];
    const along = scene.axis.slice(8, 11);
    const to = awayFrom(start.scanner);
    const across = to.map((part, k) => part - dot(to, along) * along[k]);
    const normal = across.map((part) => part / Math.hypot(...across));
    return [...normal, dot(normal, scene.axis.slice(12, 15)) + (1 - share) * scene.fit.radius];
  };
  const drawScanner = (turn, ink) => {
    const apart = value("apart", 0);
    for (const body of bodies.filter(inFront)) drawBody(body, turn, [...body.colour.map((part) => (hovered === body.name ? 0.7 * part + 0.3 : part)), 1]);
    use(FLAT, product(scene.axis, scaled([0, 0, 0], [1, 1, scene.reach])), [...ink, 1]);
    drawn(lines, gl.LINES, 2);
    gl.enable(gl.BLEND);
    gl.depthMask(false);
    if (!apart) {
      use(FLAT, STILL, [...ink, 0.22]);
      drawn(grid.array, gl.LINES, grid.count);
      use(FLAT, scaled([0, 0, scene.grid.z], [grid.side, grid.side, 1]), [...ink, 0.7]);
      drawn(arrow, gl.TRIANGLES, 9);
    }
    for (const body of bodies.filter((other) => !inFront(other))) drawBody(body, turn, PALE);
    const beams = fan && element("fan").checked && !apart && (!picked || picked.has("lidar_body"));
    if (beams) {
      gl.bindVertexArray(fan.array);
      markStopped(value("axis", 0));
      gl.uniform4f(uniform.stopped_colour, 0, 0, 0, 0.85);
      use(FLAT, product(turn, scene.laser), [0.95, 0.7, 0.1, 0.4]);
      drawn(fan.array, gl.TRIANGLES, 3 * fan.beams);
    } else if (fan) {
      element("fan-shown").textContent = "";
    }
  };
  const drawRoom = (eye) => {
    for (const wall of walls.filter(({ inner }) => inner(eye))) {
      use(ROOM, STILL);
      drawn(wall.array, gl.TRIANGLE_FAN, 4);
      use(FLAT, STILL, [0, 0, 0, 1]);
      drawn(wall.array, gl.LINE_LOOP, 4);
    }
    // a line from the scanner to the floor, and an arrow ahead
    const [x, y, z] = scene.centre;
    use(FLAT, scaled([x, y, (z + scene.level) / 2], [1, 1, (z - scene.level) / 2]), [0, 0, 0, 1]);
    drawn(lines, gl.LINES, 2);
    use(FLAT, scaled([x, y, scene.level + (z > scene.level ? 0.01 : -0.01)], [1.1, 1.1, 1]), [0.07, 0.07, 0.07, 1]);
    drawn(arrow, gl.TRIANGLES, 9);
  };

  const aim = () => {
    const camera = cameras[view];
    const { centre, radius } = fits[view]();
    const distance = radius / (1 - Math.abs(BELOW_TABS)) / Math.sin(FIELD_OF_VIEW / 2) / camera.zoom;
    const eye = awayFrom(camera).map((part, k) => centre[k] + distance * part);
    const projection = perspective(canvas.width / canvas.height, distance / 50, distance + 10 * radius);
    const both = product(projection, looking(camera, eye));
    gl.uniformMatrix4fv(uniform.projection, false, projection);
    gl.uniformMatrix4fv(uniform.view, false, looking(camera, eye));
    gl.uniform4fv(uniform.cut, section());
    gl.uniform1f(uniform.point_px, (0.03 * canvas.height) / 2 / Math.tan(FIELD_OF_VIEW / 2));
    return { eye, both };
  };
  const draw = () => {
    const scale = Math.min(2, window.devicePixelRatio || 1);
    const [width, height] = [canvas.clientWidth, canvas.clientHeight].map((side) => Math.max(1, Math.round(side * scale)));
    if (canvas.clientWidth && (canvas.width !== width || canvas.height !== height)) [canvas.width, canvas.height] = [width, height];
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(...colourOf("backgroundColor"), 1);
    gl.depthMask(true); // before clearing: a depth that is not written is not cleared either
    gl.enable(gl.DEPTH_TEST);
    gl.disable(gl.BLEND);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.vertexAttrib1f(1, 0);
    const { eye, both } = aim();
    const ink = colourOf("color");
    const turn = bodies.length ? turned() : STILL;
    if (view === "scanner") {
      drawScanner(turn, ink);
    } else {
      gl.uniform3fv(uniform.centre, scene.centre);
      for (const body of bodies) drawBody(body, turn, [...body.colour, 1]);
      if (view === "room") for (const body of robot) drawBody(body, turn, [...body.colour, 1]);
      if (view === "room" && ready) drawRoom(eye);
      if (view === "scan") {
        use(POINTS, scaled(cloud.low, cloud.span));
        drawn(cloud.array, gl.POINTS, cloud.count);
      }
    }
    if (axis) element("axis-shown").textContent = `${value("axis", 0).toFixed(1)} deg`;
    name(both, turn);
  };

  // ---- words on the picture ----

  const marks = element("marks");
  const leads = element("leads");
  const ahead = element("ahead");
  const labels = bodies.filter((body) => NAMES[body.name]).map((body) => {
    const mark = document.createElement("span");
    const lead = document.createElementNS("http://www.w3.org/2000/svg", "path");
    mark.className = "mark";
    mark.textContent = NAMES[body.name];
    marks.append(mark);
    leads.append(lead);
    return { body, mark, lead };
  });
  // on a phone the column of names and the buttons have no room for another word
  const mark = (word, point, both) => {
    const [x, y] = point ? onPicture(both, point) : [0, 0];
    const [left, top] = [x * canvas.clientWidth, y * canvas.clientHeight];
    const taken = view === "scanner" && (left < 110 || (left > canvas.clientWidth - 170 && top > canvas.clientHeight - 70));
    word.hidden = !point || (canvas.clientWidth < 520 && taken);
    [word.style.left, word.style.top] = [`${left.toFixed(1)}px`, `${top.toFixed(1)}px`];
  };
  // names are in a column next to the scanner, in the order of the heights of their parts
  const name = (both, turn) => {
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    const tip = view === "scanner" ? grid?.tip : [scene.centre[0] + 1.4, scene.centre[1], scene.level];
    const shown = view === "scanner" && !picked && !spinning;
    mark(ahead, view === "scanner" && value("apart", 0) > 0 ? null : tip, both);
    mark(element("axis-mark"), shown && product(scene.axis, scaled([0, 0, scene.reach], [1, 1, 1])).slice(12, 15), both);
    const placed = labels.map(({ body, mark, lead }) => {
      const place = placeOf(body, turn);
      const at = [0, 1, 2].map((k) => (place[k] + place[4 + k] + place[8 + k]) / 2 + place[12 + k]); // of its box
      mark.hidden = !shown;
      lead.setAttribute("d", "");
      const [x, y] = onPicture(both, at);
      return { mark, lead, x: x * width, y: y * height };
    });
    if (!shown) return;
    const column = width < 520 ? 8 : Math.max(8, Math.min(...placed.map(({ x }) => x)) - 0.3 * width);
    let free = 64;
    for (const { mark, lead, x, y } of placed.sort((one, other) => one.y - other.y)) {
      const top = Math.max(free, Math.min(height - 24, y));
      free = top + 30;
      [mark.style.left, mark.style.top] = [`${column}px`, `${top}px`];
      lead.setAttribute("d", `M${column + mark.offsetWidth + 4} ${top}L${x} ${y}m2.5 0a2.5 2.5 0 1 0 -5 0a2.5 2.5 0 1 0 5 0`);
    }
  };

  // ---- motion ----

  let waiting = false;
  const redraw = () => {
    if (waiting) return;
    waiting = true;
    window.requestAnimationFrame((now) => {
      waiting = false;
      if (spinning) turnOn(now);
      draw();
      if (spinning) redraw();
    });
  };
  const turnOn = (now) => {
    const [low, high] = scene.limits_deg;
    const speed = ((scene.to_and_fro ? 2 : 1) * (high - low)) / scene.period_s;
    let degrees = Number(axis.dataset.exact ?? axis.value) + (last ? (forth * speed * (now - last)) / 1000 : 0);
    if (scene.to_and_fro) {
      if (degrees >= high || degrees <= low) forth = degrees >= high ? -1 : 1;
      degrees = Math.min(high, Math.max(low, degrees));
    } else {
      degrees = low + ((((degrees - low) % (high - low)) + high - low) % (high - low));
    }
    [axis.dataset.exact, axis.value, last] = [degrees, degrees, now];
  };
  const spin = (on) => {
    [spinning, last] = [on, 0];
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
  const show = (name) => {
    view = name;
    const tab = element(`view-${name}`);
    if (tab) tab.checked = true;
    for (const part of document.querySelectorAll("[data-view]")) part.hidden = part.dataset.view !== name;
    redraw();
  };

  // the body under the pointer: all are drawn in the colour of their number, and one pixel is read
  const target = gl.createFramebuffer();
  const [numbers, depth] = [gl.createRenderbuffer(), gl.createRenderbuffer()];
  const under = (event) => {
    if (view !== "scanner") return null;
    const box = canvas.getBoundingClientRect();
    const x = Math.floor(((event.clientX - box.left) / box.width) * canvas.width);
    const y = Math.floor((1 - (event.clientY - box.top) / box.height) * canvas.height);
    gl.bindFramebuffer(gl.FRAMEBUFFER, target);
    for (const [buffer, format, point] of [[numbers, gl.RGBA8, gl.COLOR_ATTACHMENT0], [depth, gl.DEPTH_COMPONENT16, gl.DEPTH_ATTACHMENT]]) {
      gl.bindRenderbuffer(gl.RENDERBUFFER, buffer);
      gl.renderbufferStorage(gl.RENDERBUFFER, format, canvas.width, canvas.height);
      gl.framebufferRenderbuffer(gl.FRAMEBUFFER, point, gl.RENDERBUFFER, buffer);
    }
    gl.enable(gl.SCISSOR_TEST);
    gl.scissor(x, y, 1, 1);
    gl.disable(gl.BLEND);
    gl.depthMask(true);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    const turn = turned();
    const limit = section();
    bodies.forEach((body, number) => {
      if (limit[3] > 1e6 || inFront(body)) drawBody(body, turn, [0, 0, (number + 1) / 255, 1], FLAT);
    });
    const pixel = new Uint8Array(4);
    gl.readPixels(x, y, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
    gl.disable(gl.SCISSOR_TEST);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    return bodies[pixel[2] - 1]?.name ?? null;
  };
  const tip = element("tip");
  const hover = (event) => {
    const name = event && bodies.length ? under(event) : null;
    tip.hidden = !name;
    canvas.style.cursor = name ? "pointer" : "";
    if (name) {
      const box = canvas.getBoundingClientRect();
      [tip.style.left, tip.style.top] = [`${event.clientX - box.left}px`, `${event.clientY - box.top - 28}px`];
      tip.textContent = name.replaceAll("_", " ");
    }
    if (name !== hovered) redraw();
    hovered = name;
  };

  // ---- mouse, fingers, wheel and keys ----

  const turnBy = (yaw, pitch) => {
    const camera = cameras[view];
    camera.yaw += yaw;
    camera.pitch = Math.min(89 * DEG, Math.max(-89 * DEG, camera.pitch + pitch));
    redraw();
  };
  const zoomBy = (factor) => {
    cameras[view].zoom = Math.min(20, Math.max(0.3, cameras[view].zoom * factor));
    redraw();
  };
  const fit = () => {
    Object.assign(cameras[view], start[view], { zoom: 1 });
    redraw();
  };
  const fingers = new Map();
  let moved = 0;
  const spread = () => {
    const [a, b] = [...fingers.values()];
    return Math.hypot(a.x - b.x, a.y - b.y);
  };
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    moved = 0;
  });
  canvas.addEventListener("pointermove", (event) => {
    const before = fingers.get(event.pointerId);
    if (!before) {
      if (event.pointerType === "mouse" && !spinning) hover(event);
      return;
    }
    const apartBefore = fingers.size === 2 ? spread() : 0;
    moved += Math.abs(event.clientX - before.x) + Math.abs(event.clientY - before.y);
    fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    if (fingers.size === 1) turnBy((before.x - event.clientX) * 0.5 * DEG, (event.clientY - before.y) * 0.5 * DEG);
    else if (apartBefore > 0) zoomBy(spread() / apartBefore);
  });
  for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, (event) => fingers.delete(event.pointerId));
  canvas.addEventListener("pointerleave", () => hover(null));
  canvas.addEventListener("click", (event) => {
    if (moved > 4 || view !== "scanner" || !bodies.length) return;
    const name = under(event);
    pick(name && [name]);
  });
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
    0: fit,
  };
  canvas.addEventListener("keydown", (event) => {
    if (!keys[event.key] || event.ctrlKey || event.metaKey) return;
    event.preventDefault();
    keys[event.key]();
  });
  const acts = { nearer: () => zoomBy(1.2), farther: () => zoomBy(1 / 1.2), fit, spin: () => spin(!spinning), everything: () => pick(null) };
  for (const [id, act] of Object.entries(acts)) element(id)?.addEventListener("click", act);
  axis?.addEventListener("input", () => (spinning ? spin(false) : redraw()));
  for (const id of ["apart", "cut", "fan"]) element(id)?.addEventListener("input", redraw);
  for (const name of Object.keys(cameras)) element(`view-${name}`)?.addEventListener("input", () => show(name));
  for (const button of document.querySelectorAll("button[data-bodies]")) {
    button.addEventListener("click", () => {
      show("scanner");
      pick(button.dataset.bodies.split(" "));
      canvas.scrollIntoView({ block: "center" });
    });
    button.disabled = !bodies.length;
  }

  // the map that the room is coloured with
  const chooser = element("map-choice");
  const choose = async () => {
    const image = element(`map-${chooser.value}`);
    await image.decode();
    gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGB, gl.RGB, gl.UNSIGNED_BYTE, image);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
    ready = true;
    canvas.dataset.map = chooser.value;
    redraw();
  };
  if (scene.maps) {
    chooser.addEventListener("input", choose);
    choose();
  }
  new ResizeObserver(redraw).observe(canvas);
  for (const query of ["(prefers-color-scheme: dark)", "print"]) window.matchMedia(query).addEventListener("change", redraw);
  for (const id of ["stills", "drawn"]) if (element(id)) element(id).hidden = id === "stills";
  show(bodies.length ? "scanner" : scene.room ? "room" : "scan");
})();
