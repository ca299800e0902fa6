"""Mechanics of the OpenMANIPULATOR-X: kinematics, weight and inertia.

Frame: origin in the middle of the foot, x forward, y left, z up. Joint 1 turns the arm about z. Joints 2 to 4 turn
about y, so the arm lies in a vertical plane, and a positive angle tilts it forward and down. In that plane the tip is
at a reach r from the axis of joint 1 (negative behind it) and a height z. The pitch of the gripper is the sum of joints
2 to 4: 0 if it points forward, positive if it points down. All joints are 0 where the upper arm is vertical and the
forearm points forward.

Lengths and joint limits: ROBOTIS' own description (open_manipulator, open_manipulator_x_arm.urdf.xacro). Masses and
centres of mass: measured by a third party on another arm (smorales2405/open_manipulator_x_torque_control).
"""

from math import acos, atan2, cos, hypot, pi, sin
from typing import Final, NamedTuple

from weberlink.geometry.vector import Vector

Joints = tuple[float, float, float, float]
"""Angles [rad], rates [rad/s] or torques [N m] of joints 1 to 4."""

AXIS_X_M: Final = 0.012
SHOULDER_Z_M: Final = 0.017 + 0.0595
ELBOW_X_M: Final = 0.024
ELBOW_Z_M: Final = 0.128
FOREARM_M: Final = 0.124
HAND_M: Final = 0.126

LOWER: Final[Joints] = (-pi, -1.5, -1.5, -1.7)
UPPER: Final[Joints] = (pi, 1.5, 1.4, 1.97)

GRAVITY_M_S2: Final = 9.81


class ArmLink(NamedTuple):
    """A body that moves with a joint: mass [kg], centre of mass in the frame of that joint [m], inertia [kg m^2].

    The moment is about the centre of mass and an axis parallel to that of the joint. With all joints at 0 the axes of
    every frame are those of the foot.
    """

    mass: float
    centre_x: float
    centre_z: float
    moment: float


LINKS: Final = (
    ArmLink(0.0970, 0.0, 0.044319, 1.63e-5),
    ArmLink(0.1235, 0.007606, 0.099924, 2.05e-4),
    ArmLink(0.1151, 0.089168, 0.0, 1.48e-4),
    ArmLink(0.2226, 0.062451, 0.005878, 1.89e-4),
)
"""Of joints 1 to 4; the last one is the gripper with its fingers."""

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

_UPPER_ARM_M: Final = hypot(ELBOW_X_M, ELBOW_Z_M)
_UPPER_ARM_ANGLE: Final = atan2(ELBOW_X_M, ELBOW_Z_M)
_PITCH_STEP: Final = 0.02

# First moments about joints 2 to 4, along and across the link, times g [N m].
_W2X: Final = GRAVITY_M_S2 * (LINKS[1].mass * LINKS[1].centre_x + (LINKS[2].mass + LINKS[3].mass) * ELBOW_X_M)
_W2Z: Final = GRAVITY_M_S2 * (LINKS[1].mass * LINKS[1].centre_z + (LINKS[2].mass + LINKS[3].mass) * ELBOW_Z_M)
_W3X: Final = GRAVITY_M_S2 * (LINKS[2].mass * LINKS[2].centre_x + LINKS[3].mass * FOREARM_M)
_W3Z: Final = GRAVITY_M_S2 * LINKS[2].mass * LINKS[2].centre_z
_W4X: Final = GRAVITY_M_S2 * LINKS[3].mass * LINKS[3].centre_x
_W4Z: Final = GRAVITY_M_S2 * LINKS[3].mass * LINKS[3].centre_z

# Second moments of all that moves with joints 2 to 4, as if the links in front were points at their joints [kg m^2].
_S2: Final = (
    LINKS[1].moment
    + LINKS[1].mass * (LINKS[1].centre_x ** 2 + LINKS[1].centre_z ** 2)
    + (LINKS[2].mass + LINKS[3].mass) * _UPPER_ARM_M**2
)
_S3: Final = (
    LINKS[2].moment + LINKS[2].mass * (LINKS[2].centre_x ** 2 + LINKS[2].centre_z ** 2) + LINKS[3].mass * FOREARM_M**2
)
_S4: Final = LINKS[3].moment + LINKS[3].mass * (LINKS[3].centre_x ** 2 + LINKS[3].centre_z ** 2)


class ArmPose(NamedTuple):
    """The arm at given joint angles: all quantities that a control cycle needs.

    Args:
        joints: Angles [rad].
        tip: Position of the tip [m].
        pitch: Of the gripper [rad].
        reach: Distance of the tip from the axis of joint 1 [m].
        cos_yaw, sin_yaw: Of joint 1.
        columns: (dr/dq, dz/dq) of the tip for joints 2 to 4 [m/rad].
        gravity: Torques that hold the arm against its weight [N m].
        inertia: Elements 11, 22, 23, 24, 33, 34 and 44 of the symmetric mass matrix of the links [kg m^2]; the others
            are 0. The rotors of the motors add the same to each diagonal element.
    """

    joints: Joints
    tip: Vector
    pitch: float
    reach: float
    cos_yaw: float
    sin_yaw: float
    columns: tuple[float, float, float, float, float, float]
    gravity: Joints
    inertia: tuple[float, float, float, float, float, float, float]

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

    def velocity(self, rates: Joints) -> Vector:
        """Of the tip [m/s]: J q'."""
        q1, q2, q3, q4 = rates
        r2, z2, r3, z3, r4, z4 = self.columns
        radial = r2 * q2 + r3 * q3 + r4 * q4
        across = self.reach * q1
        return (
            self.cos_yaw * radial - self.sin_yaw * across,
            self.sin_yaw * radial + self.cos_yaw * across,
            z2 * q2 + z3 * q3 + z4 * q4,
        )

    def momentum(self, rates: Joints, rotor: float) -> Joints:
        """Mass matrix, with `rotor` [kg m^2] at each joint, times rates [N m s]."""
        q1, q2, q3, q4 = rates
        m11, m22, m23, m24, m33, m34, m44 = self.inertia
        return (
            (m11 + rotor) * q1,
            (m22 + rotor) * q2 + m23 * q3 + m24 * q4,
            m23 * q2 + (m33 + rotor) * q3 + m34 * q4,
            m24 * q2 + m34 * q3 + (m44 + rotor) * q4,
        )

    def coriolis(self, rates: Joints) -> Joints:
        """Torques of Coriolis and centrifugal forces [N m]."""
        return _coriolis(self.joints, rates)

    def jacobian(self) -> tuple[Joints, Joints, Joints]:
        """dx/dq, dy/dq and dz/dq of the tip [m/rad]."""
        c, s = self.cos_yaw, self.sin_yaw
        r2, z2, r3, z3, r4, z4 = self.columns
        return (
            (-s * self.reach, c * r2, c * r3, c * r4),
            (c * self.reach, s * r2, s * r3, s * r4),
            (0.0, z2, z3, z4),
        )


def arm_pose(joints: Joints) -> ArmPose:
    yaw, q2, q3, q4 = joints
    upper, fore = q2, q2 + q3
    pitch = fore + q4
    cos_yaw, sin_yaw = cos(yaw), sin(yaw)
    cos_upper, sin_upper = cos(upper), sin(upper)
    cos_fore, sin_fore = cos(fore), sin(fore)
    cos_pitch, sin_pitch = cos(pitch), sin(pitch)
    # From joints 4, 3 and 2 to the tip, forward and up.
    r4, z4 = HAND_M * cos_pitch, -HAND_M * sin_pitch
    r3, z3 = r4 + FOREARM_M * cos_fore, z4 - FOREARM_M * sin_fore
    r2 = r3 + ELBOW_X_M * cos_upper + ELBOW_Z_M * sin_upper
    z2 = z3 - ELBOW_X_M * sin_upper + ELBOW_Z_M * cos_upper
    elbow_r, elbow_z = r2 - r3, z2 - z3
    weight4 = -(_W4X * cos_pitch + _W4Z * sin_pitch)
    weight3 = weight4 - (_W3X * cos_fore + _W3Z * sin_fore)
    weight2 = weight3 - (_W2X * cos_upper + _W2Z * sin_upper)
    return ArmPose(
        joints,
        (AXIS_X_M + r2 * cos_yaw, r2 * sin_yaw, SHOULDER_Z_M + z2),
        pitch,
        r2,
        cos_yaw,
        sin_yaw,
        (z2, -r2, z3, -r3, z4, -r4),
        (0.0, weight2, weight3, weight4),
        _inertia((elbow_r, elbow_z), (cos_upper, sin_upper), (cos_fore, sin_fore), (cos_pitch, sin_pitch)),
    )


def _inertia(
    elbow: tuple[float, float], upper: tuple[float, float], fore: tuple[float, float], hand: tuple[float, float]
) -> tuple[float, float, float, float, float, float, float]:
    """Elements of the mass matrix, from the vector joint 2 to elbow [m] and cosine and sine of the links' angles.

    Derived in the absolute angles of the three links, whose kinetic energy is a sum over pairs of links. About the
    vertical, a link's own moment is that of a rod along the link.
    """
    elbow_r, elbow_z = elbow
    (ca, sa), (cb, sb), (cc, sc) = upper, fore, hand
    _, link3, link4, link5 = LINKS
    # Centres of mass from their joints, and those of links 4 and 5 weighted with the mass.
    r3, r4, z4 = link3.centre_x * ca + link3.centre_z * sa, link4.centre_x * cb, -link4.centre_x * sb
    r5, z5 = link5.centre_x * cc + link5.centre_z * sc, -link5.centre_x * sc + link5.centre_z * cc
    wrist_r, wrist_z = FOREARM_M * cb, -FOREARM_M * sb
    hand_r, hand_z = link5.mass * r5, link5.mass * z5
    fore_r, fore_z = link4.mass * r4 + link5.mass * wrist_r, link4.mass * z4 + link5.mass * wrist_z
    ab = elbow_r * fore_r + elbow_z * fore_z
    ac = elbow_r * hand_r + elbow_z * hand_z
    bc = wrist_r * hand_r + wrist_z * hand_z
    m34 = _S4 + bc
    m33 = m34 + _S3 + bc
    turning = LINKS[0].moment + link3.moment * sa * sa + link4.moment * cb * cb + link5.moment * cc * cc
    m11 = turning + link3.mass * r3 * r3 + link4.mass * (elbow_r + r4) ** 2 + link5.mass * (elbow_r + wrist_r + r5) ** 2
    return (m11, _S2 + m33 + 2.0 * (ab + ac), m33 + ab + ac, m34 + ac, m33, m34, _S4)


def _coriolis(joints: Joints, rates: Joints) -> Joints:
    """From Lagrange's equations in the absolute angles; derivatives of a vector (r, z) of a link are (z, -r)."""
    _, q2, q3, q4 = joints
    ca, sa, cb, sb, cc, sc = cos(q2), sin(q2), cos(q2 + q3), sin(q2 + q3), cos(q2 + q3 + q4), sin(q2 + q3 + q4)
    _, link3, link4, link5 = LINKS
    elbow_r, elbow_z = ELBOW_X_M * ca + ELBOW_Z_M * sa, ELBOW_Z_M * ca - ELBOW_X_M * sa
    wrist_r, wrist_z = FOREARM_M * cb, -FOREARM_M * sb
    r3, z3 = link3.centre_x * ca + link3.centre_z * sa, link3.centre_z * ca - link3.centre_x * sa
    r4, z4 = link4.centre_x * cb, -link4.centre_x * sb
    r5, z5 = link5.centre_x * cc + link5.centre_z * sc, link5.centre_z * cc - link5.centre_x * sc
    hand_r, hand_z = link5.mass * r5, link5.mass * z5
    fore_r, fore_z = link4.mass * r4 + link5.mass * wrist_r, link4.mass * z4 + link5.mass * wrist_z
    # Derivatives of the moment of inertia about joint 1 by the absolute angles.
    out4, out5 = link4.mass * (elbow_r + r4), link5.mass * (elbow_r + wrist_r + r5)
    by_a = 2.0 * (link3.moment * sa * ca + link3.mass * r3 * z3 + (out4 + out5) * elbow_z)
    by_b = 2.0 * (out4 * z4 + out5 * wrist_z - link4.moment * cb * sb)
    by_c = 2.0 * (out5 * z5 - link5.moment * cc * sc)
    turn, rate_a = rates[0], rates[1]
    rate_b = rate_a + rates[2]
    rate_c = rate_b + rates[3]
    half, aa, bb, square_c = 0.5 * turn * turn, rate_a * rate_a, rate_b * rate_b, rate_c * rate_c
    ab = elbow_r * fore_z - elbow_z * fore_r
    ac = elbow_r * hand_z - elbow_z * hand_r
    bc = wrist_r * hand_z - wrist_z * hand_r
    on_c = -aa * ac - bb * bc - half * by_c
    on_b = on_c + square_c * bc - aa * ab - half * by_b
    on_a = on_b + bb * ab + square_c * ac - half * by_a
    return (turn * (by_a * rate_a + by_b * rate_b + by_c * rate_c), on_a, on_b, on_c)


def potential_energy(joints: Joints) -> float:
    """Of the weight of all links [J], up to a constant; its gradient is `ArmPose.gravity`."""
    _, q2, q3, q4 = joints
    fore = q2 + q3
    pitch = fore + q4
    return (
        (_W2Z * cos(q2) - _W2X * sin(q2))
        + (_W3Z * cos(fore) - _W3X * sin(fore))
        + (_W4Z * cos(pitch) - _W4X * sin(pitch))
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
