// Draws as many points of a cloud as the computer can: at forty frames a second while the view moves, and more at rest.
// Points of a node below /cloud are in random order, so that the first of them are a thinned cloud.
(() => {
  const MOVING_MS = 25;
  const RESTING_MS = 500;
  const RESTS_AFTER_MS = 200;
  const LEAST_MOVING = 20_000; // points; fewer are hardly faster
  const LEAST_RESTING = 200_000;
  let share = 1; // of the points that are there
  let most = 1; // of them, at rest: what was drawn in time
  let [last, moved, frames, points] = [0, 0, 0, 0];
  let pose = "";

  const line = document.createElement("div");
  line.className = "sw-share";
  document.addEventListener("DOMContentLoaded", () => document.body.append(line));

  const clouds = (nodes) => {
    const found = [];
    for (const [name, node] of Object.entries(nodes))
      if (node && name.startsWith("/cloud/"))
        node.traverse((child) => child.isPoints && child.geometry.attributes.position && found.push(child.geometry));
    return found;
  };

  const pace = (took, moves) => {
    const [goal, least] = moves ? [MOVING_MS, LEAST_MOVING] : [RESTING_MS, LEAST_RESTING];
    if (took > 1.5 * goal) {
      share = Math.min(1, Math.max(share * Math.max(goal / took, 0.1), least / points));
      if (!moves) most = share;
    } else if (moves && took < goal) share = Math.min(1.2 * share, 1);
  };

  const update = (now) => {
    requestAnimationFrame(update);
    const view = window.__viserMutable;
    const drawn = window.__viserTestpoints?.rendererInfo.render;
    if (!view?.camera || !drawn) return;
    const geometries = clouds(view.nodeRefFromName);
    if (!geometries.length) return;
    const there = geometries.reduce((sum, geometry) => sum + geometry.attributes.position.count, 0);
    const before = pose;
    pose = view.camera.matrixWorld.elements.join();
    if (pose !== before) [moved, most] = [now, 1];
    const moves = now - moved < RESTS_AFTER_MS;
    if (there < points || there > 1.5 * points) [points, most] = [there, 1];
    if (drawn.frame !== frames) {
      pace(now - last, moves);
    } else if (!moves && share < most) {
      share = Math.min(2 * share, most);
      view.requestRender();
    }
    [last, frames] = [now, drawn.frame];
    for (const geometry of geometries)
      geometry.setDrawRange(0, share < 1 ? Math.ceil(share * geometry.attributes.position.count) : Infinity);
    const seen = share < 1 && !moves ? `1 of ${Math.round(1 / share)} points shown: this computer cannot draw more at once` : "";
    if (line.textContent !== seen) line.textContent = seen;
  };
  requestAnimationFrame(update);
})();
