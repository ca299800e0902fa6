"""What tests of hardware share: a device on the wire that answers at once, and what a test leaves behind."""

from contextlib import suppress
from pathlib import Path

from weberlink.hardware.emulator import WireFaults


class Answering:
    """An emulator without mechanics or timers: `receive` of a subclass adds to `answers`."""

    def __init__(self) -> None:
        self.faults = WireFaults()
        self.answers: list[bytes] = []

    def advance(self, now: float) -> None: ...

    def replies(self, now: float) -> list[bytes]:
        answers, self.answers = self.answers, []
        return answers

    def next_timer(self) -> float | None:
        return None


def descriptors() -> set[str]:
    """The open ones of this process; what is opened to find out is not among them."""
    found = set()
    for entry in Path("/proc/self/fd").iterdir():
        with suppress(OSError):
            found.add(f"{entry.name}: {entry.readlink()}")
    return found
