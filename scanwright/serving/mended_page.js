// viser's page for those who hear it or have no mouse: names for what has none, one landmark, and focus for what scrolls.
// The page is React's and changes at any time; it never takes back an attribute that it did not set.
(() => {
  // as dark as the person has it everywhere else; viser asks for this once, before it draws
  const dark = matchMedia("(prefers-color-scheme: dark)");
  window.__VISER_EMBED_CONFIG__ = { darkMode: dark.matches };
  dark.addEventListener("change", () => location.reload());

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
    for (const button of document.querySelectorAll("button:not([aria-label])")) {
      if (button.textContent.trim()) continue;
      const closes = button.closest(".mantine-Notification-root");
      const name = button.querySelector(".tabler-icon-list-search") ? "Commands" : "Settings of the view";
      set(button, "aria-label", closes ? "Close" : name);
    }
  };

  // on a phone the view ends where the sheet begins, so that its middle is seen
  const sheetHeight = new ResizeObserver(([sheet]) => {
    const covered = sheet.target.isConnected ? sheet.target.offsetHeight : 0;
    document.documentElement.style.setProperty("--sw-sheet", `${covered}px`);
  });

  // Ctrl-Z in a field where nothing was typed since Enter has nothing to take back there: it is meant for the page
  const undoes = (told) => (told.ctrlKey || told.metaKey) && told.key.toLowerCase() === "z";
  let typed = false;
  addEventListener("input", ({ target }) => (typed = target.type !== "checkbox"), true);
  addEventListener("focusin", () => (typed = false), true);
  addEventListener(
    "keydown",
    (told) => {
      if (told.key === "Enter") typed = false;
      if (!undoes(told) || typed || !(told.target instanceof HTMLInputElement)) return;
      told.preventDefault();
      told.stopImmediatePropagation();
      document.documentElement.dispatchEvent(new KeyboardEvent("keydown", told));
    },
    true,
  );

  const mend = () => {
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

  // before the next frame, so that nobody meets a control without its name
  new MutationObserver(mend).observe(document, { childList: true, subtree: true });
})();
