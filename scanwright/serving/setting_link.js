// The setting of the page in its address: `#angles=...` follows the page, and a link that has one sets it once.
// An element of class sw-setting holds the setting; the field named "angles [deg]" takes one.
(() => {
  let wanted = new URLSearchParams(location.hash.slice(1)).get("angles");

  const look = () => {
    const setting = document.querySelector(".sw-setting");
    const input = document.querySelector('input[aria-label="angles [deg]"]');
    if (!setting || !input) return;
    if (wanted) {
      const set = Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, "value").set;
      input.focus();
      set.call(input, wanted); // React sees it as typed
      input.dispatchEvent(new Event("input", { bubbles: true }));
      wanted = null;
      setTimeout(() => input.blur(), 200); // once it is drawn: what is left is taken
      return;
    }
    const hash = `#angles=${setting.dataset.angles}`;
    if (location.hash !== hash) history.replaceState(null, "", location.pathname + location.search + hash);
  };
  new MutationObserver(look).observe(document, { childList: true, subtree: true, attributeFilter: ["data-angles", "aria-label"] });
  addEventListener("click", ({ target }) => {
    const button = target instanceof Element && target.closest("button");
    if (button && button.textContent.trim() === "Copy link") navigator.clipboard?.writeText(location.href);
  }, true);
})();
