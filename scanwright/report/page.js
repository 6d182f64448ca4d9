"use strict";
document.documentElement.classList.add("scripts");

// Ticks: of this task, kept by the browser; a page in private mode or in a frame may have no storage.
for (const [number, tick] of document.querySelectorAll(".tick input").entries()) {
  const key = `scanwright ${document.body.dataset.task} ${tick.ariaLabel ?? number}`;
  try {
    tick.checked = localStorage.getItem(key) === "1";
    tick.addEventListener("input", () => localStorage.setItem(key, tick.checked ? "1" : "0"));
  } catch {
    document.querySelector("#do .scripted").textContent = "This browser does not remember ticks here.";
  }
}

// The assembly one step at a time; a link to a step opens it.
(() => {
  const element = (id) => document.getElementById(id);
  const steps = [...document.querySelectorAll(".step")];
  if (!steps.length) return;
  let at = 0;
  const go = (number) => {
    at = Math.min(steps.length - 1, Math.max(0, number));
    steps.forEach((step, i) => (step.hidden = i !== at));
    element("progress").value = at + 1;
    element("at-step").textContent = `${at + 1} of ${steps.length}`;
    element("back").disabled = at === 0;
    element("next").disabled = at === steps.length - 1;
  };
  element("back").addEventListener("click", () => go(at - 1));
  element("next").addEventListener("click", () => go(at + 1));
  const linked = () => Math.max(0, steps.findIndex((step) => `#${step.id}` === location.hash));
  window.addEventListener("hashchange", () => location.hash.startsWith("#step-") && go(linked()));
  go(linked());
})();

// On paper nothing is folded; what is for the screen only is not there.
let opened = [];
window.addEventListener("beforeprint", () => {
  opened = [...document.querySelectorAll("details:not([open]):not(.screen)")];
  opened.forEach((details) => (details.open = true));
});
window.addEventListener("afterprint", () => opened.forEach((details) => (details.open = false)));

// Drawings are inflated when they are first looked at.
for (const details of document.querySelectorAll("details:has([data-packed])")) {
  details.addEventListener("toggle", async () => {
    for (const image of details.querySelectorAll("[data-packed]:not([src])")) image.src = await inflated(image.dataset.packed);
  });
}
