"""The commands of the operator's end so far, and so where the robot was as the newest news of it left."""

from math import ceil

from weberlink.geometry.vector import Vector


class SentCommands:
    """The newest commands, one for each tick, of the time `longest` [s] at least; `known` if there are any."""

    __slots__ = ("_commands", "_count", "_newest", "_tick_period", "known")

    def __init__(self, tick_period: float, longest: float) -> None:
        self._tick_period = tick_period
        self._count = ceil(longest / tick_period) + 1
        self.reset()

    def reset(self) -> None:
        self._commands: list[Vector] = []
        self._newest = 0
        self.known = False

    def add(self, command: Vector) -> None:
        """Take in the command of this tick [m]."""
        if not self.known:  # it stands for those before it too
            self.known, self._commands = True, [command] * self._count
        newest = self._newest + 1
        self._newest = newest = newest if newest < self._count else 0
        self._commands[newest] = command

    def ago(self, time: float) -> Vector:
        """The command of so long ago [s], or the oldest known; there must be one."""
        ticks = round(time / self._tick_period)
        return self._commands[self._newest - (ticks if ticks < self._count else self._count - 1)]
