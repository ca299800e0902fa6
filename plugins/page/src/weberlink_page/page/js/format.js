// Numbers as text. The exact number is beside it, in data-value.

const UNKNOWN = "–";
const DEGREES = 180 / Math.PI;

const known = (value) => value !== null && value !== undefined && Number.isFinite(value);
const fixed = (value, digits) => value.toFixed(digits).replace("-", "\u2212");
const number = (digits, unit = "", factor = 1) => (v) => known(v) ? fixed(factor * v, digits) + unit : UNKNOWN;

// Three significant digits, without an exponent.
export function three(value) {
  if (!known(value)) return UNKNOWN;
  const size = Math.abs(value);
  return fixed(value, size >= 99.95 ? 0 : size >= 9.995 ? 1 : 2);
}

export const AS = {
  count: (v) => (known(v) ? v.toLocaleString("en").replace(/,/g, "\u202f") : UNKNOWN),
  number1: number(1),
  number2: number(2),
  number3: number(3),
  pace: (v) => (known(v) ? fixed(v, v < 9.95 ? 1 : 0) : UNKNOWN),
  rate: number(1, " /s"),
  percent: number(1, " %", 100),
  percent2: number(2, " %", 100),
  milli: (v) => three(known(v) ? v / 1000 : NaN),
  ms: (v) => (known(v) ? `${three(v / 1000)} ms` : UNKNOWN),
  us: number(0, " µs"),
  mm: number(3, " mm", 1000),
  mnm: number(2, " mN\u202fm", 1000),
  mnm1: number(1, " mN\u202fm", 1000),
  degrees: number(3, "°", DEGREES),
  degrees1: number(1, "°", DEGREES),
  newton: number(3, " N"),
};

// The value of a series of a chart.
export function amount(value, { digits, unit }) {
  if (!known(value)) return UNKNOWN;
  return `${digits === 0 ? AS.count(Math.round(value)) : digits === 1 ? AS.number1(value) : three(value)} ${unit}`;
}

// Numbers in a record that the greeting does not name.
export const ENGAGED = 4; // of `state`
export const RELEASED = 2; // of `ramping`: the operator does not hold the button that lets the robot follow
export const modelName = (kind) => ["hold", "line", "plane", "sphere"][kind] ?? "unknown";
