"""An exchange that does what a test says, and notes what was done to it."""

import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from time import monotonic, sleep

from weberlink.hardware.fault import HardwareFault
from weberlink.hardware.worker import Worker

REST = "rest"
PATIENCE_S = 10.0

Deed = Callable[[str], int]


class Scripted:
    """Commands are words, samples numbers.

    Args:
        deed: what each exchange does, given the command.
        opening: what each `open` does, given how often it was called before.
    """

    def __init__(self, deed: Deed | None = None, opening: Callable[[int], int] = lambda number: number) -> None:
        self.deed = deed or self._count
        self.opening = opening
        self.calls: list[str] = []
        """"open", "close", and every command."""
        self.threads: set[int] = set()
        """That have called `exchange` or `close`."""
        self.is_open = False
        self._samples = 100

    def open(self) -> int:
        self.calls.append("open")
        sample = self.opening(self.calls.count("open") - 1)
        self.is_open = True
        return sample

    def exchange(self, command: str) -> int:
        if not self.is_open:
            raise AssertionError("exchange while closed")
        self.calls.append(command)
        self.threads.add(threading.get_ident())
        return self.deed(command)

    def close(self) -> None:
        self.calls.append("close")
        self.threads.add(threading.get_ident())
        self.is_open = False

    @property
    def commands(self) -> list[str]:
        return [call for call in self.calls if call not in ("open", "close")]

    def _count(self, command: str) -> int:
        self._samples += 1
        return self._samples


def gone(command: str) -> int:
    raise HardwareFault("gone")


def wait_for(what: Callable[[], bool]) -> None:
    until = monotonic() + PATIENCE_S
    while not what():
        assert monotonic() < until, "it did not come to be so"
        sleep(0.0005)


def command_until(worker: Worker[str, int], command: str, what: Callable[[], bool]) -> None:
    """Command over and over, as a tick does."""

    def is_so() -> bool:
        worker.command(command, monotonic())
        return what()

    wait_for(is_so)


def descriptors() -> set[str]:
    """The open ones of this process; what is opened to find out is not among them."""
    found = set()
    for entry in Path("/proc/self/fd").iterdir():
        with suppress(OSError):
            found.add(f"{entry.name}: {entry.readlink()}")
    return found
