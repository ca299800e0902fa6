"""A dialog with a person who tests a device: questions, a live view of readings, and Ctrl-C that waits."""

import termios
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from math import inf
from select import select
from signal import SIGINT, signal
from threading import current_thread, main_thread
from time import monotonic, sleep
from typing import Any, TextIO

from rich.console import Console
from rich.live import Live
from rich.text import Text

REFRESH_S = 0.1  # period of a live display on a terminal
PLAIN_S, PLAIN_LINES = 0.5, 4  # period and number of lines where there is no terminal
POLL_S = 0.001  # pause between two readings of a device, as in a loop of 1 kHz
WINDOW_S = 1.0


class StoppedByUser(Exception):  # noqa: N818 - not an error
    """The person ended the input."""


class Dialog:
    """A dialog over two text streams, which may be a terminal.

    With `yes` every question is agreed to that needs that word; `poll` is the pause between two readings [s].
    """

    def __init__(
        self,
        source: TextIO,
        screen: TextIO,
        *,
        yes: bool = False,
        clock: Callable[[], float] = monotonic,
        pause: Callable[[float], None] = sleep,
        poll: float = POLL_S,
    ) -> None:
        self._source = source
        self._screen = screen
        self._yes = yes
        self._pause = pause
        self._poll = poll
        self.now = clock  # the time [s]

    def tell(self, *lines: str) -> None:
        self._screen.write("".join(f"{line}\n" for line in lines))
        self._screen.flush()

    def ask(self, prompt: str) -> str:
        """The answer typed after the prompt, in lower case. Raises StoppedByUser at the end of input."""
        self._discard_typed()
        self._screen.write(prompt)
        self._screen.flush()
        return self._line().strip().lower()

    def choose(self, prompt: str, answers: Sequence[str]) -> str:
        """Ask until one of the answers is given."""
        while (answer := self.ask(prompt)) not in answers:
            self.tell(f"Please type one of {', '.join(answers)}, and Enter.")
        return answer

    def agrees(self, question: str) -> bool:
        """Whether the person types the whole word yes, or started with --yes."""
        if self._yes:
            self.tell(f"{question}yes (--yes)")
            return True
        return self.ask(question) == "yes"

    def wait(self, seconds: float, each: Callable[[float], None]) -> None:
        """Wait, and call `each` with the time meanwhile."""
        until = self.now() + seconds
        while (now := self.now()) < until:
            each(now)
            self._pause(self._poll)

    def watch(self, view: "View", prompt: str) -> None:
        """Show a view until Enter is pressed; without a terminal, print a few lines and then ask."""
        if not (self._screen.isatty() and self._source.isatty()):
            for _ in range(PLAIN_LINES):
                self.wait(PLAIN_S, view.read)
                self.tell(view.lines()[0])
            self.ask(prompt)
            return
        self._discard_typed()
        view.read(self.now())
        with Live(console=Console(file=self._screen), auto_refresh=False, transient=True) as live:
            shown_at = -inf
            while not select((self._source,), (), (), self._poll)[0]:
                view.read(now := self.now())
                if now - shown_at >= REFRESH_S:
                    live.update(Text("\n".join((*view.lines(), prompt))), refresh=True)
                    shown_at = now
        self._line()
        self.tell(*view.lines())

    def _line(self) -> str:
        line = self._source.readline()
        if not line:
            raise StoppedByUser
        return line

    def _discard_typed(self) -> None:
        """Discard input typed before the question was shown."""
        if self._source.isatty():
            with suppress(termios.error, OSError):
                termios.tcflush(self._source.fileno(), termios.TCIFLUSH)


class View:
    """The last reading of a device or a robot, in lines, with the rate and age of its samples over the last second.

    `latest` reads at a time [s], about a thousand times a second; `details` gives further lines on a reading.
    """

    def __init__(
        self,
        latest: Callable[[float], Any],
        details: Callable[[Any], Iterable[str]],
        round_trip_s: Callable[[], float | None] = lambda: None,
    ) -> None:
        self._latest, self._details, self._round_trip_s = latest, details, round_trip_s
        self._arrivals: deque[tuple[float, float]] = deque()
        self._ages: deque[tuple[float, float]] = deque()
        self._began: float | None = None
        self._last_at: float | None = None
        self._reading: Any = None

    def read(self, now: float) -> None:
        self._reading = reading = self._latest(now)
        # Of a robot whose reading is interpolated between two samples, this is the time of the newest sample.
        sampled_at = getattr(reading, "sampled_at", None) or reading.at
        self._began = now if self._began is None else self._began
        if sampled_at != self._last_at:
            if self._last_at is not None:  # the arrival time of the first one is unknown
                self._arrivals.append((now, sampled_at))
            self._last_at = sampled_at
        self._ages.append((now, now - reading.at))
        for kept in (self._arrivals, self._ages):
            while kept and kept[0][0] <= now - WINDOW_S:
                kept.popleft()

    def lines(self) -> list[str]:
        """The most important one first: samples per second, greatest age, and round trip of an exchange."""
        components = zip("xyz", self._reading.position, strict=True)
        position = "  ".join(f"{axis} {component * 1e3:+7.1f}" for axis, component in components)
        window = 0.0 if self._began is None else min(WINDOW_S, self._ages[-1][0] - self._began)
        rate_hz = len(self._arrivals) / window if window > 0.0 else 0.0
        oldest_s = max((age for _, age in self._ages), default=0.0)
        line, round_trip_s = f"{position} mm   {rate_hz:.0f}/s, age {oldest_s * 1e3:.1f} ms", self._round_trip_s()
        trip = "" if round_trip_s is None else f", trip {round_trip_s * 1e3:.2f} ms"
        return [line + trip, *self._details(self._reading)]


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Delay Ctrl-C until the end of the block, which makes a device safe."""
    if current_thread() is not main_thread():  # signals reach the main thread only
        yield
        return
    pressed = []
    before = signal(SIGINT, lambda *_: pressed.append(True))
    try:
        yield
    finally:
        signal(SIGINT, before)
    if pressed:
        raise KeyboardInterrupt
