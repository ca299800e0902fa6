"""A visit in a real browser: `weberlink try`, and a mouse that drags the handle over the dome."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import cos, pi, sin
from pathlib import Path
from time import monotonic, sleep

from tests.apps.monitor.browser import Browser
from tests.apps.monitor.monitors import Monitor

ABOVE_PX, DEEP_PX, WIDE_PX = -10.0, 110.0, 60.0
"""Way of the mouse from where it grabs: upwards first, then down into the dome, and to both sides."""
ROUND_S = 4.0
"""Time for a way to one side, to the other, and back."""


class Visit:
    """A page of `weberlink try`, and the process.

    Args:
        page: which has the address open.
        monitor: the process.
    """

    def __init__(self, page: Browser, monitor: Monitor) -> None:
        self.page = page
        self.monitor = monitor
        self._at = (0.0, 0.0)

    @property
    def session(self) -> str:
        """Process id of the launcher of the session."""
        return self.monitor.until_said(r"session (\d+): master")

    def grab(self) -> None:
        """Press the mouse in the middle of the 3-D view, where any place moves the handle."""
        if self.page.run("return document.getElementById('anywhere').getAttribute('aria-pressed')") != "true":
            self.page.run("document.getElementById('anywhere').click()")
        left, top, width, height = self.page.run(
            "const {x, y, width, height} = document.querySelector('#scene canvas').getBoundingClientRect();"
            "return [x, y, width, height]"
        )
        self._at = (left + 0.5 * width, top + 0.4 * height)
        self.page.wait(self._press, "the handle to be held")

    def _press(self) -> bool:
        """Press, unless there is no handle yet; returns whether it is held."""
        self._mouse("mouseMoved", 0.0, 0.0, pressed=False)
        self._mouse("mousePressed", 0.0, 0.0)
        if self.page.run("return document.getElementById('scene').classList.contains('held')"):
            return True
        self.release()
        return False

    def move(self, right: float, down: float) -> None:
        """Move the pressed mouse to a place beside where it was pressed [px]."""
        self._mouse("mouseMoved", right, down)

    def release(self) -> None:
        self._mouse("mouseReleased", 0.0, 0.0, pressed=False)

    def rub(self, seconds: float, between: Callable[[], object] = lambda: None, pause: float = 0.01) -> int:
        """Press into the dome and move to and fro; returns the number of moves."""
        began, moves = monotonic(), 0
        while (t := monotonic() - began) < seconds:
            down = ABOVE_PX + (DEEP_PX - ABOVE_PX) * min(1.0, t / 1.5)
            self.move(WIDE_PX * sin(2.0 * pi * t / ROUND_S), down + 5.0 * cos(2.0 * pi * t / ROUND_S))
            between()
            moves += 1
            sleep(pause)
        return moves

    def _mouse(self, kind: str, right: float, down: float, *, pressed: bool = True) -> None:
        x, y = self._at
        told = {"type": kind, "x": x + right, "y": y + down, "clickCount": 1, "button": "left", "buttons": int(pressed)}
        self.page.driver.execute_cdp_cmd("Input.dispatchMouseEvent", told)


@contextmanager
def visit(page: Browser, folder: Path, *arguments: object) -> Iterator[Visit]:
    """A session to drive, with its page open and drawn."""
    with Monitor(folder, *arguments, command="try") as monitor:
        page.open(monitor.address)
        page.wait(lambda: page.data("scene") == "webgl", "the 3-D view")
        page.wait(lambda: page.data("state") in ("engaged", "released"), "the session")
        yield Visit(page, monitor)
