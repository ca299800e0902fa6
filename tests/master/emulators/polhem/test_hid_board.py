"""The emulated boards with HID keep the rules of their firmware; in virtual time."""

from typing import Any

import pytest

from weberlink.master.devices.polhem.hid_protocol import (
    SHORT,
    Sensors,
    SetCounters,
    decode_sensors,
    encode_command,
)
from weberlink.master.emulators.polhem.hid_board import PolhemHidEmulator, PolhemHidEmulatorOptions

FRAME = 0.001
STILL = {"script": [{"motion": "rest", "duration_s": 100.0}], "tremor_m": 0.0}


class Desk:
    """An emulated device and its time, which begins just before a frame."""

    def __init__(self, **options: Any) -> None:
        self.emulator = PolhemHidEmulator(PolhemHidEmulatorOptions.model_validate({"handle": STILL, **options}))
        self.now = 99.9999
        self.emulator.advance(self.now)

    def wait(self, seconds: float = FRAME) -> list[Sensors]:
        reports = []
        until = self.now + seconds
        while self.now < until:
            self.now = min(self.now + FRAME / 4.0, until)
            self.emulator.advance(self.now)
            reports += self.emulator.replies(self.now)
        return [decode_sensors(report) for report in reports]

    def command(self, command: tuple[int, int, int] | SetCounters, wait: float = 2 * FRAME) -> list[Sensors]:
        size = self.emulator.identity.report_size
        self.emulator.receive(encode_command(command, size), self.now)
        return self.wait(wait)


def test_silence_switches_amplifiers_off_after_half_second() -> None:
    desk = Desk()
    desk.wait()
    assert not desk.emulator.enabled
    desk.command(SetCounters((0, 0, 0, 0, 0, 0)))
    assert desk.emulator.enabled
    desk.command((700, 0, 0))
    desk.wait(0.49)
    assert desk.emulator.currents_ma == (700.0, 0.0, 0.0)
    desk.wait(0.02)
    assert not desk.emulator.enabled
    assert desk.emulator.currents_ma == (0.0, 0.0, 0.0)
    assert desk.emulator.watchdog_trips == 1
    desk.command((700, 0, 0))
    assert desk.emulator.currents_ma == (700.0, 0.0, 0.0)


def test_set_counters_command_gives_no_current() -> None:
    desk = Desk(parameters="polhem_v3")
    desk.wait()
    desk.command((900, 0, 0))
    (report,) = desk.command(SetCounters((1, -2, 3, 40, 50, 60)))
    assert desk.emulator.currents_ma == (0.0, 0.0, 0.0)
    assert report.counts == pytest.approx((1, -2, 3, 40, 50, 60), abs=3), "wrist and hand move on"


def test_the_older_board_numbers_its_reports_and_takes_what_waits_one_by_one() -> None:
    desk = Desk(report=8)
    assert [each.number for each in desk.wait(0.05)] == list(range(1, 51))
    for current in (1, 2, 3001):
        desk.emulator.receive(encode_command((current, -9000, 2999), SHORT), desk.now)
    seen = []
    for _ in range(4):
        desk.wait(FRAME)
        seen.append(desk.emulator.currents_ma)
    assert seen == [(1.0, -3000.0, 2999.0), (2.0, -3000.0, 2999.0), *[(3000.0, -3000.0, 2999.0)] * 2]
