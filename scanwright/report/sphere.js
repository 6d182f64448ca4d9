// The ball of all directions, wrapped in the picture that was chosen.
(() => {
  const element = (id) => document.getElementById(id);
  const canvas = element("sphere-canvas");
  const gl = webgl.started(canvas);
  const uniform = gl && webgl.program(gl, `#version 300 es
    layout(location = 0) in vec3 position;
    uniform mat4 view, projection;
    out vec3 direction;
    void main() {
      direction = position;
      gl_Position = projection * view * vec4(position, 1.0);
    }`, `#version 300 es
    precision highp float;
    in vec3 direction;
    uniform sampler2D picture;
    uniform bool lines;
    uniform vec3 ink;
    out vec4 shown;
    const float PI = 3.14159265;
    float near_line(float degrees, float wide) {
      return abs(degrees - 30.0 * round(degrees / 30.0)) < wide ? 1.0 : 0.0;
    }
    void main() {
      if (lines) {
        shown = vec4(ink, 1.0);
        return;
      }
      vec3 n = normalize(direction);
      float theta = acos(clamp(n.z, -1.0, 1.0));
      float phi = atan(n.y, n.x);
      vec4 own = texture(picture, vec2(phi / (2.0 * PI) + 0.5, theta / PI));
      float grid = max(near_line(degrees(theta), 0.2), near_line(degrees(phi), 0.2 / max(sin(theta), 0.02)));
      shown = vec4(mix(own.rgb, vec3(0.0), 0.25 * grid), 1.0);
    }`, ["view", "projection", "picture", "lines", "ink"]);
  if (!uniform) return;
  const scene = JSON.parse(element("sphere").textContent);
  const AXIS_REACH = 1.35;
  const ROWS = 64;

  const ball = (() => {
    const vertices = [];
    const indices = [];
    for (let i = 0; i <= ROWS; i += 1) {
      for (let j = 0; j <= 2 * ROWS; j += 1) {
        const [theta, phi] = [(i / ROWS) * Math.PI, (j / ROWS) * Math.PI];
        vertices.push(Math.sin(theta) * Math.cos(phi), Math.sin(theta) * Math.sin(phi), Math.cos(theta));
        const at = i * (2 * ROWS + 1) + j;
        if (i < ROWS && j < 2 * ROWS) indices.push(at, at + 2 * ROWS + 1, at + 1, at + 1, at + 2 * ROWS + 1, at + 2 * ROWS + 2);
      }
    }
    return { array: webgl.shape(gl, new Float32Array(vertices), new Uint16Array(indices)), count: indices.length };
  })();
  const along = (reach) => scene.axis.map((value) => value * reach);
  const axisLine = webgl.shape(gl, new Float32Array([...along(-AXIS_REACH), ...along(AXIS_REACH)]));

  const [yaw, pitch] = scene.look_deg.map((degrees) => degrees * webgl.DEG);
  const camera = { yaw, pitch, zoom: 1 };
  const marks = [...document.querySelectorAll("#sphere-place [data-direction]")].map((mark) => ({
    mark,
    place: mark.dataset.direction.split(" ").map(Number),
  }));
  let ready = false;

  // words where their directions are, as long as the ball does not stand before them
  const place = (both) => {
    for (const { mark, place: [x, y, z] } of marks) {
      const front = x * Math.cos(camera.yaw) * Math.cos(camera.pitch) + y * Math.sin(camera.yaw) * Math.cos(camera.pitch) + z * Math.sin(camera.pitch);
      const beside = Math.hypot(x, y, z) ** 2 - front ** 2 > 1.12;
      mark.hidden = front < 0 && !beside;
      webgl.placed(mark, both, [x, y, z]);
    }
  };
  const redraw = webgl.onceAFrame(() => {
    const aspect = webgl.cleared(gl);
    if (!ready) return;
    const distance = webgl.distanceTo(1.25) / camera.zoom;
    const projection = webgl.perspective(aspect, distance / 50, distance + 3);
    const view = webgl.orbit({ ...camera, distance }, [0, 0, 0]);
    gl.uniformMatrix4fv(uniform.projection, false, projection);
    gl.uniformMatrix4fv(uniform.view, false, view);
    gl.uniform1i(uniform.lines, 0);
    gl.bindVertexArray(ball.array);
    gl.drawElements(gl.TRIANGLES, ball.count, gl.UNSIGNED_SHORT, 0);
    gl.uniform1i(uniform.lines, 1);
    gl.uniform3f(uniform.ink, ...webgl.ink(canvas));
    gl.bindVertexArray(axisLine);
    gl.drawArrays(gl.LINES, 0, 2);
    place(webgl.product(projection, view));
  });

  const texture = gl.createTexture();
  gl.bindTexture(gl.TEXTURE_2D, texture);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST); // bands have sharp edges
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
  const choose = async (number) => {
    const image = element(`sphere-${number}`);
    await image.decode();
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGB, gl.RGB, gl.UNSIGNED_BYTE, image);
    const { title, low, high } = scene.views[number];
    canvas.setAttribute("aria-label", `A ball of all directions: ${title}. Arrow keys turn it, plus and minus zoom.`);
    element("sphere-title").textContent = title;
    element("sphere-bands").hidden = low !== "";
    element("sphere-scale").hidden = low === "";
    element("sphere-low").textContent = low;
    element("sphere-high").textContent = high;
    ready = true;
    redraw();
  };
  const { zoomBy } = webgl.moved(canvas, camera, redraw);
  element("sphere-nearer").addEventListener("click", () => zoomBy(1.2));
  element("sphere-farther").addEventListener("click", () => zoomBy(1 / 1.2));
  const chooser = element("sphere-choice");
  chooser.addEventListener("input", () => choose(Number(chooser.value)));
  element("sphere-hint").hidden = true;
  for (const part of ["sphere-controls", "sphere-view"]) element(part).hidden = false;
  choose(Number(chooser.value));
})();
