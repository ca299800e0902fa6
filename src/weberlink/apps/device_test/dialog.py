"""A person at a terminal beside a device: what they are told, asked and shown. Knows no device."""

import termios
from collections.abc import Callable, Sequence
from contextlib import suppress
from select import select
from time import monotonic, sleep
from typing import Protocol, TextIO

from rich.console import Console
from rich.live import Live
from rich.text import Text

REFRESH_S = 0.1
"""How often a live display changes on a terminal."""
PLAIN_S = 0.5
"""How often a line comes where there is no terminal,"""
PLAIN_LINES = 4
"""and how many of them."""
POLL_S = 0.001
"""Pause between two looks at a device: a loop of 1 kHz looks as often."""


class View(Protocol):
    """What is shown of a device."""

    def look(self, now: float) -> None:
        """See what there is at `now` [s]; called about a thousand times a second."""
        ...

    def lines(self) -> Sequence[str]:
        """What was seen last, the most telling line first."""
        ...


class Left(Exception):  # noqa: N818 - not an error: the person wants to stop
    """The person has ended the input."""


class Dialog:
    """Asks and tells through two streams, which may be a terminal or anything else.

    Args:
        source: what they type.
        screen: what they see.
        yes: agree to whatever is asked for with the word yes.
        clock: monotonic [s].
        pause: waits [s].
        poll: pause between two looks at a device [s].
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
        self.now = clock
        """The time [s]."""

    def tell(self, *lines: str) -> None:
        self._screen.write("".join(f"{line}\n" for line in lines))
        self._screen.flush()

    def ask(self, prompt: str) -> str:
        """What is typed after the prompt was shown, in lower case.

        Raises:
            Left: at the end of input.
        """
        self._forget_typed()
        self._screen.write(prompt)
        self._screen.flush()
        return self._line().strip().lower()

    def choose(self, prompt: str, answers: Sequence[str]) -> str:
        """One of the answers, asked for until it is given."""
        while (answer := self.ask(prompt)) not in answers:
            self.tell(f"Please type one of {', '.join(answers)}, and Enter.")
        return answer

    def agrees(self, question: str) -> bool:
        """Whether they type the word yes, all of it; whoever began with --yes has done so already."""
        if self._yes:
            self.tell(f"{question}yes (--yes)")
            return True
        return self.ask(question) == "yes"

    def wait(self, seconds: float, each: Callable[[float], None]) -> None:
        """Wait, and call `each` with the time all the while."""
        until = self.now() + seconds
        while (now := self.now()) < until:
            each(now)
            self._pause(self._poll)

    def watch(self, view: View, prompt: str) -> None:
        """Show what is seen until Enter is pressed; without a terminal, a few lines and then the question."""
        if not (self._screen.isatty() and self._source.isatty()):
            for _ in range(PLAIN_LINES):
                self.wait(PLAIN_S, view.look)
                self.tell(view.lines()[0])
            self.ask(prompt)
            return
        self._forget_typed()
        view.look(self.now())
        with Live(console=Console(file=self._screen), auto_refresh=False, transient=True) as live:
            while True:
                live.update(Text("\n".join((*view.lines(), prompt))), refresh=True)
                if self._entered(REFRESH_S, view):
                    break
        self.tell(*view.lines())

    def _entered(self, seconds: float, view: View) -> bool:
        """Whether Enter is pressed within this time, while the device is looked at."""
        until = self.now() + seconds
        while (now := self.now()) < until:
            view.look(now)
            if select((self._source,), (), (), self._poll)[0]:
                self._line()
                return True
        return False

    def _line(self) -> str:
        line = self._source.readline()
        if not line:
            raise Left
        return line

    def _forget_typed(self) -> None:
        """Drop what was typed before it was asked for: no answer to a question that nobody had seen."""
        if self._source.isatty():
            with suppress(termios.error, OSError):
                termios.tcflush(self._source.fileno(), termios.TCIFLUSH)
