// What the charts of the whole session show: one table, as that of the last seconds.

import { column, upward } from "./panels.js";

const of = (series, unit) => [{ ring: "history", series: series.map((each) => ({ width: 1.75, unit, ...each })) }];
const EMPTY = "no history yet";

export const HISTORY = [
  {
    name: "history-force",
    title: "Largest force",
    unit: "N",
    help: "The largest force felt in each interval, over the whole session.",
    empty: EMPTY,
    sources: () => of([{ name: "force", colour: "master", of: column("force_max") }], "N"),
    range: () => upward(1),
    axis: (v) => `${v} N`,
  },
  {
    name: "history-torque",
    title: "Largest torque",
    unit: "N m",
    help: "The largest torque felt at an axis of the leader in each interval, over the whole session.",
    empty: EMPTY,
    sources: () => of([{ name: "torque", colour: "master", of: column("force_max") }], "N m"),
    range: () => upward(0.1),
    axis: (v) => `${v}`,
  },
  {
    name: "history-felt",
    title: "Largest felt error",
    unit: "deadbands",
    help: "The largest felt error in each interval. Up to 1 deadband it is taken as unnoticeable.",
    empty: EMPTY,
    zone: [0, 1],
    sources: () => of([{ name: "felt error", colour: "zone", of: column("felt_max") }], ""),
    range: () => upward(2),
    axis: (v) => `${v}`,
  },
  {
    name: "history-packets",
    title: "Packets",
    unit: "/s",
    help: "Samples of both sides that crossed the network, per second.",
    empty: EMPTY,
    sources: () => of([{ name: "packets", colour: "packets", of: column("packets"), digits: 1 }], "/s"),
    range: () => upward(20),
    axis: (v) => `${v} /s`,
  },
  {
    name: "history-delay",
    title: "Round trip",
    unit: "ms",
    help: "The round trip, over the whole session.",
    empty: EMPTY,
    sources: () => of([{ name: "round trip", colour: "third", of: column("rtt_ms") }], "ms"),
    range: () => upward(0.5),
    axis: (v) => `${v} ms`,
  },
  {
    name: "history-missed",
    title: "Missed ticks",
    unit: "",
    help: "Ticks that began a whole period late or more, in each interval.",
    empty: EMPTY,
    sources: () => of([{ name: "missed", colour: "bad", of: column("missed"), digits: 0 }], ""),
    range: () => upward(5),
    axis: (v) => `${v}`,
  },
];
