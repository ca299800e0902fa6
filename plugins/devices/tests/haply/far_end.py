"""The far end of the wire in the hands of a test: what the board answers, question by question."""

import os
import threading
import tty
from collections.abc import Callable
from select import select
from struct import pack

from weberlink_devices.haply.board import RESET
from weberlink_devices.haply.linkage import VERSIONS

BOARD = VERSIONS["v3"].board
ZERO = BOARD.torques(0.0, 0.0)


COUNT_DEG = 360.0 / 4880.0


def answer(first: float, second: float = 0.0) -> bytes:
    """Angles of encoders 1 and 2 [counts]."""
    return BOARD.bare_reply + pack("<2f", second * COUNT_DEG, first * COUNT_DEG)


def at(first_deg: float, second_deg: float) -> bytes:
    """The nearest counts [deg]."""
    return answer(round(first_deg / COUNT_DEG), round(second_deg / COUNT_DEG))


def counts(angles: tuple[float, float]) -> tuple[int, int]:
    return (round(angles[0] / COUNT_DEG), round(angles[1] / COUNT_DEG))


LENGTHS = {0: len(RESET), 1: len(BOARD.setup), 2: len(ZERO)}


class Far:
    """Does the next deed for each question that comes, and `rest` once there are no more."""

    def __init__(self) -> None:
        self.near, self._far = os.openpty()
        tty.setraw(self._far)
        self.path = os.ttyname(self._far)
        self.messages: list[bytes] = []
        self.deeds: list[Callable[[], None]] = []
        self.rest: Callable[[], None] = lambda: None
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def say(self, data: bytes) -> None:
        os.write(self.near, data)

    def stop(self) -> None:
        self._stopping.set()
        self._thread.join()
        os.close(self.near)
        os.close(self._far)

    def _serve(self) -> None:
        heard = b""
        while not self._stopping.is_set():
            if not select((self.near,), (), (), 0.01)[0]:
                continue
            heard += os.read(self.near, 1000)
            while heard and (length := LENGTHS.get(heard[0], 1)) <= len(heard):
                self._take(heard[:length])
                heard = heard[length:]

    def _take(self, message: bytes) -> None:
        if message[0] not in LENGTHS:
            return  # as the firmware ignores it
        self.messages.append(message)
        if message[0] == 2:
            (self.deeds.pop(0) if self.deeds else self.rest)()
