// What both 3D pictures of the page are made with: matrices (column by column), WebGL 2 and a camera that goes around.
const webgl = (() => {
  const DEG = Math.PI / 180;
  const FIELD_OF_VIEW = 30 * DEG;

  const product = (a, b) =>
    Array.from({ length: 16 }, (_, i) => [0, 1, 2, 3].reduce((sum, k) => sum + a[4 * k + (i % 4)] * b[4 * (i >> 2) + k], 0));
  const between = (a, b, share) => a.map((value, i) => value + share * (b[i] - value));
  const aboutZ = (angle) => {
    const [c, s] = [Math.cos(angle), Math.sin(angle)];
    return [c, s, 0, 0, -s, c, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];
  };
  // where the camera stands so that a sphere fits into the picture
  const distanceTo = (radius) => radius / Math.sin(FIELD_OF_VIEW / 2);
  const perspective = (aspect, near, far) => {
    // the field of view holds in the narrower direction, so that a phone shows the whole sphere
    const f = Math.min(1, aspect) / Math.tan(FIELD_OF_VIEW / 2);
    return [f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (far + near) / (near - far), -1, 0, 0, (2 * far * near) / (near - far), 0];
  };
  const orbit = ({ yaw, pitch, distance }, centre) => {
    const [cy, sy, cp, sp] = [Math.cos(yaw), Math.sin(yaw), Math.cos(pitch), Math.sin(pitch)];
    const [right, up, back] = [[-sy, cy, 0], [-cy * sp, -sy * sp, cp], [cy * cp, sy * cp, sp]];
    const along = (axis) => -(axis[0] * centre[0] + axis[1] * centre[1] + axis[2] * centre[2]);
    return [0, 1, 2].flatMap((i) => [right[i], up[i], back[i], 0]).concat(along(right), along(up), along(back) - distance, 1);
  };

  // puts a word where a point of the world is, by view and projection in one
  const placed = (mark, both, [x, y, z]) => {
    const [cx, cy, , w] = [0, 1, 2, 3].map((i) => both[i] * x + both[4 + i] * y + both[8 + i] * z + both[12 + i]);
    mark.style.left = `${(50 * (cx / w + 1)).toFixed(2)}%`;
    mark.style.top = `${(50 * (1 - cy / w)).toFixed(2)}%`;
  };

  const bytes = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));

  // kept after drawing, or it would be printed empty; opaque, or the page would shine through what is half transparent
  const started = (canvas) => canvas.getContext("webgl2", { alpha: false, antialias: true, preserveDrawingBuffer: true });

  // a program and its uniforms by name; null where the browser cannot make it
  const program = (gl, vertex, fragment, names) => {
    const made = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(made, shader);
    }
    gl.linkProgram(made);
    if (!gl.getProgramParameter(made, gl.LINK_STATUS)) return null;
    gl.useProgram(made);
    return Object.fromEntries(names.map((name) => [name, gl.getUniformLocation(made, name)]));
  };
  const filled = (gl, target, values, usage = gl.STATIC_DRAW) => {
    const buffer = gl.createBuffer();
    gl.bindBuffer(target, buffer);
    gl.bufferData(target, values, usage);
    return buffer;
  };
  // positions are attribute 0
  const shape = (gl, vertices, indices) => {
    const array = gl.createVertexArray();
    gl.bindVertexArray(array);
    filled(gl, gl.ARRAY_BUFFER, vertices);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
    if (indices) filled(gl, gl.ELEMENT_ARRAY_BUFFER, indices);
    return array;
  };
  // what a page's style says that is behind the picture, which may be dark
  const ground = (canvas) => getComputedStyle(canvas).backgroundColor.match(/\d+/g).slice(0, 3).map((part) => part / 255);
  const ink = (canvas) => getComputedStyle(canvas).color.match(/\d+/g).slice(0, 3).map((part) => part / 255);

  // an empty picture as large as the canvas is shown (a hidden one keeps its size), and its width over its height
  const cleared = (gl) => {
    const canvas = gl.canvas;
    const scale = Math.min(2, window.devicePixelRatio || 1);
    const [width, height] = [canvas.clientWidth, canvas.clientHeight].map((side) => Math.max(1, Math.round(side * scale)));
    if (canvas.clientWidth && (canvas.width !== width || canvas.height !== height)) {
      canvas.width = width;
      canvas.height = height;
    }
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(...ground(canvas), 1);
    gl.depthMask(true); // before clearing: a depth that is not written is not cleared either
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.disable(gl.BLEND);
    return canvas.width / canvas.height;
  };

  // calls `draw(now)` once for any number of requests before the next frame
  const onceAFrame = (draw) => {
    let waiting = false;
    const frame = (now) => {
      waiting = false;
      draw(now);
    };
    return () => {
      if (waiting) return;
      waiting = true;
      window.requestAnimationFrame(frame);
    };
  };

  // mouse, fingers, wheel and keys move the camera { yaw, pitch, zoom }
  const moved = (canvas, camera, redraw) => {
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
    new ResizeObserver(redraw).observe(canvas);
    for (const query of ["(prefers-color-scheme: dark)", "print"]) {
      window.matchMedia(query).addEventListener("change", redraw);
    }
    return { zoomBy };
  };

  return { DEG, product, between, aboutZ, distanceTo, perspective, orbit, placed, bytes, started, program, filled, shape, ink, cleared, onceAFrame, moved };
})();
