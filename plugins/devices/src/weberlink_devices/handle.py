"""The handle of an emulated haptic device in the modelled hand of the `operator` driver."""

from pydantic import Field

from weberlink.geometry.vector import ZERO, Vector, add, distance, interpolate, is_finite
from weberlink.master.devices.operator import OperatorDevice, OperatorOptions

STEP = 0.001  # longest step of the hand's model [s]

CARRY_M_S = 0.25  # speed at which a handle is carried [m/s]


class HandleOptions(OperatorOptions):
    """Options of the hand: those of `operator`, and the origin of its script in the device's workspace."""

    force_n: float = Field(
        default=100.0, gt=0.0, description="what the hand still yields to; far beyond what the device is to display"
    )
    origin_m: Vector = Field(
        default=ZERO, description="of the script, in the device's frame; it moves within `workspace_m` about it"
    )


class Handle:
    """A handle in a hand, in the frame of the device; deterministic for the same calls. `options`: who holds it."""

    def __init__(self, options: HandleOptions) -> None:
        self._origin = options.origin_m
        self._hand = OperatorDevice(options, STEP)
        self._carried_to: Vector | None = None
        self._carried = False
        self._now: float | None = None
        self.position = add(options.home_m, options.origin_m)  # [m]

    def advance(self, force: Vector, now: float) -> Vector:
        """Move on to `now` [s] under `force` [N] since the last call; gives the position.

        Nothing moves in the first call, which only sets the clock, nor where `now` goes back. After more than 0.1 s
        without a call the hand pauses, as that of `operator` does; it never jumps. Raises ValueError for a force that
        is not finite.
        """
        if not is_finite(force):
            raise ValueError(f"a handle under a force that is not finite: {force}")
        if self._now is None:
            self._hand.open(now)
            self._now = now
        if now <= self._now:
            return self.position
        elapsed, self._now = now - self._now, now
        if self._carried_to is None:
            self._hand.command(force, now)
            goal = add(self._hand.latest(now).position, self._origin)
        else:
            goal = self._carried_to
        self.position = self._carry(goal, elapsed) if self._carried else goal
        return self.position

    def carry(self, to: Vector | None) -> None:
        """Carry the handle to a place and hold it there; None: back to the script, which has paused."""
        self._carried_to = to
        self._carried = True

    @property
    def arrived(self) -> bool:
        """Whether a carried handle has arrived; True also while the hand follows its script."""
        return not self._carried or self.position == self._carried_to

    def _carry(self, goal: Vector, elapsed: float) -> Vector:
        left, reach = distance(self.position, goal), CARRY_M_S * min(elapsed, 0.1)
        if left <= reach:
            self._carried = self._carried_to is not None
            return goal
        return interpolate(self.position, goal, reach / left)
