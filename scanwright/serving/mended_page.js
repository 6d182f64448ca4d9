// viser's page for those who hear it or have no mouse: names for what has none, one landmark, and focus for what scrolls.
// The page is React's and changes at any time; it never takes back an attribute that it did not set.
(() => {
  const set = (element, name, value) => {
    if (value && element.getAttribute(name) !== value) element.setAttribute(name, value);
  };

  // a slider and the number beside it stand in one row with one label, which belongs to neither
  const nameRows = () => {
    for (const label of document.querySelectorAll("label[for]")) {
      const row = label.closest(".mantine-Flex-root");
      if (!row) continue;
      const words = label.textContent.trim();
      for (const control of row.querySelectorAll('[role="slider"], input:not([type="hidden"])'))
        if (control.id !== label.htmlFor) set(control, "aria-label", words);
    }
  };

  const nameButtons = () => {
    for (const button of document.querySelectorAll("button:not([aria-label])"))
      if (!button.textContent.trim())
        set(button, "aria-label", button.closest(".mantine-Notification-root") ? "Close" : "Settings of the view");
  };

  const mend = () => {
    const root = document.getElementById("root");
    if (!root) return;
    set(root, "role", "main");
    nameRows();
    nameButtons();
    for (const canvas of document.querySelectorAll("canvas[data-engine]")) {
      set(canvas, "role", "img");
      set(canvas, "aria-label", `${document.title}: 3D view; drag to turn, wheel to come nearer`);
    }
    for (const viewport of document.querySelectorAll(".mantine-ScrollArea-viewport"))
      if (viewport.scrollHeight > viewport.clientHeight) set(viewport, "tabindex", "0");
    for (const paper of document.querySelectorAll(".mantine-Paper-root"))
      if (paper.style.position === "fixed" && paper.style.bottom === "0px") paper.classList.add("sw-sheet");
  };

  // before the next frame, so that nobody meets a control without its name
  new MutationObserver(mend).observe(document, { childList: true, subtree: true });
})();
