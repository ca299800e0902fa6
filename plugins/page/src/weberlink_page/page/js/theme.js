// The colours of the style sheet, for what is drawn on a canvas; light or dark as the system prefers.

const NAMES =
  "grid text quiet master slave packets zone zone-fill model good warn bad third solid floor wire".split(" ");

/** @type {Record<string, string>} */
export const theme = { font: "11px system-ui, 'Segoe UI', Roboto, 'DejaVu Sans', sans-serif" };
const listeners = [];

// Calls `act()` when the colours have changed.
export const onThemeChange = (act) => listeners.push(act);

// A colour that depends on the scheme is computed only where it is the colour of an element.
function read() {
  const probe = document.createElement("i");
  document.documentElement.append(probe);
  for (const name of NAMES) {
    probe.style.color = `var(--${name})`;
    theme[name] = getComputedStyle(probe).color;
  }
  probe.remove();
  for (const act of listeners) act();
}

matchMedia("(prefers-color-scheme: dark)").addEventListener("change", read);
read();
