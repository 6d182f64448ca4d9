// The active brush: a ring under the pointer, the edge of what a touch paints on the walls, and a line that names the
// mode. Both come from an element of class sw-brush in the panel; the camera is the one that viser exposes for its tests.
(() => {
  const CORNERS = 72;
  const NAMESPACE = "http://www.w3.org/2000/svg";
  const pointer = { x: 0, y: 0, over: false };

  const ring = document.createElementNS(NAMESPACE, "svg");
  ring.setAttribute("class", "sw-ring");
  ring.setAttribute("aria-hidden", "true");
  const lines = ["sw-ring-halo", "sw-ring-line"].map((name) => {
    const path = document.createElementNS(NAMESPACE, "path");
    path.setAttribute("class", name);
    return ring.appendChild(path);
  });
  const mode = document.createElement("div");
  mode.className = "sw-mode";
  mode.setAttribute("role", "status");
  document.addEventListener("DOMContentLoaded", () => document.body.append(ring, mode));

  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const unit = (a) => a.map((x) => x / Math.sqrt(dot(a, a)));
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

  // The direction to the wall that a ray meets last; null if it misses the room.
  const hit = (eye, along, low, high) => {
    const ends = eye.map((x, k) => [(low[k] - x) / along[k], (high[k] - x) / along[k]].sort((a, b) => a - b));
    const distance = Math.min(...ends.map(([, far]) => far));
    return Math.max(0, ...ends.map(([near]) => near)) < distance ? unit(eye.map((x, k) => x + distance * along[k])) : null;
  };

  // The edge of the cone about a direction on the walls, in pixels of the window; null if it is not in view.
  const outline = (brush, rect) => {
    const { camera, nodeRefFromName } = window.__viserMutable;
    const world = nodeRefFromName[""];
    const vector = camera.position.clone();
    const local = (v) => world.worldToLocal(v).toArray();
    const eye = local(vector.setFromMatrixPosition(camera.matrixWorld));
    const across = (2 * (pointer.x - rect.left)) / rect.width - 1;
    const up = 1 - (2 * (pointer.y - rect.top)) / rect.height;
    const seen = local(vector.set(across, up, 0.5).unproject(camera));
    const [low, high] = [brush.dataset.low, brush.dataset.high].map((corner) => corner.split(",").map(Number));
    const middle = hit(eye, seen.map((x, k) => x - eye[k]), low, high);
    if (!middle) return null;
    const half = (Number(brush.dataset.radiusDeg) * Math.PI) / 180;
    const side = unit(cross(middle, Math.abs(middle[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0]));
    const other = cross(middle, side);
    const corners = [];
    for (let k = 0; k < CORNERS; k++) {
      const turn = (2 * Math.PI * k) / CORNERS;
      const edge = middle.map(
        (x, i) => x * Math.cos(half) + (side[i] * Math.cos(turn) + other[i] * Math.sin(turn)) * Math.sin(half),
      );
      const away = Math.min(...edge.map((x, k) => (x > 0 ? high[k] : low[k]) / (x || -1e-12)));
      world.localToWorld(vector.fromArray(edge.map((x) => away * x))).project(camera);
      corners.push([rect.left + ((1 + vector.x) / 2) * rect.width, rect.top + ((1 - vector.y) / 2) * rect.height]);
    }
    return corners;
  };

  const draw = () => {
    const brush = document.querySelector(".sw-brush");
    const words = brush ? brush.textContent : "";
    if (mode.textContent !== words) mode.textContent = words;
    const canvas = document.querySelector("canvas[data-engine]");
    const corners = brush && canvas && pointer.over && outline(brush, canvas.getBoundingClientRect());
    ring.dataset.brush = brush ? brush.dataset.brush : "";
    const path = corners ? `M${corners.map((at) => at.map((x) => x.toFixed(1)).join(" ")).join("L")}Z` : "";
    for (const line of lines) line.setAttribute("d", path);
  };
  let waits = false;
  const soon = () => {
    if (waits) return;
    waits = true;
    requestAnimationFrame(() => {
      waits = false;
      draw();
    });
  };

  for (const event of ["pointermove", "pointerdown", "pointerup", "pointercancel"])
    window.addEventListener(
      event,
      (told) => {
        const lifted = told.pointerType === "touch" && (event === "pointerup" || event === "pointercancel");
        const onView = told.target instanceof Element && told.target.closest(".sw-view") !== null;
        Object.assign(pointer, { x: told.clientX, y: told.clientY, over: onView && !lifted });
        soon();
      },
      { capture: true, passive: true },
    );
  window.addEventListener("wheel", () => setTimeout(soon, 100), { capture: true, passive: true });
  new MutationObserver((changes) => {
    if (changes.some((change) => change.target !== mode && !ring.contains(change.target))) soon();
  }).observe(document, { childList: true, subtree: true });
})();
