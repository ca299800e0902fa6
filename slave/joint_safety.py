"""Protects a follower arm from decoded angles, axis by axis: engagement without a jump, limits, contact, trips."""

from math import copysign, inf

from weberlink.geometry.joints import Joints
from weberlink.slave.safety import REBOUND, TRIP_PAUSE, PressStep, TripGuard

TRIP_RETREAT = 0.05
"""How far an axis that trips backs off [rad]: 1 cm at the end of 20 cm. Chosen."""
CONTACT_SHARE = 0.1
"""An axis is in contact from this share of its largest press on; less is friction of gears and noise. Chosen."""
DAMPING_MOST = 4.0
"""Largest damping of what an axis touches that the press limit provides for [N m s/rad]: 100 N s/m at the end of 20 cm.
Chosen."""
FULL_SHARE = 0.95
"""Share of the largest press that counts as all of it: filtered, a measurement that saturates stays below. Chosen."""


class JointPressLimit:
    """Bounds the torque with which each axis presses on what it touches; the counterpart of `PressLimit`.

    Against the torque of the environment, the commanded angle may lie at most `most / stiffness` beyond the measured
    one, so that the position control of the axis presses with at most `most`; `PressStep` says how it gets there. This
    holds for `REBOUND` after the contact too, unless the operator pulls out, and after a damped one until the command
    has caught up. Motion away from the contact is not bounded.

    Most followers sag under their own weight, which their position control holds by a distance to the command that is
    no contact. So the command goes back only where the torque of the environment reaches `most`; below it, it only goes
    no deeper. Otherwise an arm that takes up a light object would sink.

    Args:
        most: largest torque of each axis on the environment [N m], >= 0; 0 for one that measures no torque, which is
            not bounded.
        stiffness: of the position control of each axis [N m/rad], > 0; an infinite one is not bounded.
        noise: uncertainty of a measured torque [N m]; a contact below it is none.
    """

    __slots__ = ("_angles", "_contact", "_held", "_left", "_most", "_reach", "_sign", "_steps")

    def __init__(self, most: Joints, stiffness: Joints, noise: float) -> None:
        if not all(torque >= 0.0 for torque in most):
            raise ValueError(f"press limits must not be negative: {most}")
        self._most = most
        self._reach = tuple(inf if k == inf else torque / k for torque, k in zip(most, stiffness, strict=True))
        self._contact = tuple(min(torque, max(CONTACT_SHARE * torque, noise)) or inf for torque in most)
        self._steps = [PressStep(reach, DAMPING_MOST / k) for reach, k in zip(self._reach, stiffness, strict=True)]
        self._sign = [0.0] * len(most)
        self._left = [0.0] * len(most)
        self._held: Joints = ()
        self._angles: Joints = ()

    def forget(self) -> None:
        """The arm holds: what comes next does not follow from what was before."""
        self._held = ()
        for step in self._steps:
            step.rest()

    def bounded(self, target: Joints, held: Joints, angles: Joints, torques: Joints, elapsed: float) -> Joints:
        """The target, less deep on axes that press too far; itself if none does [rad].

        Args:
            target: angles that the arm is to be commanded to [rad].
            held: those of the last command [rad].
            angles: as measured [rad].
            torques: of the environment on the arm [N m].
            elapsed: time since the last call [s].
        """
        bounded = target
        former, left = (self._held, self._angles) if self._held else (held, angles)
        self._held, self._angles = held, angles
        for axis, torque in enumerate(torques):
            touches = abs(torque) >= self._contact[axis]
            if touches:
                self._sign[axis], self._left[axis] = copysign(1.0, torque), REBOUND
            elif self._left[axis] <= 0.0 and not self._steps[axis].catches_up:
                self._steps[axis].rest()
                continue
            # Along the axis, with the direction into the contact as positive.
            sign = -self._sign[axis]
            depth = sign * (target[axis] - angles[axis])
            if depth <= 0.0 and not touches:
                self._left[axis] = 0.0
                self._steps[axis].rest()
                continue
            self._left[axis] -= elapsed
            wanted = sign * (target[axis] - held[axis])
            allowed = self._steps[axis].allowed(
                wanted,
                press=sign * (held[axis] - angles[axis]),
                before=sign * (former[axis] - left[axis]),
                went=sign * (held[axis] - former[axis]),
                elapsed=elapsed,
                retreats=abs(torque) >= FULL_SHARE * self._most[axis],
            )
            if allowed < wanted:
                bounded = (*bounded[:axis], held[axis] + sign * allowed, *bounded[axis + 1 :])
        return bounded

    def near(self, held: Joints, angles: Joints) -> Joints:
        """The held angles, each moved towards the measured one until it presses with no more than the limit [rad]."""
        return tuple(
            here if reach == inf else min(max(angle, here - reach), here + reach)
            for angle, here, reach in zip(held, angles, self._reach, strict=True)
        )


class JointGuard(TripGuard[Joints]):
    """Bounds the commanded angles by speed and range; the counterpart of `CommandGuard`.

    Each axis moves on its own, at most at the speed. When it is released the arm holds. A torque above its limit trips
    it: the axes of such torques back off along them, by `TRIP_RETREAT` from both the measured and the commanded angle,
    and the others hold. It follows again once `TRIP_PAUSE` has passed and the command is as far out of the contact.

    Args:
        lower: least angles [rad].
        upper: largest angles [rad].
        trip: torque of the environment above which an axis trips [N m].
        speed: largest speed of an axis while following [rad/s], > 0.
        approach_speed: speed of the approach and of a retreat [rad/s], > 0.
        ramp: time in which torque fades in and out [s], > 0.
    """

    __slots__ = ("_lower", "_trip", "_upper")

    def __init__(
        self, *, lower: Joints, upper: Joints, trip: Joints, speed: float, approach_speed: float, ramp: float
    ) -> None:
        start: Joints = (0.0,) * len(lower)
        super().__init__(start, toward, self._inside, _is_beyond, speed=speed, approach_speed=approach_speed, ramp=ramp)
        if not all(low <= high for low, high in zip(lower, upper, strict=True)):
            raise ValueError(f"no range of angles from {lower} to {upper}")
        self._lower, self._upper = lower, upper
        # A reading that saturates at the limit is not above it.
        self._trip = tuple(torque * (1.0 + 1e-9) for torque in trip)

    @property
    def share(self) -> float:
        """The part of the measured torques that may be shown to the operator now, 0..1."""
        return self._share

    def is_overloaded(self, torques: Joints) -> bool:
        """Whether a torque of the environment is above its limit."""
        for torque, most in zip(torques, self._trip):  # noqa: B905, SIM110 - strict and any() cost as much as the loop
            if abs(torque) > most:
                return True
        return False

    def trip(self, torques: Joints, where: Joints) -> None:
        """Stop following and back off.

        Args:
            torques: of the environment, at least one above its limit [N m].
            where: the measured angles [rad].
        """
        self.release()
        out = tuple(
            copysign(1.0, torque) if abs(torque) > most else 0.0
            for torque, most in zip(torques, self._trip, strict=True)
        )
        # From the command where that is farther out: an arm that sags lies below a command that is no deeper.
        retreat = [
            held if sign == 0.0 else sign * (max(sign * held, sign * here) + TRIP_RETREAT)
            for held, here, sign in zip(self._held, where, out, strict=True)
        ]
        self._retreat_to = self._inside(tuple(retreat))
        self._way_out = self._retreat_to, out
        self._pause = TRIP_PAUSE

    def _inside(self, angles: Joints) -> Joints:
        inside = [
            low if angle < low else high if angle > high else angle
            for angle, low, high in zip(angles, self._lower, self._upper, strict=True)
        ]
        return tuple(inside)


def toward(start: Joints, goal: Joints, way: float) -> Joints:
    """The goal on each axis that is within `way` of it; on others, the angle that is `way` nearer [rad]."""
    moved = [
        end if abs(end - angle) <= way else angle + copysign(way, end - angle)
        for angle, end in zip(start, goal, strict=True)
    ]
    return tuple(moved)


def _is_beyond(goal: Joints, place: Joints, outward: Joints) -> bool:
    return all(sign * (angle - away) >= 0.0 for sign, angle, away in zip(outward, goal, place, strict=True))
