"""The commands of the operator's end so far, and so where the robot was as the newest news of it left."""

from math import ceil

from weberlink.geometry.vector import ZERO, Vector


class SentCommands:
    """The newest commands, one for each tick, of the time `longest` [s] at least."""

    __slots__ = ("_commands", "_known", "_newest", "_tick_period")

    def __init__(self, tick_period: float, longest: float) -> None:
        self._tick_period = tick_period
        self._commands: list[Vector] = [ZERO] * (ceil(longest / tick_period) + 1)
        self.reset()

    def reset(self) -> None:
        self._newest = self._known = 0

    def add(self, command: Vector) -> None:
        """Take in the command of this tick [m]."""
        self._newest = (self._newest + 1) % len(self._commands)
        self._commands[self._newest] = command
        self._known = min(self._known + 1, len(self._commands))

    def ago(self, time: float) -> Vector:
        """The command of so long ago [s], or the oldest known; there must be one."""
        ticks = min(round(time / self._tick_period), self._known - 1)
        return self._commands[self._newest - ticks]  # an index below 0 counts from the end

    def __bool__(self) -> bool:
        return self._known > 0
