"""The OpenMANIPULATOR-X in space: its pose by MuJoCo from the model of the arm, and joint angles for a place.

Frame: origin in the middle of the foot, x forward, y left, z up. Joint 1 turns the arm about z. Joints 2 to 4 turn
about y, so the arm lies in a vertical plane, and a positive angle tilts it forward and down. In that plane the tip is
at a reach r from the axis of joint 1 (negative behind it) and a height z. The pitch of the gripper is the sum of joints
2 to 4: 0 if it points forward, positive if it points down. All joints are 0 where the upper arm is vertical and the
forearm points forward. Lengths, masses and limits are those of ROBOTIS' description; see the model.
"""

from collections.abc import Sequence
from math import acos, atan2, cos, hypot, pi, sin
from typing import Final, NamedTuple

from weberlink.geometry.vector import Vector
from weberlink_arms.dynamixel.layouts import OPEN_MANIPULATOR_X
from weberlink_mujoco.arms.models import load

Joints = tuple[float, float, float, float]  # angles [rad], rates [rad/s] or torques [N m] of joints 1 to 4

AXIS_X_M: Final = 0.012
SHOULDER_Z_M: Final = 0.017 + 0.0595
FOREARM_M: Final = 0.124
HAND_M: Final = 0.126
_UPPER_ARM_M: Final = hypot(0.024, 0.128)
_UPPER_ARM_ANGLE: Final = atan2(0.024, 0.128)
_PITCH_STEP: Final = 0.02

MODEL_ROTOR_KG_M2: Final = 0.005  # armature of each joint in the model

COULOMB_N_M: Final[Joints] = (0.037, 0.085, 0.132, 0.045)
VISCOUS_N_M_S: Final[Joints] = (0.037, 0.0, 0.0, 0.005)
"""Friction of the joints of one arm: half the difference of the currents that move a joint to and fro at constant
speed, at equal angles, so that the weight cancels (smorales2405/open_manipulator_x_torque_control,
motorXM430W350T_params.yaml, 2026-07-19; the viscous part from its version of 2026-06-24)."""
ROTOR_INERTIA_KG_M2: Final = 0.045
LEAST_ROTOR_INERTIA_KG_M2: Final = 0.005
"""Of a motor, seen at its joint through gears of 353.5:1. The larger figure is that of the same motor in a fitted model
(mujoco_menagerie, robotis_op3), the smaller one that of larger motors with faster gears (mujoco_menagerie,
dynamixel_2r), below which no published figure lies."""


def four(axes: Sequence[float]) -> Joints:
    """Joints 1 to 4 of all axes."""
    a, b, c, d = axes[:4]
    return (a, b, c, d)


LOWER: Final[Joints] = four(OPEN_MANIPULATOR_X.lower)
UPPER: Final[Joints] = four(OPEN_MANIPULATOR_X.upper)


class ArmPose(NamedTuple):
    """The arm at given joint angles: all quantities that a control cycle needs."""

    joints: Joints  # angles [rad]
    tip: Vector  # position of the tip [m]
    pitch: float  # of the gripper [rad]
    reach: float  # distance of the tip from the axis of joint 1 [m]
    cos_yaw: float  # of joint 1
    sin_yaw: float
    columns: tuple[float, float, float, float, float, float]  # (dr/dq, dz/dq) of the tip for joints 2 to 4 [m/rad]
    gravity: Joints  # torques that hold the arm against its weight [N m]
    inertia: tuple[Joints, Joints, Joints, Joints]  # mass matrix, with the rotors of the model [kg m^2]

    def torques(self, force: Vector) -> Joints:
        """Joint torques of a force [N] that the tip exerts: J^T f."""
        fx, fy, fz = force
        radial = self.cos_yaw * fx + self.sin_yaw * fy
        r2, z2, r3, z3, r4, z4 = self.columns
        return (
            self.reach * (self.cos_yaw * fy - self.sin_yaw * fx),
            r2 * radial + z2 * fz,
            r3 * radial + z3 * fz,
            r4 * radial + z4 * fz,
        )

    def momentum(self, rates: Joints, rotor: float) -> Joints:
        """Mass matrix, with `rotor` [kg m^2] at each joint, times rates [N m s]."""
        rotor -= MODEL_ROTOR_KG_M2
        a, b, c, d = (
            rotor * own + sum([m * rate for m, rate in zip(row, rates, strict=True)])
            for row, own in zip(self.inertia, rates, strict=True)
        )
        return (a, b, c, d)


class Mechanics:
    """Gives poses of the arm, its gripper closed; for one thread at a time."""

    def __init__(self) -> None:
        self._model = load(OPEN_MANIPULATOR_X.name)

    def pose(self, joints: Joints) -> ArmPose:
        """At these angles [rad]."""
        model, axes = self._model, (*joints, 0.0)
        c, s = cos(joints[0]), sin(joints[0])
        x, y, z = model.jacobian(axes)
        r2, r3, r4 = (c * along + s * across for along, across in zip(x[1:4], y[1:4], strict=True))
        rows = model.mass(axes)
        return ArmPose(
            joints,
            model.tip(axes),
            joints[1] + joints[2] + joints[3],
            c * y[0] - s * x[0],
            c,
            s,
            (r2, z[1], r3, z[2], r4, z[3]),
            four(model.gravity(axes)),
            (four(rows[0]), four(rows[1]), four(rows[2]), four(rows[3])),
        )


def inverse(tip: Vector, pitch: float, elbow_up: bool = True) -> Joints | None:
    """Joint angles [rad] for a tip position [m] and pitch [rad]; None out of reach or beyond joint limits."""
    x, y = tip[0] - AXIS_X_M, tip[1]
    reach = hypot(x, y)
    wrist_r = reach - HAND_M * cos(pitch)
    wrist_z = tip[2] - SHOULDER_Z_M + HAND_M * sin(pitch)
    span = hypot(wrist_r, wrist_z)
    if not abs(_UPPER_ARM_M - FOREARM_M) < span <= _UPPER_ARM_M + FOREARM_M:
        return None
    # Angles above the horizontal, by the law of cosines.
    corner = acos(min(1.0, (_UPPER_ARM_M**2 + span**2 - FOREARM_M**2) / (2.0 * _UPPER_ARM_M * span)))
    elevation = atan2(wrist_z, wrist_r) + (corner if elbow_up else -corner)
    fore_elevation = atan2(wrist_z - _UPPER_ARM_M * sin(elevation), wrist_r - _UPPER_ARM_M * cos(elevation))
    upper = _wrapped(pi / 2.0 - _UPPER_ARM_ANGLE - elevation)
    joints = (atan2(y, x), upper, _wrapped(-fore_elevation - upper), _wrapped(pitch + fore_elevation))
    return joints if within_limits(joints) else None


def inverse_nearest(tip: Vector, pitch: float) -> Joints | None:
    """Joint angles [rad] for a tip position [m], with the reachable pitch that is nearest to `pitch` [rad].

    Tried in steps of 0.02 rad, the elbow up before down; None where no pitch reaches it.
    """
    for number in range(int(pi / _PITCH_STEP) + 1):
        for sign in (1.0, -1.0) if number else (1.0,):
            for elbow_up in (True, False):
                joints = inverse(tip, pitch + sign * number * _PITCH_STEP, elbow_up)
                if joints is not None:
                    return joints
    return None


def within_limits(joints: Joints, margin: float = 0.0) -> bool:
    """Whether every joint is at least `margin` within its limits [rad]."""
    return all(low + margin <= q <= high - margin for low, q, high in zip(LOWER, joints, UPPER, strict=True))


def _wrapped(angle: float) -> float:
    """The same angle within +-pi."""
    return (angle + pi) % (2.0 * pi) - pi
