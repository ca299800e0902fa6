"""`polhem_serial` over a real pty and `polhem_hid` in place of its port, against boards of few lines.

What every driver keeps is in `test_contract`.
"""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from pathlib import Path
from time import monotonic
from typing import Any

import pytest

from weberlink.geometry.vector import ZERO, norm
from weberlink.hardware.emulator import Emulator
from weberlink.master.devices.polhem.parameters import PARAMETERS, PolhemHidOptions, PolhemSerialOptions
from weberlink.master.devices.polhem.protocol import (
    LONG,
    SHORT,
    Sensors,
    SetCounters,
    decode_command,
    encode_sensors,
    encode_status,
)
from weberlink.master.devices.polhem.serial_device import BracketExchange
from weberlink.testing.devices import armed, drive, fault_of, refusal
from weberlink.testing.serving import PtyDevice
from weberlink.testing.stepping import VirtualPort, VirtualTime
from weberlink.testing.wires import HidWire

MIDDLE = (*PARAMETERS["woodenhaptics_2015"].counts_at(ZERO), 0, 0, 0)
HID_WOODY = PolhemHidOptions(parameters="woodenhaptics_2015").wired()
HID_MIDDLE = (*HID_WOODY.counts_at(ZERO), 0, 0, 0)
AWAY = (900, -70, 5, 1, 2, 3)
HOME = pytest.approx((0.025, 0.0, 0.205))
PUSH = (1.0, -2.0, 0.5)
Make = Callable[..., Any]


class Teensy(Emulator):
    """Answers every message as the firmware does, with its `counts`; its button is pressed after a number of them."""

    def __init__(self, counts: tuple[int, ...], pressed_after: int = 0) -> None:
        super().__init__()
        self.model, self.counts, self.error, self.pressed_after = 3, counts, 0, pressed_after
        self.currents: list[tuple[int, ...]] = []  # as commanded, one per message
        self._rest = b""

    def receive(self, data: bytes, now: float) -> None:
        *messages, self._rest = (self._rest + data.replace(b"\0", b"")).split(b"\n")
        for message in messages:
            self.currents.append(tuple(map(int, message.strip(b"[]").split(b","))))
            self.counts = (0,) * 6 if len(self.currents) == self.pressed_after else self.counts
            self.leaving.append(encode_status(Sensors(self.counts, model=self.model, error=self.error)))


class Mbed(Emulator):
    """In lock-step, and with a report that may wait from the start; its button likewise."""

    def __init__(
        self, counts: tuple[int, ...], size: int = LONG, stale: tuple[int, ...] | None = None, pressed_after: int = 0
    ) -> None:
        super().__init__()
        self.counts, self.size, self.pressed_after = counts, size, pressed_after
        self.button = self.calibrate = False
        self.sets_counters = True
        self.commands: list[tuple[int, int, int] | SetCounters] = []
        self.leaving = [] if stale is None else [encode_sensors(Sensors(stale))]

    def receive(self, data: bytes, now: float) -> None:
        command = decode_command(data)
        self.commands.append(command)
        if isinstance(command, SetCounters) and self.sets_counters:
            self.counts, self.calibrate = command.counts, False
        sensors = Sensors(self.counts, self.button, self.calibrate)
        self.leaving.append(encode_sensors(sensors).ljust(self.size, b"\0"))
        self.calibrate = self.calibrate or len(self.commands) == self.pressed_after


@pytest.fixture
def until_end() -> Iterator[Make]:
    """Takes a device, and closes it at the end of the test."""
    with ExitStack() as stack:
        yield lambda device: stack.enter_context(closing(device))


@pytest.fixture
def board(tmp_path: Path) -> Iterator[PtyDevice]:
    with PtyDevice(Teensy(MIDDLE), tmp_path / "tty") as pty:
        yield pty


@pytest.fixture
def teensy(board: PtyDevice) -> Any:
    return board.emulator


@pytest.fixture
def serial(board: PtyDevice, until_end: Make) -> Make:
    """Makes a device on the board."""
    usual = {"port": str(board.path), "model": "woodenhaptics"}
    return lambda **settings: until_end(armed("polhem_serial", **{**usual, **settings}))


@pytest.mark.parametrize(
    ("settings", "model", "says"),
    [
        ({"model": "polhem"}, 3, "model 3 (woodenhaptics), the file says polhem; set master.device.model: woodenh"),
        ({}, 1, "model 1 (polhem), the file says woodenhaptics"),
        ({"model": "auto"}, 9, "model 9, which is none of 1 polhem, 2 vintage_phantom, 3 woodenhaptics"),
    ],
)
def test_the_wrong_model_is_refused(serial: Make, teensy: Any, settings: Any, model: int, says: str) -> None:
    teensy.model = model
    assert says in refusal(serial(**settings))


def test_homed_where_it_is_held(serial: Make, teensy: Any) -> None:
    teensy.counts = (16_000, -3, 77, 0, 0, 0)
    held = serial(homing="at_open")
    held.open(monotonic())
    assert held.latest(monotonic()).position == HOME
    held.close()
    assert set(teensy.currents) == {(0, 0, 0)}


def test_homed_by_the_button() -> None:
    time, teensy = VirtualTime(), Teensy((16_000, -3, 77, 0, 0, 0), pressed_after=10)
    options = PolhemSerialOptions(port="/dev/virtual", model="woodenhaptics", homing="button")
    exchange = BracketExchange(options, 0.0, list, lambda path: VirtualPort(teensy, time))
    exchange._clock, exchange._pause = time.clock, time.pause
    assert exchange.open().position == HOME
    assert set(teensy.currents) == {(0, 0, 0)} and len(teensy.currents) > 10


@pytest.mark.parametrize("error", [8, 1024, 1 | 8])
def test_lasting_error_is_a_fault_without_current(serial: Make, teensy: Any, error: int) -> None:
    device = serial()
    device.open(monotonic())
    teensy.error = error
    assert "reports " in fault_of(device)
    assert teensy.currents[-1] == (0, 0, 0)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"counts": (0, 0, 0, 0, 0, 0)}, "lost its home"),
        ({"model": 1}, "came back as another one: model 1 (polhem), not model 3"),
    ],
)
def test_what_comes_back_without_power_or_as_another_is_no_return(
    serial: Make, board: PtyDevice, teensy: Any, changes: dict[str, Any], says: str
) -> None:
    device = serial(reconnect_s=2.0)
    device.open(monotonic())
    board.unplug()
    for name, value in changes.items():
        setattr(teensy, name, value)
    board.plug()
    assert says in fault_of(device)
    assert set(teensy.currents[-5:]) == {(0, 0, 0)}
    device.close()
    teensy.counts, teensy.model = MIDDLE, 3
    device.open(monotonic())
    assert norm(device.latest(monotonic()).position) < 1e-4


def test_broken_gimbal_loses_orientation_not_force(serial: Make, teensy: Any) -> None:
    teensy.model, teensy.counts = 1, (*PARAMETERS["polhem_v3"].counts_at(ZERO), 0, 0, 0)
    device = serial(model="polhem")
    device.open(monotonic())
    assert device.latest(monotonic()).orientation is not None
    teensy.error = 2
    drive(device, lambda: device.latest(monotonic()).orientation is None, PUSH)
    assert device.trouble == "gimbal sensor 2 does not answer"
    drive(device, lambda: max(map(abs, teensy.currents[-1])) > 300, PUSH)
    teensy.error = 0
    sent = len(teensy.currents)
    drive(device, lambda: device.latest(monotonic()).orientation is not None, PUSH)
    assert len(teensy.currents) >= sent + 3, "the firmware reads one of three sensors per message"


# --- with reports


@pytest.fixture
def hid(until_end: Make) -> Make:
    """Makes a device on a board."""
    return lambda board, **settings: until_end(armed("polhem_hid", HidWire(board), port="/dev/hidraw9", **settings))


def test_force_and_button_and_no_report_that_has_waited(hid: Make) -> None:
    board = Mbed(HID_MIDDLE, stale=(16_000, 0, 0, 0, 0, 0))
    device = hid(board)
    device.open(monotonic())
    assert device.latest(monotonic()).position == pytest.approx(ZERO, abs=1e-4)
    expected = tuple(map(int, HID_WOODY.currents_ma(PUSH, HID_MIDDLE)))
    drive(device, lambda: board.commands[-1] == expected, PUSH)
    board.button = True
    drive(device, lambda: device.latest(monotonic()).buttons == 1)
    device.close()
    assert board.commands[-1] == (0, 0, 0)


@pytest.mark.parametrize(("said", "sent"), [(LONG, SHORT), (SHORT, LONG)])
def test_reports_of_the_other_length_are_refused(hid: Make, said: int, sent: int) -> None:
    """Their firmware counts the other way round."""
    board = Mbed((0,) * (6 if sent == LONG else 3), sent)
    assert f"sends reports of {sent} bytes, the file says {said}" in refusal(hid(board, report_bytes=said))
    assert not any(any(command) for command in board.commands if isinstance(command, tuple))


def test_homing_at_open_sets_the_counters_which_may_hold_the_home_counts(hid: Make) -> None:
    plain, own, deaf = (Mbed(AWAY) for _ in range(3))
    device = hid(plain, homing="at_open")
    device.open(monotonic())
    assert SetCounters((0,) * 6) in plain.commands
    assert device.latest(monotonic()).position == HOME
    holding = {"counters_hold_home": True, "parameters": "polhem_v3", "home_counts": (8, 9, 10)}
    hid(own, homing="at_open", **holding).open(monotonic())
    assert SetCounters((8, 9, 10, 0, 30, 0)) in own.commands
    deaf.sets_counters = False
    assert "does not set its counters" in refusal(hid(deaf, homing="at_open"))


def test_a_press_of_some_time_ago_does_not_count_and_the_next_one_homes(hid: Make) -> None:
    board = Mbed(AWAY, pressed_after=10)
    board.calibrate = True
    device = hid(board, homing="button")
    device.open(monotonic())
    told = [command.counts for command in board.commands if isinstance(command, SetCounters)]
    assert (told[0], told[-1]) == (AWAY, (0,) * 6)
    assert device.latest(monotonic()).position == HOME


def test_the_older_kind_is_homed_on_the_host_and_has_no_button(hid: Make) -> None:
    board = Mbed(AWAY[:3], SHORT, stale=(0, 0, 0))
    device = hid(board, homing="at_open", report_bytes=8)
    device.open(monotonic())
    assert device.latest(monotonic()).position == HOME
    assert set(board.commands) == {(0, 0, 0)}
    assert "without a calibration button; set homing: at_open" in refusal(hid(board, homing="button", report_bytes=8))


def test_counters_are_followed_beyond_16_bits(hid: Make) -> None:
    """A device that turns on and on, its home pose far away: 32767 is followed by -32768."""
    mechanism = PolhemHidOptions(parameters="polhem_v2").wired()
    near, home = mechanism.counts_at(ZERO), mechanism.wiring.home_counts
    shift = 32_760 - near[2]
    board = Mbed((near[0], near[1], near[2] + shift, 0, 0, 0))
    device = hid(board, parameters="polhem_v2", home_counts=(home[0], home[1], home[2] - shift))
    device.open(monotonic())
    board.counts = (near[0], near[1], near[2] + shift + 30, 0, 0, 0)
    expected = pytest.approx(mechanism.position((near[0], near[1], near[2] + 30)), abs=1e-5)
    drive(device, lambda: device.latest(monotonic()).position == expected)
