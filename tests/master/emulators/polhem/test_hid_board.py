"""The emulated boards with HID keep the rules of their firmware; in virtual time."""

from collections.abc import Sequence
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.examples import examples
from weberlink.master.devices.polhem.hid_protocol import (
    LONG,
    SHORT,
    Sensors,
    SetCounters,
    decode_sensors,
    encode_command,
)
from weberlink.master.emulators.polhem.hid_board import PolhemHidEmulator, PolhemHidEmulatorOptions

FRAME = 0.001
STILL = {"script": [{"motion": "rest", "duration_s": 100.0}], "tremor_m": 0.0}
LONG_DESCRIPTOR = "06abff0a0002a1017508150025ff950e09018102950e09029102c0"


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


def test_it_says_what_the_board_says_of_itself() -> None:
    identity = Desk(serial_number="17").emulator.identity
    assert (identity.vendor, identity.product, identity.serial_number) == (0x1234, 0x0006, "17")
    assert identity.report_descriptor.hex() == LONG_DESCRIPTOR
    assert identity.report_size == LONG
    short = Desk(report=8).emulator.identity
    assert short.report_size == SHORT
    assert short.report_descriptor.hex() == LONG_DESCRIPTOR.replace("950e", "9508")


def test_it_sends_one_report_and_then_waits_for_the_host() -> None:
    desk = Desk()
    assert len(desk.wait(1.0)) == 1
    for number in range(5):
        assert len(desk.command((number, 0, 0))) == 1
        assert desk.emulator.currents_ma == (number, 0.0, 0.0)
        assert not desk.wait(0.01)


def test_of_reports_that_wait_it_takes_the_newest_alone() -> None:
    desk = Desk()
    desk.wait()
    for current in (1, 2, 3):
        desk.emulator.receive(encode_command((current, 0, 0), LONG), desk.now)
    assert len(desk.wait(0.05)) == 1
    assert desk.emulator.currents_ma == (3.0, 0.0, 0.0)
    assert desk.emulator.largest_current_ma == 3.0


def test_any_report_switches_the_amplifiers_on_and_silence_off_after_half_a_second() -> None:
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


def test_the_board_does_not_limit_but_the_amplifiers_end_somewhere() -> None:
    desk = Desk()
    desk.wait()
    desk.command((3200, -32_000, 0))
    assert desk.emulator.currents_ma == (3200.0, -3750.0, 0.0)


def test_counters_are_set_on_command_with_no_current_and_go_on_from_there() -> None:
    desk = Desk(parameters="polhem_v3")
    desk.wait()
    desk.command((900, 0, 0))
    (report,) = desk.command(SetCounters((1, -2, 3, 40, 50, 60)))
    assert desk.emulator.currents_ma == (0.0, 0.0, 0.0)
    assert report.counts == pytest.approx((1, -2, 3, 40, 50, 60), abs=3), "wrist and hand move on"


def test_the_button_is_remembered_until_the_counters_are_set() -> None:
    desk = Desk()
    desk.wait()
    desk.emulator.inject("button")
    desk.wait()
    for _ in range(3):
        assert desk.command((0, 0, 0))[0].calibrate
    assert not desk.command(SetCounters((0, 0, 0, 0, 0, 0)))[0].calibrate


def test_the_button_of_the_stylus_is_in_the_fourth_count() -> None:
    desk = Desk()
    assert not desk.wait()[0].button
    desk.emulator.inject("stylus")
    desk.wait()
    (report,) = desk.command((0, 0, 0))
    assert report.button
    desk.emulator.inject("stylus", 0.0)
    desk.wait()
    assert not desk.command((0, 0, 0))[0].button


def test_the_gimbal_of_a_polhem_comes_last_to_first() -> None:
    desk = Desk(parameters="polhem_v3", handle={})
    desk.wait()
    desk.wait(0.7)
    desk.emulator.receive(encode_command((0, 0, 0), LONG), desk.now)
    desk.emulator.advance(desk.now + 0.0002)
    d, e, f = desk.emulator.counts[3:]
    assert len({d, e, f}) == 3
    assert desk.wait(2 * FRAME)[0].counts[3:] == (f, e, d)


def test_a_restart_begins_with_a_report_of_zeros() -> None:
    desk = Desk()
    desk.wait()
    desk.command((900, 0, 0))
    desk.emulator.inject("restart")
    (first,) = desk.wait(0.1)
    assert not desk.emulator.enabled
    assert max(map(abs, first.counts[:3])) < 20
    assert not desk.wait(0.1)


class TestOlder:
    """The board with reports of 8 bytes."""

    def test_it_sends_a_numbered_report_each_frame_whether_anybody_speaks_or_not(self) -> None:
        reports = Desk(report=8).wait(0.05)
        assert [each.number for each in reports] == list(range(1, 51))

    def test_it_takes_what_waits_one_by_one(self) -> None:
        desk = Desk(report=8)
        for current in (1, 2, 3):
            desk.emulator.receive(encode_command((current, 0, 0), SHORT), desk.now)
        seen = []
        for _ in range(4):
            desk.wait(FRAME)
            seen.append(desk.emulator.currents_ma[0])
        assert seen == [1.0, 2.0, 3.0, 3.0]

    def test_it_limits_currents_to_three_amperes(self) -> None:
        desk = Desk(report=8)
        desk.command((3001, -9000, 2999))
        assert desk.emulator.currents_ma == (3000.0, -3000.0, 2999.0)

    def test_its_watchdog_is_as_long(self) -> None:
        desk = Desk(report=8)
        desk.command((100, 0, 0))
        desk.wait(0.49)
        assert desk.emulator.enabled
        desk.wait(0.02)
        assert not desk.emulator.enabled

    def test_frames_that_nobody_looked_at_are_not_made_up_for(self) -> None:
        desk = Desk(report=8, frame_s=0.0)
        desk.emulator.advance(desk.now + 5.0)
        assert len(desk.emulator.replies(desk.now + 5.0)) == 1
        assert desk.emulator.next_timer() == pytest.approx(desk.now + 5.0, abs=1.001 * FRAME)


@examples(25)
@given(
    st.sampled_from([14, 8]),
    st.sampled_from([0.0, 0.001, 0.00033]),
    st.lists(
        st.tuples(st.one_of(st.binary(max_size=20), st.binary(min_size=14, max_size=14)), st.floats(0.0, 0.7)),
        max_size=12,
    ),
)
def test_no_bytes_at_no_time_break_it(report: int, frame: float, pieces: Sequence[tuple[bytes, float]]) -> None:
    desk = Desk(report=report, frame_s=frame)
    for data, pause in pieces:
        desk.emulator.receive(data, desk.now)
        desk.now += pause
        desk.emulator.advance(desk.now)
        assert all(len(each) == report for each in desk.emulator.replies(desk.now))
        assert max(map(abs, desk.emulator.currents_ma)) <= 3750.0
        timer = desk.emulator.next_timer()
        assert timer is None or timer > desk.now
    desk.now += 0.6
    desk.emulator.advance(desk.now)
    assert not desk.emulator.enabled
    assert desk.command((1, 2, 3))
    assert desk.emulator.currents_ma == (1.0, 2.0, 3.0)
