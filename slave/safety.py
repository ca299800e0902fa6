"""What stands between a decoded command and the robot: engagement without a jump, a speed limit, a workspace.

Owns no clock and no network; it is told the time that passed and what the session looks like.
"""

from collections.abc import Callable
from math import hypot
from typing import Generic, TypeVar

from codec.vector import ZERO, Vector, add, distance, norm, scale, subtract, unit

Workspace = tuple[Vector, Vector]
Place = TypeVar("Place", bound=tuple[float, ...])
"""What a command is: a position, or an orientation."""


class Follower(Generic[Place]):
    """Follows commands without a jump.

    After an engagement it approaches what is commanded at a limited speed, and follows it without delay once it is
    there: a peer that returns elsewhere is not a jump. Until then what the robot feels does not belong to what the
    operator does, so none of it is shown; afterwards it fades in. Without a session it holds.
    """

    __slots__ = ("_approach_speed", "_following", "_held", "_ramp", "_share", "_speed", "_toward", "clipped")

    def __init__(
        self,
        start: Place,
        toward: Callable[[Place, Place, float], Place],
        *,
        speed: float,
        approach_speed: float,
        ramp: float,
    ) -> None:
        """Make the follower.

        Args:
            start: what to hold until it is told otherwise.
            toward: the second place, or that on the way to it from the first which is so far from it.
            speed: largest speed while following [m/s, or rad/s], > 0.
            approach_speed: speed of the approach [m/s, or rad/s], > 0.
            ramp: time in which what is felt fades in [s], > 0.
        """
        self._toward = toward
        self._speed = speed
        self._approach_speed = approach_speed
        self._ramp = ramp
        self._held = start
        self._share = 0.0
        self._following = False
        self.clipped = False

    def place(self, where: Place) -> None:
        """Hold there: where the robot is."""
        self._held = where
        self._following = False

    @property
    def following(self) -> bool:
        """Whether the robot is where it is told to be."""
        return self._following

    def shown(self, felt: Vector) -> Vector:
        """The part of the robot's force [N], or torque [N m], that may be shown to the operator now."""
        share = self._share
        return felt if share == 1.0 else (felt[0] * share, felt[1] * share, felt[2] * share)

    @property
    def ramping(self) -> bool:
        """Whether less than all of it is shown."""
        return self._share < 1.0

    def release(self) -> None:
        """The session is lost: hold."""
        self._following = False
        self._share = 0.0

    def hold(self, elapsed: float) -> Place:  # noqa: ARG002 - whoever backs off needs it
        """The command of a tick without a session: the last one."""
        self._following = False
        self._share = 0.0
        return self._held

    def follow(self, commanded: Place, elapsed: float) -> Place:
        """The command of a tick in session: the one given, bounded by the speed."""
        speed = self._speed if self._following else self._approach_speed
        held = self._toward(self._held, commanded, speed * elapsed)
        self._following = self._following or held == commanded
        self._share = min(1.0, self._share + elapsed / self._ramp) if self._following else 0.0
        self._held = held
        self.clipped = self._following and held != commanded
        return held


class CommandGuard(Follower[Vector]):
    """Turns decoded positions into commands that the robot may follow: a `Follower` within a workspace.

    Without a session the robot holds where it was, or backs off along the last contact force.
    """

    __slots__ = ("_retract", "_retreat_to", "_workspace")

    def __init__(
        self,
        *,
        workspace: Workspace,
        speed: float,
        approach_speed: float,
        ramp: float,
        retract: float = 0.0,
    ) -> None:
        """Make the guard, holding at the origin until it is told where the robot is.

        Args:
            workspace: lowest and highest corner of where the robot may be commanded to [m].
            speed: largest speed while following [m/s], > 0.
            approach_speed: speed of the approach and of a retreat [m/s], > 0.
            ramp: time in which the force fades in [s], > 0.
            retract: how far to back off a contact when the session is lost [m]; 0 to hold.
        """
        super().__init__(ZERO, _toward, speed=speed, approach_speed=approach_speed, ramp=ramp)
        self._workspace = workspace
        self._retract = retract
        self._retreat_to: Vector | None = None

    def place(self, where: Vector) -> None:
        """Hold at a position [m]: where the robot is."""
        super().place(where)
        self._retreat_to = None

    def release(self, contact_force: Vector = ZERO) -> None:
        """The session is lost: hold, or retreat along the reaction of the surface [N]."""
        super().release()
        if self._retract > 0.0 and norm(contact_force) > 0.0:
            self._retreat_to = self._inside(add(self._held, scale(unit(contact_force), self._retract)))

    def hold(self, elapsed: float) -> Vector:
        """The command of a tick without a session: the last one, or a step of the retreat."""
        if self._retreat_to is not None:
            self._held = _toward(self._held, self._retreat_to, self._approach_speed * elapsed)
        return super().hold(elapsed)

    def follow(self, commanded: Vector, elapsed: float) -> Vector:
        """The command of a tick in session: the decoded one, bounded by workspace and speed [m]."""
        self._retreat_to = None
        held = super().follow(self._inside(commanded), elapsed)
        self.clipped = self._following and held != commanded
        return held

    def _inside(self, position: Vector) -> Vector:
        low, high = self._workspace
        return (
            min(max(position[0], low[0]), high[0]),
            min(max(position[1], low[1]), high[1]),
            min(max(position[2], low[2]), high[2]),
        )


def _toward(start: Vector, goal: Vector, way: float) -> Vector:
    """The goal, or the point on the way to it that is `way` from the start."""
    if distance(start, goal) <= way:
        return goal
    offset = subtract(goal, start)
    return add(start, scale(offset, way / hypot(*offset)))
