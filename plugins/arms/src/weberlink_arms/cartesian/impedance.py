"""Cartesian impedance of the tip about a goal, and the goal that follows the commands.

    tau = J^T (K (goal - x), at most a limit) - a M q' + gravity + posture in the null space + springs at joint limits

Four joints and three axes leave one motion that does not move the tip, along n with J n = 0. The posture term turns the
gripper towards a pitch along n alone, so it exerts no force at the tip: n . J^T f = 0 for every f.

The damping is proportional to the mass matrix M, with the rotors of the motors. So all motions decay at the same rate
a; a damper at the tip that suits the heavy motions of the whole arm is, with the delay of the bus, unstable for the
light ones of the wrist.
"""

from math import hypot, inf
from typing import Final, NamedTuple

from weberlink.geometry.vector import ZERO, Vector
from weberlink.slave.guard import Approach
from weberlink_arms.cartesian.arm import (
    LEAST_ROTOR_INERTIA_KG_M2,
    LOWER,
    ROTOR_INERTIA_KG_M2,
    UPPER,
    ArmPose,
    Joints,
)


class ImpedanceGains(NamedTuple):
    """Gains of the impedance, bounded by `stiffest` and `fastest_damping`."""

    stiffness: float = 400.0  # of the tip [N/m]
    damping_rate: float = 12.0  # decay rate of motions [1/s]
    force: float = 5.0  # largest of the spring [N]
    rotor: float = ROTOR_INERTIA_KG_M2  # inertia of each motor at its joint that the damping assumes [kg m^2]


SLOWEST_HZ: Final = 200.0  # rate of the bus below which contact with a stiff wall is unstable


def fastest_damping(rate: float, rotor: float) -> float:
    """Damping rate up to which the arm is stable at a bus rate [Hz], with a whole cycle of delay [1/s].

    A damper of rate b with a cycle T of delay and hold is stable for b T < 1. Where the rotors are lighter than
    assumed, the same torques damp faster: at worst by `rotor` over the least published inertia. Half of that is a
    margin for the torque constant and for contacts.
    """
    return rate * min(0.25, 0.5 * LEAST_ROTOR_INERTIA_KG_M2 / rotor)


def stiffest(damping_rate: float, rate: float, rotor: float) -> float:
    """Stiffness of the tip up to which it is stable at a bus rate [Hz], with a whole cycle of delay [N/m].

    A spring k that acts T = 1.5 periods late (one of delay, half of hold) pushes as a damper of -k T would, and the
    damper is a m, so k T < a m. With m the mass that the damping assumes, this holds for any mass of the tip. The least
    m in any direction within the default workspace is 0.05 kg without rotors and more than 0.1 kg + 7.5 m^-2 times the
    inertia of a rotor with them; half of that is a margin for the springs of pitch and joint limits, and for contacts.
    """
    return (0.05 + 3.75 * rotor) * damping_rate * rate / 1.5


# The springs of pitch and joint limits are proportional to that of the tip, so that one bound holds for all [m^2].
_PITCH: Final = 0.003
_LIMIT: Final = 0.006
LIMIT_MARGIN_RAD: Final = 0.2  # distance from the limit of a joint at which its spring begins
_NULL_LEAST: Final = 1e-4  # below this length of n [m^2] the arm counts as straight, without a null motion


def joint_torques(posture: ArmPose, rates: Joints, goal: Vector, pitch: float, gains: ImpedanceGains) -> Joints:
    """Torques of the joints [N m] at rates [rad/s], for a goal of the tip [m] and a pitch of the gripper [rad]."""
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


def null_direction(posture: ArmPose) -> tuple[float, float, float]:
    """Unit vector over joints 2 to 4 whose motion does not move the tip; zero where the arm is straight."""
    r2, z2, r3, z3, r4, z4 = posture.columns
    n2, n3, n4 = r3 * z4 - r4 * z3, r4 * z2 - r2 * z4, r2 * z3 - r3 * z2
    length = hypot(n2, n3, n4)
    if length < _NULL_LEAST:
        return (0.0, 0.0, 0.0)
    return (n2 / length, n3 / length, n4 / length)


def _short(q: float, low: float, high: float) -> float:
    """Distance that a joint has to move to be clear of its limits, with its sign [rad]."""
    return min(high - LIMIT_MARGIN_RAD - q, 0.0) + max(low + LIMIT_MARGIN_RAD - q, 0.0)


class TipGoal:
    """Follows commands; once they have stopped for `patience` [s], holds the tip where it is, without spring force.

    After `place` or such a pause it approaches the next command at a limited speed [m/s], and follows without delay
    once it is there, so the arm never jumps.
    """

    def __init__(self, approach_speed: float, patience: float) -> None:
        self._approach_speed, self._patience = approach_speed, patience
        self.place(ZERO, 0.0)

    def place(self, tip: Vector, now: float) -> None:
        """Hold here [m]."""
        self._way = Approach(tip, 3, inf, self._approach_speed)
        self.holding = True  # there is no command
        self._at = self._heard_at = now

    def next(self, command: Vector | None, tip: Vector, now: float) -> Vector:
        """The goal [m] at `now` [s], for a command or None, and the position of the tip [m]."""
        elapsed, self._at = max(0.0, now - self._at), now
        if command is not None:
            self._heard_at, self.holding = now, False
            self._way.advance(command, elapsed)
        elif not self.holding and now - self._heard_at > self._patience:
            self.place(tip, now)
        x, y, z = self._way.held
        return (x, y, z)
