// Accessibility of viser's page: names for controls, one landmark, and focus for what scrolls.
(() => {
  const dark = matchMedia("(prefers-color-scheme: dark)");
  window.__VISER_EMBED_CONFIG__ = { darkMode: dark.matches };
  dark.addEventListener("change", () => location.reload());

  const set = (element, name, value) => {
    if (value && element.getAttribute(name) !== value) element.setAttribute(name, value);
  };

  // a slider and its number share a label, which belongs to neither
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
    for (const button of document.querySelectorAll("button:not([aria-label])")) {
      if (button.textContent.trim()) continue;
      const closes = button.closest(".mantine-Notification-root");
      const name = button.querySelector(".tabler-icon-list-search") ? "Commands" : "Settings of the view";
      set(button, "aria-label", closes ? "Close" : name);
    }
  };

  // on a phone the view ends at the sheet
  const sheetHeight = new ResizeObserver(([sheet]) => {
    const covered = sheet.target.isConnected ? sheet.target.offsetHeight : 0;
    document.documentElement.style.setProperty("--sw-sheet", `${covered}px`);
  });

  // Ctrl-Z in a field without typed text is for the page
  const undoes = (event) => (event.ctrlKey || event.metaKey) && event.key.toLowerCase() === "z";
  let typed = false;
  addEventListener("input", ({ target }) => (typed = target.type !== "checkbox"), true);
  addEventListener("focusin", () => (typed = false), true);
  addEventListener(
    "keydown",
    (event) => {
      if (event.key === "Enter") typed = false;
      if (!undoes(event) || typed || !(event.target instanceof HTMLInputElement)) return;
      event.preventDefault();
      event.stopImmediatePropagation();
      document.documentElement.dispatchEvent(new KeyboardEvent("keydown", event));
    },
    true,
  );

  const update = () => {
    const root = document.getElementById("root");
    if (!root) return;
    set(root, "role", "main");
    nameRows();
    nameButtons();
    for (const bar of document.querySelectorAll('[role="progressbar"]')) set(bar, "aria-label", "Progress");
    for (const canvas of document.querySelectorAll("canvas[data-engine]")) {
      canvas.closest('[style*="z-index: 0"]')?.classList.add("sw-view");
      set(canvas, "role", "img");
      set(canvas, "aria-label", `${document.title}: 3D view; drag to turn, wheel to come nearer`);
    }
    for (const viewport of document.querySelectorAll(".mantine-ScrollArea-viewport"))
      if (viewport.scrollHeight > viewport.clientHeight) set(viewport, "tabindex", "0");
    for (const paper of document.querySelectorAll(".mantine-Paper-root"))
      if (paper.style.position === "fixed" && paper.style.bottom === "0px" && !paper.matches(".sw-sheet")) {
        paper.classList.add("sw-sheet");
        sheetHeight.observe(paper);
      }
  };

  new MutationObserver(update).observe(document, { childList: true, subtree: true });
})();
