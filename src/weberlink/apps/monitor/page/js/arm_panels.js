// What each chart shows of an arm that is led joint by joint, in place of force, position and their packets.
//
// The choice of a chart is the number of an axis.

import { column, padded, sent, upward, where } from "./panels.js";

const DEGREES = 180 / Math.PI;
const rates = (ring, colour, name, gripper) => ({
  ring,
  series: [
    { name, colour, width: 2, of: column("updates"), unit: "/s", digits: 0 },
    { name: gripper, colour, width: 1.25, dash: [4, 3], faint: true, of: column("gripper"), unit: "/s", digits: 0 },
    { name: "", colour: "quiet", width: 1, of: column("datagrams"), dash: [2, 3] },
  ],
});
// A packet carries all joints; the gripper has packets of its own.
const packet = (axis, axes) => (axes?.[axis] === "gripper" ? sent("gripper_") : sent());

export const ARM_PANELS = [
  {
    name: "joint-torque",
    title: "Torque",
    unit: "N m",
    ofAxes: true,
    help:
      "Torque of the environment on an axis of the follower, and torque displayed by that axis of the leader. Within the " +
      "green deadband around the measured torque a difference is not sent; each dot is a packet, which carries all joints.",
    empty: "needs the follower",
    sources(axis, axes) {
      const raw = column(`joint_raw_${axis}`);
      const bound = column(`joint_bound_${axis}`);
      return [
        {
          ring: "slave",
          series: [
            { name: "measured", colour: "slave", width: 5, alpha: 0.5, of: raw, unit: "N m" },
            { name: "", hidden: true, of: (c, i) => raw(c, i) + bound(c, i) },
            { name: "", hidden: true, of: (c, i) => raw(c, i) - bound(c, i) },
          ],
        },
        {
          ring: "master",
          series: [{ name: "felt", colour: "master", width: 1.75, of: column(`joint_output_${axis}`), unit: "N m" }],
        },
        { ring: "slave", series: [{ name: "packet", colour: "packets", dots: 8, of: where(packet(axis, axes), raw) }] },
      ];
    },
    band: [2, 3],
    range: () => (low, high) => padded(low, high, 0.02),
    axis: (v) => `${v}`,
  },
  {
    name: "joint-angle",
    title: "Angle",
    unit: "°",
    ofAxes: true,
    help:
      "Angle of an axis of the leader, in the frame of the follower, and of the follower. Each stroke at the bottom is a " +
      "packet, which carries all joints.",
    empty: "no samples yet",
    sources: (axis, axes) => [
      {
        ring: "slave",
        series: [
          {
            name: "follower",
            colour: "slave",
            width: 5,
            alpha: 0.5,
            of: column(`joint_position_${axis}`, DEGREES),
            unit: "°",
            digits: 1,
          },
        ],
      },
      {
        ring: "master",
        series: [
          { name: "leader", colour: "master", width: 1.75, of: column(`joint_position_${axis}`, DEGREES), unit: "°", digits: 1 },
          { name: "packet", colour: "packets", poles: 0.07, of: where(packet(axis, axes), () => 0), mark: true },
        ],
      },
    ],
    range: () => (low, high) => padded(low, high, 5),
    axis: (v) => `${v}°`,
  },
  {
    name: "joint-packets",
    title: "Packets",
    unit: "/s, % saved",
    help:
      "Samples that crossed the network in the last second, of the joints and, dashed, of the gripper; the right scale is " +
      "what that saves against one packet per sample. The dotted lines are all datagrams of each side.",
    empty: "no samples yet",
    sources: () => [rates("slaveRates", "slave", "torques", ""), rates("masterRates", "master", "angles", "gripper")],
    range: () => upward(20),
    axis: (v) => `${v} /s`,
    right: (v, store) => `${+(100 * (1 - v / store.rate)).toFixed(1)} %`,
  },
];
