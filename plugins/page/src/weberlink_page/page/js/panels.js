// What each chart shows: one table. A value is a function of the columns of a ring and a row.

const DEGREES = 180 / Math.PI;
const NORM_XYZ = ["norm", "x", "y", "z"];
const SECOND = "second_"; // begins the names of the columns of a rotation or a gripper

export const column = (name, factor = 1) => (c, i) => c[name] ? factor * c[name][i] : NaN;
const norm = (v, first, factor) => (c, i) =>
  c[`${v}_${first}`] ? factor * Math.hypot(...[0, 1, 2].map((k) => c[`${v}_${first + k}`][i])) : NaN;
// Of the three axes of a vector that begin at the first one.
const component = (v, which, first, factor = 1) =>
  which === "norm" ? norm(v, first, factor) : column(`${v}_${first + "xyz".indexOf(which)}`, factor);
const where = (test, value) => (c, i) => (test(c, i) ? value(c, i) : NaN);
const sent = (stream = "") => (c, i) => c[`${stream}sent`]?.[i] > 0;
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
export const padded = (least) => (low, high) => {
  const middle = (low + high) / 2;
  const half = Math.max(least, (high - low) / 2) * 1.1;
  const step = roundUp(half / 4);
  return [Math.floor((middle - half) / step) * step, Math.ceil((middle + half) / step) * step];
};

// The measured signal is wider and below the felt one, so that both are visible where they agree.
const wide = (name, of, unit, digits) => ({ name, colour: "slave", width: 5, alpha: 0.5, of, unit, digits });
const line = (name, colour, of, unit, digits, more = {}) => ({ name, colour, width: 1.75, of, unit, digits, ...more });
const strokes = (test) => ({ name: "packet", colour: "packets", poles: 0.07, of: where(test, () => 0), mark: true });
const hidden = (of) => ({ name: "", hidden: true, of });

// Measured and felt signal with the deadband between the second and the third series, and a dot for each packet.
const deadband = (raw, bound, output, test, unit, positive = false) => [
  {
    ring: "slave",
    series: [
      wide("measured", raw, unit),
      hidden((c, i) => raw(c, i) + bound(c, i)),
      hidden((c, i) => Math.max(positive ? 0 : -Infinity, raw(c, i) - bound(c, i))),
    ],
  },
  { ring: "master", series: [line("felt", "master", output, unit)] },
  { ring: "slave", series: [{ name: "packet", colour: "packets", dots: 8, of: where(test, raw) }] },
];
const felt = (stream, first, unit, factor = 1) => (which) =>
  deadband(
    component("raw", which, first, factor),
    column(`${stream}bound`, factor),
    component("output", which, first, factor),
    sent(stream),
    unit,
    which === "norm",
  );
// Pose of the hand and commanded pose of the robot.
const moved = (stream, first, robot, unit, factor) => (which) => [
  { ring: "slave", series: [wide(robot, component("output", which, first, factor), unit, 1)] },
  { ring: "master", series: [line("hand", "master", component("position", which, first, factor), unit, 1), strokes(sent(stream))] },
];
const rates = (side, name, all, ...more) => ({
  ring: `${side}Rates`,
  series: [
    line(name, side, column("updates"), "/s", 0, { width: 2 }),
    ...more,
    line(all, "quiet", column("datagrams"), "", undefined, { width: 1, dash: [2, 3] }),
  ],
});
const saved = (v, store) => `${+(100 * (1 - v / store.rate)).toFixed(1)} %`;
const gripper = (side, name) =>
  line(name, side, column("gripper"), "/s", 0, { width: 1.25, dash: [4, 3], faint: true });
// A packet carries all joints; the gripper has packets of its own.
const joint = (axis, axes) => sent(axes?.[axis] === "gripper" ? SECOND : "");
const unit = (text) => (v) => `${v}${text}`;

const EMPTY = "no samples yet";
const CONTACT = "needs a session in contact";

// `empty` is shown without data; `range` is given the choice; `ofAxes`: the choice is the number of an axis of an arm.
export const PANELS = [
  {
    name: "force", title: "Force", unit: "N", choices: NORM_XYZ, empty: CONTACT,
    help: "Force measured by the robot, and force felt by the operator. Within the green deadband around the measured force a difference is too small to be noticed, so nothing is sent; each dot is a packet.",
    sources: felt("", 0, "N"), band: [2, 3], axis: unit(" N"),
    range: (which) => (which === "norm" ? upward(1) : around(0.5)),
  },
  {
    name: "torque", title: "Torque", unit: "mN m", choices: NORM_XYZ, empty: CONTACT,
    help: "The torque about the tip of the tool: measured at the robot, and felt by the operator. It has a deadband and packets of its own.",
    sources: felt(SECOND, 3, "mN m", 1e3), band: [2, 3], axis: unit(""),
    range: (which) => (which === "norm" ? upward(20) : around(10)),
  },
  {
    name: "joint-torque", title: "Torque", unit: "N m", ofAxes: true, empty: "needs the follower",
    help: "Torque of the environment on an axis of the follower, and torque displayed by that axis of the leader. Within the green deadband around the measured torque a difference is not sent; each dot is a packet, which carries all joints.",
    sources: (axis, axes) =>
      deadband(column(`raw_${axis}`), column(`bound_${axis}`), column(`output_${axis}`), joint(axis, axes), "N m"),
    band: [2, 3], range: () => padded(0.02), axis: unit(""),
  },
  {
    name: "felt", title: "Felt error", unit: "deadbands", empty: "needs both sides of the session on this host",
    help: "Difference between the felt force and the force that the robot measured, in units of the deadband: in the green zone it is within.",
    sources: () => [{ ring: "felt", series: [line("error", "third", column("deadbands"), "deadbands")] }],
    zone: [0, 1], axis: unit(""),
    range: () => (low, high) => [0, Math.min(6, roundUp(Math.max(2, 1.04 * high)))],
  },
  {
    name: "position", title: "Position", unit: "mm", choices: ["x", "y", "z"], choice: "z", empty: EMPTY,
    help: "Position of the operator's hand, and commanded position of the robot. Each stroke at the bottom is a packet.",
    sources: moved("", 0, "robot", "mm", 1e3), range: () => padded(5), axis: unit(" mm"),
  },
  {
    name: "orientation", title: "Orientation", unit: "°", choices: NORM_XYZ, empty: EMPTY,
    help: "Orientation of hand and tool, as a rotation vector from level. Each stroke at the bottom is a packet of the rotation.",
    sources: moved(SECOND, 3, "tool", "°", DEGREES), axis: unit("°"),
    range: (which) => (which === "norm" ? upward(10) : padded(5)),
  },
  {
    name: "joint-angle", title: "Angle", unit: "°", ofAxes: true, empty: EMPTY,
    help: "Angle of an axis of the leader, in the frame of the follower, and of the follower. Each stroke at the bottom is a packet, which carries all joints.",
    sources: (axis, axes) => [
      { ring: "slave", series: [wide("follower", column(`position_${axis}`, DEGREES), "°", 1)] },
      { ring: "master", series: [line("leader", "master", column(`position_${axis}`, DEGREES), "°", 1), strokes(joint(axis, axes))] },
    ],
    range: () => padded(5), axis: unit("°"),
  },
  {
    name: "packets", title: "Packets", unit: "/s, % saved", empty: EMPTY, right: saved,
    help: "Samples that crossed the network in the last second; the right scale is what that saves against one packet per sample. The dotted lines are all datagrams of each side, heartbeats included.",
    sources: () => [rates("slave", "force", ""), rates("master", "position", "all")], range: () => upward(20), axis: unit(" /s"),
  },
  {
    name: "joint-packets", title: "Packets", unit: "/s, % saved", empty: EMPTY, right: saved,
    help: "Samples that crossed the network in the last second, of the joints and, dashed, of the gripper; the right scale is what that saves against one packet per sample. The dotted lines are all datagrams of each side.",
    sources: () => [rates("slave", "torques", "", gripper("slave", "")), rates("master", "angles", "", gripper("master", "gripper"))],
    range: () => upward(20), axis: unit(" /s"),
  },
  {
    name: "delay", title: "Delay", unit: "ms", alone: "slave", empty: "no round trip measured yet",
    help: "Round trip, one way, and jitter: by how much few datagrams exceed their least delay, in the worse direction.",
    sources: () => {
      const jitter = line("jitter", "quiet", column("jitter_us", 1e-3), "ms", undefined, { dash: [4, 3] });
      const [whole, half] = ["rtt_us", "one_way_us"].map((name) => column(name, 1e-3));
      return [{ ring: "master", series: [line("round trip", "master", whole, "ms"), line("one way", "third", half, "ms"), jitter] }];
    },
    range: () => upward(0.5), axis: unit(" ms"),
  },
  {
    name: "ticks", title: "Ticks", unit: "", log: true, empty: EMPTY,
    help: "How late ticks of the loop began and how long they took: the maximum per 0.1 s of the ticks sent to this page, on a logarithmic scale. The horizontal line is the tick period; a missed tick is red.",
    sources: () =>
      ["master", "slave"].flatMap((side) => [
        {
          ring: `${side}Rates`,
          series: [
            line("late", side, logarithmic("late_us"), "µs", 0),
            line("work", side, logarithmic("work_us"), "", 0, { width: 1.25, alpha: 0.6, dash: [4, 3], faint: true }),
          ],
        },
        { ring: side, series: [{ name: side === "slave" ? "missed" : "", colour: "bad", poles: 1, of: where(missed, () => 1), mark: true }] },
      ]),
    line: (store) => 1e6 / store.rate, range: () => () => [10, 1e4], splits: [10, 100, 1000, 10000],
    axis: (v) => (v >= 1000 ? `${v / 1000} ms` : `${v} µs`),
  },
  {
    name: "energy", title: "Energy account", unit: "mJ", empty: EMPTY,
    help: "Energy that the display may still give to the hand. What is displayed shrinks as it runs out, which keeps a delayed link stable.",
    sources: () => [{ ring: "master", series: [line("left", "master", column("energy", 1e3), "mJ")] }],
    quietNote: (store) => (store.hello?.scheme === "none" ? "no account: the control scheme is none" : ""),
    range: () => upward(1), axis: unit(" mJ"),
  },
];
