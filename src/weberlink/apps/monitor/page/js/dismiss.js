// Help is shown while its button is pointed at, pressed or focused; Escape closes it (WCAG 1.4.13).

const SHOWN = ".help:is(:hover, :focus-visible, :active)";

addEventListener("keydown", ({ key }) => {
  if (key === "Escape") for (const button of document.querySelectorAll(SHOWN)) button.classList.add("closed");
});
for (const again of ["pointerover", "focusin", "click"])
  addEventListener(again, ({ target }) => target.closest?.(".help")?.classList.remove("closed"));
