"""`polhem_hid` against a board in place of its port; over the real hidapi it is tried with the emulator."""

from collections.abc import Callable, Iterator
from threading import Thread
from time import monotonic
from typing import Any

import pytest

from tests.hardware.scripted import wait_for
from tests.master.devices.polhem.boards import ScriptedHidBoard
from weberlink.geometry.vector import ZERO, Vector
from weberlink.master.devices.contract import DeviceFault
from weberlink.master.devices.polhem.driver import PolhemDevice
from weberlink.master.devices.polhem.hid_device import PolhemHidDevice, ReportExchange
from weberlink.master.devices.polhem.hid_protocol import LONG, SHORT, WATCHDOG_S, SetCounters
from weberlink.master.devices.polhem.options import PolhemHidOptions
from weberlink.master.devices.polhem.parameters import PARAMETERS

TICK = 0.001
WOODY = PARAMETERS["woodenhaptics_2015"].on("hid14").mechanism
MIDDLE = (*WOODY.counts_at(ZERO), 0, 0, 0)

Make = Callable[..., PolhemDevice]


@pytest.fixture
def device_on() -> Iterator[Make]:
    """Makes a device on a board; with force, whatever the signs."""
    made: list[PolhemDevice] = []

    def make(board: ScriptedHidBoard, **settings: Any) -> PolhemDevice:
        options = PolhemHidOptions(port="/dev/hidraw9", **settings)
        options = options.model_copy(update={"signs_checked": PolhemHidDevice.fingerprint(options)})
        signs = PolhemHidDevice.fingerprint(options)
        made.append(
            PolhemDevice(
                "polhem_hid",
                options,
                options.wired(),
                lambda force_n: ReportExchange(options, force_n, board),
                TICK,
                signs=signs,
                watchdog_s=WATCHDOG_S,
                buttons=1,
            )
        )
        return made[-1]

    yield make
    for device in made:
        device.close()


def press_until(device: PolhemDevice, force: Vector, condition: Callable[[], bool]) -> None:
    def pressed() -> bool:
        device.command(force, monotonic())
        return condition()

    wait_for(pressed)


def test_the_report_that_has_waited_is_not_believed(device_on: Make) -> None:
    board = ScriptedHidBoard(MIDDLE, stale=(16_000, 0, 0, 0, 0, 0))
    device = device_on(board)
    device.open(monotonic())
    assert device.latest(monotonic()).position == pytest.approx(ZERO, abs=1e-4)


def test_force_and_button(device_on: Make) -> None:
    board = ScriptedHidBoard(MIDDLE)
    device = device_on(board)
    device.open(monotonic())
    force = (1.0, -2.0, 0.5)
    expected = tuple(map(int, WOODY.currents_ma(force, MIDDLE)))
    press_until(device, force, lambda: board.commands[-1] == expected)
    board.button = True
    wait_for(lambda: device.latest(monotonic()).buttons == 1)
    device.close()
    assert (board.commands[-1], board.closed) == ((0, 0, 0), 1)


def test_the_older_kind_has_its_own_signs(device_on: Make) -> None:
    middle = PARAMETERS["woodenhaptics_2015"].on("hid8").mechanism.counts_at(ZERO)
    board = ScriptedHidBoard(middle, stale=middle)
    board.size = SHORT
    device = device_on(board, report_bytes=8)
    device.open(monotonic())
    assert device.latest(monotonic()).position == pytest.approx(ZERO, abs=1e-4)
    press_until(device, (1.0, 0.0, 0.0), lambda: board.commands[-1] != (0, 0, 0))


@pytest.mark.parametrize(("said", "sent"), [(14, 8), (8, 14)])
def test_reports_of_the_other_length_are_refused(device_on: Make, said: int, sent: int) -> None:
    """Their firmware counts the other way round."""
    board = ScriptedHidBoard((0,) * (6 if sent == LONG else 3))
    board.size = sent
    with pytest.raises(DeviceFault, match=f"sends reports of {sent} bytes, the file says {said}.*report_bytes: {sent}"):
        device_on(board, report_bytes=said).open(monotonic())
    assert not any(any(command) for command in board.commands if isinstance(command, tuple))


def test_homing_at_open_sets_the_counters(device_on: Make) -> None:
    board = ScriptedHidBoard((900, -70, 5, 1, 2, 3))
    device = device_on(board, homing="at_open")
    device.open(monotonic())
    assert SetCounters((0,) * 6) in board.commands
    assert device.latest(monotonic()).position == pytest.approx((0.025, 0.0, 0.205))


def test_counters_may_hold_the_home_counts(device_on: Make) -> None:
    board = ScriptedHidBoard((900, -70, 5, 1, 2, 3))
    device = device_on(board, homing="at_open", counters_hold_home=True, parameters="polhem_v3", home_counts=(8, 9, 10))
    device.open(monotonic())
    assert SetCounters((8, 9, 10, 0, 30, 0)) in board.commands


def test_polhem_gimbal_is_reversed_over_hid(device_on: Make) -> None:
    mechanism = PARAMETERS["polhem_v1"].on("hid14").mechanism
    device = device_on(ScriptedHidBoard((*mechanism.counts_at(ZERO), 256, 128, 0)), parameters="polhem_v1")
    device.open(monotonic())
    assert device.latest(monotonic()).orientation == mechanism.orientation((*mechanism.counts_at(ZERO), 0, 128, 256))


def test_board_that_ignores_set_counters_is_refused(device_on: Make) -> None:
    board = ScriptedHidBoard((900, -70, 5, 1, 2, 3))
    board.sets_counters = False
    with pytest.raises(DeviceFault, match="does not set its counters"):
        device_on(board, homing="at_open").open(monotonic())


def test_the_older_kind_is_homed_on_the_host(device_on: Make) -> None:
    board = ScriptedHidBoard((900, -70, 5), stale=(0, 0, 0))
    board.size = SHORT
    device = device_on(board, homing="at_open", report_bytes=8)
    device.open(monotonic())
    assert device.latest(monotonic()).position == pytest.approx((0.025, 0.0, 0.205))
    assert set(board.commands) == {(0, 0, 0)}
    with pytest.raises(DeviceFault, match="without a calibration button; set homing: at_open"):
        device_on(board, homing="button", report_bytes=8).open(monotonic())


def test_old_button_press_does_not_count(device_on: Make) -> None:
    board = ScriptedHidBoard(MIDDLE)
    board.calibrate = True

    def press_later() -> None:
        wait_for(lambda: not board.calibrate and len(board.commands) > 10)
        board.calibrate = True

    person = Thread(target=press_later)
    person.start()
    device = device_on(board, homing="button")
    device.open(monotonic())
    person.join()
    assert [each for each in board.commands if isinstance(each, SetCounters)] == [
        SetCounters((*MIDDLE[:3], 0, 0, 0)),
        SetCounters((0,) * 6),
    ]


def test_lost_report_causes_zeros_and_many_a_fault(device_on: Make) -> None:
    board = ScriptedHidBoard(MIDDLE)
    device = device_on(board)
    device.open(monotonic())
    press_until(device, (3.0, 0.0, 0.0), lambda: board.commands[-1] != (0, 0, 0))
    before = len(board.commands)
    board.mute = 2  # a report and the zeros after it
    press_until(device, (3.0, 0.0, 0.0), lambda: board.mute == 0 and board.commands[-1] != (0, 0, 0))
    assert (0, 0, 0) in board.commands[before:]
    board.mute = 10**9
    with pytest.raises(DeviceFault, match="does not answer"):
        press_until(device, (3.0, 0.0, 0.0), lambda: not device.latest(monotonic()))
    assert board.commands[-1] == (0, 0, 0)


def test_unplugged_and_back_without_them(device_on: Make) -> None:
    board = ScriptedHidBoard(MIDDLE)
    device = device_on(board, reconnect_s=0.2)
    device.open(monotonic())
    board.plugged = False
    wait_for(lambda: board.closed > 0)
    board.counts = (0,) * 6
    board.plugged = True
    with pytest.raises(DeviceFault, match="lost its home"):
        wait_for(lambda: not device.latest(monotonic()))


def test_counters_are_followed_beyond_16_bits(device_on: Make) -> None:
    """A device that turns on and on, its home pose far away: 32767 is followed by -32768."""
    mechanism = PARAMETERS["polhem_v2"].on("hid14").mechanism
    near = mechanism.counts_at(ZERO)
    shift = 32_760 - near[2]
    board = ScriptedHidBoard((near[0], near[1], near[2] + shift, 0, 0, 0))
    home = mechanism.drive.home_counts
    device = device_on(board, parameters="polhem_v2", home_counts=(home[0], home[1], home[2] - shift))
    device.open(monotonic())
    board.counts = (near[0], near[1], near[2] + shift + 30, 0, 0, 0)
    expected = mechanism.position((near[0], near[1], near[2] + 30))
    wait_for(lambda: device.latest(monotonic()).position == pytest.approx(expected, abs=1e-5))
