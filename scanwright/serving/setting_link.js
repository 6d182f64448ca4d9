// The angles of the page: `#angles=...` in the address follows them, and a link with angles sets them once. Dots on pads
// (`.sw-pad`: two of the four angles, from `data-first` on) are dragged or moved by arrow keys.
(() => {
  let wanted = new URLSearchParams(location.hash.slice(1)).get("angles");
  let shown = null; // angles of the page before the link
  let tries = 0;
  let held = null; // the pad on which a pointer is down,
  let box = null; // and its place then: lines above it may change
  let angles = [];
  let waits = false;

  const send = () => {
    waits = false;
    const uuid = document.querySelector(".sw-setting").dataset.field;
    window.__viserMutable.sendMessage({ type: "GuiUpdateMessage", uuid, updates: { value: angles.join(",") } });
  };
  // viser ignores what a page sends before the server knows its camera
  const request = () => {
    if (!wanted) return;
    angles = wanted.split(",");
    send();
    if (++tries < 20) setTimeout(request, 250);
    else wanted = null;
  };
  const place = (pad) => {
    const [x, y] = angles.slice(pad.dataset.first);
    const dot = pad.querySelector(".sw-dot");
    dot.style.left = `${50 * (1 + x / pad.dataset.x)}%`;
    dot.style.top = `${50 * (1 - y / pad.dataset.y)}%`;
  };
  const move = (pad, pair) => {
    const bounds = [Number(pad.dataset.x), Number(pad.dataset.y)];
    pair.forEach((angle, k) => (angles[Number(pad.dataset.first) + k] = Number(Math.max(-bounds[k], Math.min(bounds[k], angle)).toFixed(2))));
    place(pad);
    if (!waits) requestAnimationFrame(send);
    waits = true;
  };
  const follow = ({ clientX, clientY }) => {
    const { left, top, width, height } = box;
    move(held, [((2 * (clientX - left)) / width - 1) * held.dataset.x, (1 - (2 * (clientY - top)) / height) * held.dataset.y]);
  };

  const update = () => {
    const setting = document.querySelector(".sw-setting");
    if (!setting) return;
    if (wanted) {
      shown ??= setting.dataset.angles;
      if (setting.dataset.angles === shown) {
        if (!tries) request();
        return;
      }
      wanted = null;
    }
    if (held || waits) return; // what arrives is of an earlier place
    angles = setting.dataset.angles.split(",").map(Number);
    for (const pad of document.querySelectorAll(".sw-pad")) place(pad);
    const hash = `#angles=${setting.dataset.angles}`;
    if (location.hash !== hash) history.replaceState(null, "", location.pathname + location.search + hash);
  };
  new MutationObserver(update).observe(document, { childList: true, subtree: true, attributeFilter: ["data-angles"] });

  const on = (name, act) => addEventListener(name, (event) => event.target instanceof Element && act(event, event.target), true);
  on("pointerdown", (event, target) => {
    held = target.closest(".sw-pad");
    if (!held) return;
    box = held.getBoundingClientRect();
    event.preventDefault(); // no drag of the picture
    held.querySelector(".sw-dot").focus();
    held.setPointerCapture(event.pointerId);
    follow(event);
  });
  on("pointermove", (event) => held && follow(event));
  for (const event of ["pointerup", "pointercancel"]) on(event, () => (held = null));
  on("keydown", (event, target) => {
    const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
    if (!step || !target.matches(".sw-dot")) return;
    event.preventDefault();
    event.stopImmediatePropagation(); // the view uses arrow keys too
    const pad = target.closest(".sw-pad");
    const first = Number(pad.dataset.first);
    move(pad, step.map((part, k) => angles[first + k] + part * (event.shiftKey ? 0.1 : 1)));
  });
  on("click", (_, target) => {
    if (target.closest("button")?.textContent.trim() === "Copy link") navigator.clipboard?.writeText(location.href);
  });
})();
