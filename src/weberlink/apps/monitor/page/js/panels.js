// What each chart shows: one table. A value is a function of the columns of a ring and a row.

import { AS, three } from "./format.js";

const norm =
  (v, factor = 1) =>
  (c, i) => {
    const x = c[`${v}_x`],
      y = c[`${v}_y`],
      z = c[`${v}_z`];
    return x ? factor * Math.sqrt(x[i] * x[i] + y[i] * y[i] + z[i] * z[i]) : NaN;
  };
const axis =
  (v, name, factor = 1) =>
  (c, i) =>
    c[`${v}_${name}`] ? factor * c[`${v}_${name}`][i] : NaN;
export const column =
  (name, factor = 1) =>
  (c, i) =>
    c[name] ? factor * c[name][i] : NaN;
const component = (v, which, factor = 1) => (which === "norm" ? norm(v, factor) : axis(v, which, factor));
export const where = (test, value) => (c, i) => (test(c, i) ? value(c, i) : NaN);
export const sent =
  (stream = "") =>
  (c, i) =>
    c[`${stream}sent`] && c[`${stream}sent`][i] > 0;
// From 10 up, where the chart begins: 0 has no logarithm.
const logarithmic = (name) => (c, i) => (c[name] ? Math.max(10, c[name][i]) : NaN);
const missed = (c, i) => c.ticks_missed && i > 0 && c.ticks_missed[i] > c.ticks_missed[i - 1];

// Round bounds that rarely change: they hold the data and at least `least`, and begin at 0 without negative data.
function roundUp(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return [1, 1.5, 2, 3, 4, 5, 6, 8, 10].map((f) => f * power).find((step) => step >= value * 0.999);
}
export const upward = (least) => (low, high) => [0, roundUp(Math.max(least, 1.04 * high))];
const around = (least) => (low, high) => {
  const top = roundUp(Math.max(least, 1.04 * Math.max(Math.abs(low), Math.abs(high))));
  return [low < 0 ? -top : 0, high > 0 || low >= 0 ? top : 0];
};

// Measured and felt signal of a stream: the force, or the torque of the rotation. The measured one is wider and below,
// so that both are visible where they agree.
const felt =
  (stream, unit, factor = 1) =>
  (which) => {
    const raw = component(`${stream}raw`, which, factor);
    const bound = column(`${stream}bound`, factor);
    const low = (c, i) => raw(c, i) - bound(c, i);
    const floor = which === "norm" ? (c, i) => Math.max(0, low(c, i)) : low;
    return [
      {
        ring: "slave",
        series: [
          { name: "measured", colour: "slave", width: 5, alpha: 0.5, of: raw, unit },
          { name: "", hidden: true, of: (c, i) => raw(c, i) + bound(c, i) },
          { name: "", hidden: true, of: floor },
        ],
      },
      {
        ring: "master",
        series: [{ name: "felt", colour: "master", width: 1.75, of: component(`${stream}output`, which, factor), unit }],
      },
      { ring: "slave", series: [{ name: "packet", colour: "packets", dots: 8, of: where(sent(stream), raw) }] },
    ];
  };

// Pose of the hand and commanded pose of the robot, of a stream: the position, or the orientation of the rotation.
const moved =
  (stream, hand, robot, unit, factor) =>
  (which) => [
    {
      ring: "slave",
      series: [
        {
          name: robot,
          colour: "slave",
          width: 5,
          alpha: 0.5,
          of: component(`${stream}output`, which, factor),
          unit,
          digits: 1,
        },
      ],
    },
    {
      ring: "master",
      series: [
        { name: "hand", colour: "master", width: 1.75, of: component(hand, which, factor), unit, digits: 1 },
        { name: "packet", colour: "packets", poles: 0.07, of: where(sent(stream), () => 0), mark: true },
      ],
    },
  ];

export const PANELS = [
  {
    name: "force",
    title: "Force",
    unit: "N",
    choices: ["norm", "x", "y", "z"],
    choice: "norm",
    help:
      "Force measured by the robot, and force felt by the operator. Within the green deadband around the measured force a " +
      "difference is too small to be noticed, so nothing is sent; each dot is a packet.",
    empty: "needs a session in contact",
    sources: felt("", "N"),
    band: [2, 3],
    range: (which) => (which === "norm" ? upward(1) : around(0.5)),
    axis: (v) => `${v} N`,
  },
  {
    name: "torque",
    title: "Torque",
    unit: "mN m",
    choices: ["norm", "x", "y", "z"],
    choice: "norm",
    help:
      "The torque about the tip of the tool: measured at the robot, and felt by the operator. It has a deadband and " +
      "packets of its own.",
    empty: "needs a session in contact",
    sources: felt("rotation_", "mN m", 1e3),
    band: [2, 3],
    range: (which) => (which === "norm" ? upward(20) : around(10)),
    axis: (v) => `${v}`,
  },
  {
    name: "felt",
    title: "Felt error",
    unit: "deadbands",
    help:
      "Difference between the felt force and the force that the robot measured, in units of the deadband: in " +
      "the green zone it is within.",
    empty: "needs both sides of the session on this host",
    sources: () => [
      { ring: "felt", series: [{ name: "error", colour: "third", width: 1.5, of: column("deadbands"), unit: "deadbands" }] },
    ],
    zone: [0, 1],
    range: () => (low, high) => [0, Math.min(6, roundUp(Math.max(2, 1.04 * high)))],
    axis: (v) => `${v}`,
  },
  {
    name: "position",
    title: "Position",
    unit: "mm",
    choices: ["x", "y", "z"],
    choice: "z",
    help: "Position of the operator's hand, and commanded position of the robot. Each stroke at the bottom is a packet.",
    empty: "no samples yet",
    sources: moved("", "position", "robot", "mm", 1e3),
    range: () => (low, high) => padded(low, high, 5),
    axis: (v) => `${v} mm`,
  },
  {
    name: "orientation",
    title: "Orientation",
    unit: "°",
    choices: ["norm", "x", "y", "z"],
    choice: "norm",
    help:
      "Orientation of hand and tool, as a rotation vector from level. Each stroke at the bottom is a packet of the " +
      "rotation.",
    empty: "no samples yet",
    sources: moved("rotation_", "rotation_raw", "tool", "°", 180 / Math.PI),
    range: (which) => (which === "norm" ? upward(10) : (low, high) => padded(low, high, 5)),
    axis: (v) => `${v}°`,
  },
  {
    name: "packets",
    title: "Packets",
    unit: "/s, % saved",
    help:
      "Samples that crossed the network in the last second; the right scale is what that saves against one packet " +
      "per sample. The dotted lines are all datagrams of each side, heartbeats included.",
    empty: "no samples yet",
    sources: () => [
      {
        ring: "slaveRates",
        series: [
          { name: "force", colour: "slave", width: 2, of: column("updates"), unit: "/s", digits: 0 },
          { name: "", colour: "quiet", width: 1, of: column("datagrams"), dash: [2, 3] },
        ],
      },
      {
        ring: "masterRates",
        series: [
          { name: "position", colour: "master", width: 2, of: column("updates"), unit: "/s", digits: 0 },
          { name: "all", colour: "quiet", width: 1, of: column("datagrams"), dash: [2, 3] },
        ],
      },
    ],
    range: () => upward(20),
    axis: (v) => `${v} /s`,
    right: (v, store) => `${+(100 * (1 - v / store.rate)).toFixed(1)} %`,
  },
  {
    name: "delay",
    title: "Delay",
    unit: "ms",
    help: "Round trip, one way, and jitter: by how much few datagrams exceed their least delay, in the worse direction.",
    empty: "no round trip measured yet",
    sources: () => [
      {
        ring: "master",
        series: [
          { name: "round trip", colour: "master", width: 1.75, of: column("rtt_us", 1e-3), unit: "ms" },
          { name: "one way", colour: "third", width: 1.5, of: column("one_way_us", 1e-3), unit: "ms" },
          { name: "jitter", colour: "quiet", width: 1.25, dash: [4, 3], of: column("jitter_us", 1e-3), unit: "ms" },
        ],
      },
    ],
    alone: "slave",
    range: () => upward(0.5),
    axis: (v) => `${v} ms`,
  },
  {
    name: "ticks",
    title: "Ticks",
    unit: "",
    help:
      "How late ticks of the loop began and how long they took: the maximum per 0.1 s of the ticks sent to this page, " +
      "on a logarithmic scale. The horizontal line is the tick period; a missed tick is red.",
    empty: "no samples yet",
    log: true,
    sources: () =>
      ["master", "slave"].flatMap((side) => [
        {
          ring: `${side}Rates`,
          series: [
            { name: "late", colour: side, width: 1.75, of: logarithmic("late_us"), unit: "µs", digits: 0 },
            {
              name: "work",
              colour: side,
              width: 1.25,
              alpha: 0.6,
              dash: [4, 3],
              of: logarithmic("work_us"),
              faint: true,
            },
          ],
        },
        {
          ring: side,
          series: [
            { name: side === "slave" ? "missed" : "", colour: "bad", poles: 1, of: where(missed, () => 1), mark: true },
          ],
        },
      ]),
    line: (store) => 1e6 / store.rate,
    range: () => () => [10, 1e4],
    axis: (v) => (v >= 1000 ? `${v / 1000} ms` : `${v} µs`),
    splits: [10, 100, 1000, 10000],
  },
  {
    name: "energy",
    title: "Energy account",
    unit: "mJ",
    help:
      "Energy that the display may still give to the hand. What is displayed shrinks as it runs out, which keeps a " +
      "delayed link stable.",
    empty: "no samples yet",
    sources: () => [
      { ring: "master", series: [{ name: "left", colour: "master", width: 1.75, of: column("energy", 1e3), unit: "mJ" }] },
    ],
    quietNote: (store) => (store.hello?.scheme === "none" ? "no account: the control scheme is none" : ""),
    range: () => upward(1),
    axis: (v) => `${v} mJ`,
  },
];

export function padded(low, high, least) {
  const middle = (low + high) / 2;
  const half = Math.max(least, (high - low) / 2) * 1.1;
  const step = roundUp(half / 4);
  return [Math.floor((middle - half) / step) * step, Math.ceil((middle + half) / step) * step];
}

export function amount(value, { digits, unit }) {
  if (!Number.isFinite(value)) return "–";
  const number = digits === 0 ? AS.count(Math.round(value)) : digits === 1 ? AS.number1(value) : three(value);
  return `${number} ${unit}`;
}
