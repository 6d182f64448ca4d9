// A banner over the view with the text of the hidden element `.sw-state`, or of `data-lost` if the connection breaks.
(() => {
  const banner = document.createElement("div");
  banner.className = "sw-banner";
  banner.setAttribute("role", "alert");
  banner.tabIndex = 0; // long words scroll
  document.addEventListener("DOMContentLoaded", () => document.body.append(banner));

  const show = (kind, words) => {
    if (banner.dataset.kind === kind && banner.textContent === words) return;
    banner.dataset.kind = kind;
    banner.textContent = words;
  };

  let connected = true;
  let lost = "";
  const update = () => {
    const state = document.querySelector(".sw-state");
    if (!state || !connected) return;
    lost = state.dataset.lost;
    show(state.dataset.kind, state.textContent);
  };
  const watched = { childList: true, subtree: true, characterData: true, attributeFilter: ["data-kind", "data-lost"] };
  new MutationObserver(update).observe(document, watched);

  // viser's websocket lives in a worker, which reports when it opens and closes
  window.Worker = class extends window.Worker {
    constructor(...words) {
      super(...words);
      this.addEventListener("message", ({ data }) => {
        if (data?.type === "connected") connected = true;
        if (data?.type !== "closed") return;
        connected = false;
        if (lost) show("lost", lost);
      });
    }
  };
})();
