// The colours of the style sheet, for what is drawn on a canvas; they follow the system's light or dark scheme.

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

export const theme = {};

function readTheme() {
  const style = getComputedStyle(document.documentElement);
  for (const name of NAMES) theme[name] = style.getPropertyValue(`--${name}`).trim();
  theme.font = "11px system-ui, 'Segoe UI', Roboto, 'DejaVu Sans', sans-serif";
}

export function onThemeChange(act) {
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
    readTheme();
    act();
  });
}

readTheme();
