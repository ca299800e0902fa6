"""The far end of the wire in the hands of a test: what the board answers, question by question."""

from struct import pack
from time import sleep

from weberlink.hardware.emulator import Emulator
from weberlink_devices.haply.board import RESET
from weberlink_devices.haply.linkage import VERSIONS

BOARD = VERSIONS["v3"].board
ZERO = BOARD.torques(0.0, 0.0)
COUNT_DEG = 360.0 / 4880.0
LENGTHS = {0: len(RESET), 1: len(BOARD.setup), 2: len(ZERO)}


def answer(first: float, second: float = 0.0) -> bytes:
    """Angles of encoders 1 and 2 [counts]."""
    return BOARD.bare_reply + pack("<2f", second * COUNT_DEG, first * COUNT_DEG)


def at(first_deg: float, second_deg: float) -> bytes:
    """The nearest counts [deg]."""
    return answer(round(first_deg / COUNT_DEG), round(second_deg / COUNT_DEG))


def counts(angles: tuple[float, float]) -> tuple[int, int]:
    return (round(angles[0] / COUNT_DEG), round(angles[1] / COUNT_DEG))


class Far(Emulator):
    """An emulator that says the next answer to each question that comes, and `rest` once there are no more."""

    def __init__(self) -> None:
        super().__init__()
        self.messages: list[bytes] = []
        self.answers: list[bytes] = []
        self.rest = b""
        self.slow_s = 0.0
        self._heard = b""

    def receive(self, data: bytes, now: float) -> None:
        self._heard += data
        while self._heard and (length := LENGTHS.get(self._heard[0], 1)) <= len(self._heard):
            message, self._heard = self._heard[:length], self._heard[length:]
            if message[0] in LENGTHS:  # the firmware ignores others
                self.messages.append(message)
            if message[0] == 2:
                sleep(self.slow_s)
                self.leaving.append(self.answers.pop(0) if self.answers else self.rest)
