"""Cartesian impedance: the tip behaves as if a spring and a damper held it at the goal.

    tau = J^T (K (goal - x), at most a limit) - a M q' + gravity + posture in the null space + springs at joint limits

Four joints and three axes leave one motion that does not move the tip, along n with J n = 0. The posture term turns the
gripper towards a pitch along n alone, so that it never presses the tip: n . J^T f = 0 for every f.

The damping is in proportion to the mass matrix M, the rotors of the motors included. So all motions die away at the
same rate a, heavy ones of the whole arm and light ones of the wrist alike; a damper at the tip that suits the heavy
ones is, with the delay of the bus, unstable for the light ones. Owns the gains and their bounds. Knows no registers and
no clock.
"""

from math import hypot
from typing import Final, NamedTuple

from weberlink.geometry.vector import Vector
from weberlink.slave.robots.dynamixel.arm import (
    LEAST_ROTOR_INERTIA_KG_M2,
    LOWER,
    ROTOR_INERTIA_KG_M2,
    UPPER,
    Joints,
    Posture,
)


class Gains(NamedTuple):
    """Of the impedance; `stiffest` and `fastest_damping` bound them.

    Args:
        stiffness: of the tip [N/m].
        damping_rate: at which motion dies away [1/s].
        force: largest force of the spring [N].
        rotor: inertia of each motor, seen at its joint, as the damping takes it to be [kg m^2].
    """

    stiffness: float = 400.0
    damping_rate: float = 12.0
    force: float = 5.0
    rotor: float = ROTOR_INERTIA_KG_M2


SLOWEST_HZ: Final = 200.0
"""Rate of the bus below which a stiff wall under the tip makes it swing."""


def fastest_damping(rate: float, rotor: float) -> float:
    """Damping rate up to which the arm is stable at a bus rate [Hz], with a whole cycle of delay [1/s].

    A damper of rate b with a cycle T of delay and hold is stable for b T < 1. Where the rotors are lighter than the
    damping takes them to be, the same torques damp that much faster: at worst by `rotor` over the least published
    inertia. Half of that is left for a motor that turns an ampere into more torque than it should, and for contacts.
    """
    return rate * min(0.25, 0.5 * LEAST_ROTOR_INERTIA_KG_M2 / rotor)


def stiffest(damping_rate: float, rate: float, rotor: float) -> float:
    """Stiffness of the tip up to which it is stable at a bus rate [Hz], with a whole cycle of delay [N/m].

    A spring k that acts T = 1.5 periods late (one of delay, half of hold) pushes as a damper of -k T would, and the
    damper is a m, so k T < a m. With m the mass that the damping takes the tip to have, this holds whatever the tip
    weighs. The least m in any direction within the default workspace is 0.05 kg without rotors and more than 0.1 kg +
    7.5 m^-2 times the inertia of a rotor with them; half of that is left to the springs of pitch and joint limits, to
    contacts, and to be safe.
    """
    return (0.05 + 3.75 * rotor) * damping_rate * rate / 1.5


# The springs of pitch and joint limits are in proportion to that of the tip, so that one bound is good for all [m^2].
_PITCH: Final = 0.003
_LIMIT: Final = 0.006
LIMIT_MARGIN_RAD: Final = 0.2
"""So far in front of a joint's limit its spring begins."""
_NULL_LEAST: Final = 1e-4
"""Below this length of n [m^2] the arm is straight, where it has no motion of its own."""


def joint_torques(posture: Posture, rates: Joints, goal: Vector, pitch: float, gains: Gains) -> Joints:
    """Torques of the joints [N m].

    Args:
        posture: where the arm is.
        rates: of the joints [rad/s].
        goal: for the tip [m].
        pitch: for the gripper [rad].
        gains: of spring, damper and posture.
    """
    tip = posture.tip
    k, most, decay = gains.stiffness, gains.force, gains.damping_rate
    x, y, z = k * (goal[0] - tip[0]), k * (goal[1] - tip[1]), k * (goal[2] - tip[2])
    length = hypot(x, y, z)
    if length > most:
        x, y, z = x * most / length, y * most / length, z * most / length
    t1, t2, t3, t4 = posture.torques((x, y, z))
    p1, p2, p3, p4 = posture.momentum(rates, gains.rotor)
    n2, n3, n4 = null_direction(posture)
    along = -_PITCH * k * (n2 + n3 + n4) * (posture.pitch - pitch)
    g1, g2, g3, g4 = posture.gravity
    q1, q2, q3, q4 = posture.joints
    return (
        t1 + g1 - decay * p1 + _LIMIT * k * _short(q1, LOWER[0], UPPER[0]),
        t2 + g2 - decay * p2 + _LIMIT * k * _short(q2, LOWER[1], UPPER[1]) + n2 * along,
        t3 + g3 - decay * p3 + _LIMIT * k * _short(q3, LOWER[2], UPPER[2]) + n3 * along,
        t4 + g4 - decay * p4 + _LIMIT * k * _short(q4, LOWER[3], UPPER[3]) + n4 * along,
    )


def null_direction(posture: Posture) -> tuple[float, float, float]:
    """Unit vector over joints 2 to 4 whose motion leaves the tip where it is; zero where the arm is straight."""
    r2, z2, r3, z3, r4, z4 = posture.columns
    n2, n3, n4 = r3 * z4 - r4 * z3, r4 * z2 - r2 * z4, r2 * z3 - r3 * z2
    length = hypot(n2, n3, n4)
    if length < _NULL_LEAST:
        return (0.0, 0.0, 0.0)
    return (n2 / length, n3 / length, n4 / length)


def _short(q: float, low: float, high: float) -> float:
    """How far a joint would have to go back to be clear of its limits [rad]."""
    return min(high - LIMIT_MARGIN_RAD - q, 0.0) + max(low + LIMIT_MARGIN_RAD - q, 0.0)


def currents(torques: Joints, torque_constant: float, most: float) -> Joints:
    """Motor currents [A] for joint torques [N m], each cut to +-`most`."""
    a, b, c, d = torques
    return (
        min(max(a / torque_constant, -most), most),
        min(max(b / torque_constant, -most), most),
        min(max(c / torque_constant, -most), most),
        min(max(d / torque_constant, -most), most),
    )
