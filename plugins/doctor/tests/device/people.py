"""A simulated person at the keyboard, and the clock of the tests of devices."""

import io
from collections.abc import Callable
from typing import Any

from weberlink_doctor.device.dialog import Dialog


class Clock:
    """Time that passes only while somebody waits."""

    def __init__(self) -> None:
        self.now = 100.0
        self.on_pause: Callable[[float], None] = lambda now: None

    def pause(self, seconds: float) -> None:
        self.now += seconds
        self.on_pause(self.now)


class Keyboard(io.StringIO):
    """Types lines, each of which may be a pair of an action before it and the line; then the input ends."""

    def __init__(self, screen: io.StringIO, *lines: str | tuple[Callable[[], None], str]) -> None:
        super().__init__()
        self._screen = screen
        self.left = list(lines)

    def readline(self, size: int | None = -1, /) -> str:  # type: ignore[override]
        if not self.left:
            return ""
        line = self.left.pop(0)
        if isinstance(line, tuple):
            line[0]()
            line = line[1]
        self._screen.write(f"{line}\n")  # as a terminal echoes it
        return f"{line}\n"


def sitting(clock: Clock, screen: io.StringIO, *lines: Any, yes: bool = False) -> tuple[Dialog, Keyboard]:
    """A dialog with a person who types these lines; it reads the device at 100 Hz to save time."""
    keyboard = Keyboard(screen, *lines)
    return Dialog(keyboard, screen, yes=yes, clock=lambda: clock.now, pause=clock.pause, poll=0.01), keyboard
