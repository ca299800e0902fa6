"""Where the tip is meant to be, from commands that may come, stop and come back. Knows no bus and no clock."""

from weberlink.geometry.vector import ZERO, Vector, add, distance, scale, subtract


class Goal:
    """Follows commands; holds the tip where it is, with no spring drawn, once they have stopped.

    From there, as after `place`, it goes to the next command at a limited speed, and follows without delay once it is
    there: whatever happened meanwhile, the arm does not jump.

    Args:
        approach_speed: [m/s], > 0.
        patience: how long the last command holds when no more come [s].
    """

    def __init__(self, approach_speed: float, patience: float) -> None:
        self._approach_speed = approach_speed
        self._patience = patience
        self._point: Vector = ZERO
        self._following = False
        self._holding = True
        self._heard_at = 0.0
        self._at = 0.0

    @property
    def holding(self) -> bool:
        """Whether there is no command."""
        return self._holding

    def place(self, tip: Vector, now: float) -> None:
        """Hold here [m]."""
        self._point = tip
        self._following = False
        self._holding = True
        self._at = self._heard_at = now

    def next(self, command: Vector | None, tip: Vector, now: float) -> Vector:
        """The goal [m] at `now` [s], for a command (None: there is none) and a tip that is there [m]."""
        elapsed, self._at = max(0.0, now - self._at), now
        if command is None:
            if not self._holding and now - self._heard_at > self._patience:
                self.place(tip, now)
            return self._point
        self._heard_at = now
        self._holding = False
        way, left = self._approach_speed * elapsed, distance(self._point, command)
        self._following = self._following or left <= way
        if self._following:
            self._point = command
        else:
            self._point = add(self._point, scale(subtract(command, self._point), way / left))
        return self._point
