"""The emulated board with brackets keeps the rules that its firmware is described with; in virtual time."""

from typing import Any

import pytest

from weberlink.master.devices.polhem.serial_protocol import SerialStatus, SerialStatusReader, encode_currents
from weberlink.master.emulators.polhem.serial_board import PolhemSerialEmulator, PolhemSerialEmulatorOptions

TICK = 0.001
STILL = {"script": [{"motion": "rest", "duration_s": 100.0}], "tremor_m": 0.0}


class Desk:
    """An emulated device and its time."""

    def __init__(self, **options: Any) -> None:
        self.emulator = PolhemSerialEmulator(PolhemSerialEmulatorOptions.model_validate({"handle": STILL, **options}))
        self.now = 100.0
        self.emulator.advance(self.now)

    def wait(self, seconds: float) -> list[SerialStatus]:
        answers = b""
        until = self.now + seconds
        while self.now < until:
            self.now = min(self.now + TICK, until)
            self.emulator.advance(self.now)
            answers += b"".join(self.emulator.replies(self.now))
        return SerialStatusReader().feed(answers)

    def say(self, data: bytes, wait: float = TICK) -> list[SerialStatus]:
        self.emulator.receive(data, self.now)
        return self.wait(wait)

    def ask(self, *currents: int) -> SerialStatus:
        a, b, c = currents or (0, 0, 0)
        (answer,) = self.say(encode_currents((a, b, c)))
        return answer


def test_current_over_limit_is_no_current() -> None:
    desk = Desk()
    assert desk.say(b"[6001,-6000,-2147483648]\n")[0].error == 0
    assert desk.emulator.currents_ma == (0.0, -6000.0, 0.0)


def test_watchdog_trips_at_its_own_time() -> None:
    desk = Desk(handle={**STILL, "hand": {"stiffness_n_m": 100.0}})
    desk.ask(500, 0, 0)
    fed = desk.now
    desk.emulator.advance(fed + 3600.0)
    assert desk.emulator.watchdog_trips == 1
    assert desk.emulator.last_force_at == pytest.approx(fed + 0.1, abs=2 * TICK)


@pytest.mark.parametrize(
    ("data", "errors"),
    [
        (b"[1,2,3]\n[4,5,6]\n", [8, 256]),  # the first takes the beginning of the second
        (b"[1,2,3]\n[4,5,6]\n]", [8, 256, 256]),
        (b"[1,2,3]x", [8]),
        (b"[1,2,3" + b" " * 200, [128]),
        (b"1,2,3]", [256]),
        (b"[1,2]", [512]),
        (b"[1,[2,3,4]", [512]),
        (b"[1,2,3,4]", [512]),
        (b"[1,2,x]", [1024]),
        (b"[1,,3]", [1024]),
        (b"[1.5,2,3]", [1024]),
        (b"[1,2\0,3]", [1024]),
    ],
)
def test_wrong_message_gets_its_error_and_no_current(data: bytes, errors: list[int]) -> None:
    desk = Desk(handle={})
    last = desk.ask(100, 100, 100).counts
    desk.wait(0.05)
    assert desk.emulator.counts != last
    answers = desk.say(data)
    assert [answer.error for answer in answers] == errors
    assert {answer.counts for answer in answers} == {last}
    assert desk.emulator.currents_ma == (100.0, 100.0, 100.0)
    assert desk.emulator.errors == len(errors)
    good = desk.ask(7, 8, 9)
    assert good.error == 0
    assert good.counts != last
    assert desk.emulator.currents_ma == (7.0, 8.0, 9.0)
