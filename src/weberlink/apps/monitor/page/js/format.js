// Numbers as text. The exact number is beside it, in data-value.

const UNKNOWN = "–";
const MINUS = "\u2212";

const known = (value) => value !== null && value !== undefined && Number.isFinite(value);
const fixed = (value, digits) => value.toFixed(digits).replace("-", MINUS);

// Three significant digits, without an exponent.
export function three(value) {
  if (!known(value)) return UNKNOWN;
  const size = Math.abs(value);
  return fixed(value, size >= 99.95 ? 0 : size >= 9.995 ? 1 : 2);
}

export const AS = {
  count: (v) => (known(v) ? v.toLocaleString("en").replace(/,/g, "\u202f") : UNKNOWN),
  number1: (v) => (known(v) ? fixed(v, 1) : UNKNOWN),
  number2: (v) => (known(v) ? fixed(v, 2) : UNKNOWN),
  number3: (v) => (known(v) ? fixed(v, 3) : UNKNOWN),
  pace: (v) => (known(v) ? fixed(v, v < 9.95 ? 1 : 0) : UNKNOWN),
  rate: (v) => (known(v) ? `${fixed(v, 1)} /s` : UNKNOWN),
  percent: (v) => (known(v) ? `${fixed(100 * v, 1)} %` : UNKNOWN),
  percent2: (v) => (known(v) ? `${fixed(100 * v, 2)} %` : UNKNOWN),
  milli: (v) => (known(v) ? three(v / 1000) : UNKNOWN),
  ms: (v) => (known(v) ? `${three(v / 1000)} ms` : UNKNOWN),
  us: (v) => (known(v) ? `${fixed(v, 0)} µs` : UNKNOWN),
  mm: (v) => (known(v) ? `${fixed(1000 * v, 3)} mm` : UNKNOWN),
  mnm: (v) => (known(v) ? `${fixed(1000 * v, 2)} mN\u202fm` : UNKNOWN),
  mnm1: (v) => (known(v) ? `${fixed(1000 * v, 1)} mN\u202fm` : UNKNOWN),
  degrees: (v) => (known(v) ? `${fixed((180 / Math.PI) * v, 3)}°` : UNKNOWN),
  newton: (v) => (known(v) ? `${fixed(v, 3)} N` : UNKNOWN),
};

// Text and exact value of an element; writes to the document only what has changed.
export function show(element, text, value) {
  if (element.textContent !== text) element.textContent = text;
  const exact = value === null || value === undefined || value !== value ? "" : String(value);
  if (element.dataset.value !== exact) element.dataset.value = exact;
}
