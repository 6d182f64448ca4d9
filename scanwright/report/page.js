"use strict";
// on paper nothing is folded; what is for the screen only is not there
const folded = () => [...document.querySelectorAll("details:not([open]):not(.screen)")];
let opened = [];
window.addEventListener("beforeprint", () => {
  opened = folded();
  opened.forEach((details) => (details.open = true));
});
window.addEventListener("afterprint", () => opened.forEach((details) => (details.open = false)));
