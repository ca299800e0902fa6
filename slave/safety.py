"""What stands between a decoded command and the robot: engagement without a jump, a speed limit, a workspace.

Owns no clock and no network; it is told the time that passed and what the session looks like.
"""

from math import hypot

from codec.vector import ZERO, Vector, add, distance, norm, scale, subtract, unit

Workspace = tuple[Vector, Vector]


class CommandGuard:
    """Turns decoded commands into commands that the robot may follow.

    After an engagement the robot approaches the commanded position at a limited speed, and follows it without delay
    once it is there: a peer that returns elsewhere is not a jump. Until then what it feels does not belong to the
    operator's position, so none of its force is shown; afterwards it fades in. Without a session the robot holds where
    it was, or backs off along the last contact force.
    """

    __slots__ = (
        "_approach_speed",
        "_following",
        "_held",
        "_ramp",
        "_retract",
        "_retreat_to",
        "_share",
        "_speed",
        "_workspace",
        "clipped",
    )

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
        self._workspace = workspace
        self._speed = speed
        self._approach_speed = approach_speed
        self._ramp = ramp
        self._retract = retract
        self._held: Vector = ZERO
        self._share = 0.0
        self._following = False
        self._retreat_to: Vector | None = None
        self.clipped = False

    def place(self, position: Vector) -> None:
        """Hold at a position [m]: where the robot is."""
        self._held = position
        self._following = False
        self._retreat_to = None

    @property
    def following(self) -> bool:
        """Whether the robot is where it is told to be."""
        return self._following

    def shown(self, force: Vector) -> Vector:
        """The part of the robot's force [N] that may be shown to the operator now."""
        share = self._share
        return force if share == 1.0 else (force[0] * share, force[1] * share, force[2] * share)

    @property
    def ramping(self) -> bool:
        """Whether less than the whole force is shown."""
        return self._share < 1.0

    def release(self, contact_force: Vector = ZERO) -> None:
        """The session is lost: hold, or retreat along the reaction of the surface [N]."""
        self._following = False
        self._share = 0.0
        if self._retract > 0.0 and norm(contact_force) > 0.0:
            self._retreat_to = self._inside(add(self._held, scale(unit(contact_force), self._retract)))

    def hold(self, elapsed: float) -> Vector:
        """The command of a tick without a session: the last one, or a step of the retreat."""
        self._following = False
        self._share = 0.0
        if self._retreat_to is not None:
            self._held = _toward(self._held, self._retreat_to, self._approach_speed * elapsed)
        return self._held

    def follow(self, commanded: Vector, elapsed: float) -> Vector:
        """The command of a tick in session: the decoded one, bounded by workspace and speed [m]."""
        self._retreat_to = None
        inside = self._inside(commanded)
        speed = self._speed if self._following else self._approach_speed
        held = _toward(self._held, inside, speed * elapsed)
        self._following = self._following or held == inside
        self._share = min(1.0, self._share + elapsed / self._ramp) if self._following else 0.0
        self._held = held
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
