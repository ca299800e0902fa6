// The colours of the style sheet, for what is drawn on a canvas; light or dark, as the system or the person prefers.

const NAMES = [
  "grid",
  "text",
  "quiet",
  "master",
  "slave",
  "packets",
  "zone",
  "zone-fill",
  "model",
  "good",
  "warn",
  "bad",
  "third",
  "solid",
  "floor",
  "wire",
];

const KEPT_AS = "weberlink-theme";

export const theme = {};
const listeners = [];
const probe = document.createElement("i");

// A colour that depends on the scheme is computed only where it is the colour of an element.
function readTheme() {
  document.documentElement.append(probe);
  for (const name of NAMES) {
    probe.style.color = `var(--${name})`;
    theme[name] = getComputedStyle(probe).color;
  }
  probe.remove();
  theme.font = "11px system-ui, 'Segoe UI', Roboto, 'DejaVu Sans', sans-serif";
}

export function onThemeChange(act) {
  listeners.push(act);
}

function changed() {
  readTheme();
  for (const act of listeners) act();
}

export const chosenTheme = () => document.documentElement.dataset.theme ?? "auto";

// "auto" follows the system. Kept by the browser, where it permits that.
export function chooseTheme(name) {
  if (name === "light" || name === "dark") document.documentElement.dataset.theme = name;
  else delete document.documentElement.dataset.theme;
  try {
    localStorage.setItem(KEPT_AS, chosenTheme());
  } catch {
    // a browser without storage
  }
  changed();
}

function kept() {
  try {
    return localStorage.getItem(KEPT_AS);
  } catch {
    return null;
  }
}

matchMedia("(prefers-color-scheme: dark)").addEventListener("change", changed);
chooseTheme(kept());
