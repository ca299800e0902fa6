"""`polhem_serial` over a real pty and `polhem_hid` in place of its port, against boards of few lines.

What every driver keeps is in `test_contract`.
"""

from collections.abc import Callable, Iterator
from pathlib import Path
from threading import Thread
from time import monotonic
from typing import Any

import pytest

from tests.master.devices.driving import drive, fault_of, refusal
from tests.master.devices.polhem.boards import Counts6, ScriptedHidBoard, Teensy
from tests.wait import until
from weberlink.geometry.vector import ZERO, norm
from weberlink.hardware.emulator import PtyDevice
from weberlink.hardware.fault import BadReply
from weberlink.master.devices.contract import DeviceReading
from weberlink.master.devices.polhem.driver import PolhemDevice
from weberlink.master.devices.polhem.hid_device import PolhemHidDevice, ReportExchange
from weberlink.master.devices.polhem.hid_protocol import LONG, SHORT, WATCHDOG_S, SetCounters
from weberlink.master.devices.polhem.options import PolhemHidOptions, PolhemSerialOptions
from weberlink.master.devices.polhem.parameters import PARAMETERS
from weberlink.master.devices.polhem.serial_device import BracketExchange, PolhemSerialDevice
from weberlink.master.emulators.polhem.serial_board import PolhemSerialEmulator, PolhemSerialEmulatorOptions
from weberlink.testing.time import TICK

WOODY = PARAMETERS["woodenhaptics_2015"].mechanism
MIDDLE: Counts6 = (*WOODY.counts_at(ZERO), 0, 0, 0)
HID_WOODY = PARAMETERS["woodenhaptics_2015"].on("hid14").mechanism
HID_MIDDLE = (*HID_WOODY.counts_at(ZERO), 0, 0, 0)
AWAY = (900, -70, 5, 1, 2, 3)
HOME = pytest.approx((0.025, 0.0, 0.205))
STILL = {"handle": {"script": [{"motion": "rest", "duration_s": 100.0}], "tremor_m": 0.0}}
PUSH = (1.0, -2.0, 0.5)
Make = Callable[..., PolhemDevice]


@pytest.fixture
def closing() -> Iterator[list[PolhemDevice]]:
    made: list[PolhemDevice] = []
    yield made
    for device in made:
        device.close()


# --- with brackets


@pytest.fixture
def teensy() -> Teensy:
    return Teensy(counts=MIDDLE)


@pytest.fixture
def board(teensy: Teensy, tmp_path: Path) -> Iterator[PtyDevice]:
    with PtyDevice(teensy, tmp_path / "tty") as pty:
        yield pty


@pytest.fixture
def serial(board: PtyDevice, closing: list[PolhemDevice]) -> Make:
    """Makes a device on the board, with its signs checked unless told otherwise."""

    def make(**settings: Any) -> PolhemDevice:
        options = PolhemSerialOptions(**{"port": str(board.path), "model": "woodenhaptics", **settings})
        if "signs_checked" not in settings:
            options = options.model_copy(update={"signs_checked": PolhemSerialDevice.fingerprint(options)})
        closing.append(PolhemSerialDevice(options, TICK))
        return closing[-1]

    return make


@pytest.mark.parametrize(
    ("settings", "model", "says"),
    [
        ({"model": "polhem"}, 3, "model 3 (woodenhaptics), the file says polhem; set master.device.model: woodenh"),
        ({}, 1, "model 1 (polhem), the file says woodenhaptics"),
        ({"model": "auto"}, 9, "model 9, which is none of 1 polhem, 2 vintage_phantom, 3 woodenhaptics"),
    ],
)
def test_the_wrong_model_is_refused(
    serial: Make, board: PtyDevice, teensy: Teensy, settings: dict[str, Any], model: int, says: str
) -> None:
    teensy.model = model
    said = refusal(serial(**settings))
    assert says in said
    assert str(board.path) in said


def test_auto_takes_the_word_of_the_device(serial: Make, teensy: Teensy) -> None:
    phantom = PARAMETERS["vintage_phantom"].mechanism
    teensy.model, teensy.counts = 2, (*phantom.counts_at((0.01, 0.02, 0.03)), 0, 0, 0)
    device = serial(model="auto")
    device.open(monotonic())
    reading = device.latest(monotonic())
    assert (reading.position, reading.orientation) == (pytest.approx((0.01, 0.02, 0.03), abs=1e-4), None)


def test_homed_where_it_is_held_or_by_the_button(serial: Make, teensy: Teensy) -> None:
    teensy.counts = (16_000, -3, 77, 0, 0, 0)
    held = serial(homing="at_open")
    held.open(monotonic())
    assert held.latest(monotonic()).position == HOME
    held.close()
    before = len(teensy.currents)

    def press_later() -> None:
        until(lambda: len(teensy.currents) > before + 10, "messages")
        teensy.counts = (0, 0, 0, 0, 0, 0)

    person = Thread(target=press_later)
    person.start()
    device = serial(homing="button")
    device.open(monotonic())
    person.join()
    assert device.latest(monotonic()).position == HOME
    assert set(teensy.currents) == {(0, 0, 0)}


@pytest.mark.parametrize("error", [8, 1024, 1 | 8])
def test_lasting_error_is_a_fault_without_current(serial: Make, teensy: Teensy, error: int) -> None:
    device = serial()
    device.open(monotonic())
    teensy.error = error
    assert "reports " in fault_of(device)
    assert teensy.currents[-1] == (0, 0, 0)


def unplug(board: PtyDevice, **changes: Any) -> None:
    """And plug it in again, changed."""
    board.unplug()
    for name, value in changes.items():
        setattr(board.emulator, name, value)
    board.plug()


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"counts": (0, 0, 0, 0, 0, 0)}, "lost its home"),
        ({"model": 1}, "came back as another one: model 1 (polhem), not model 3"),
    ],
)
def test_what_comes_back_without_power_or_as_another_is_no_return(
    serial: Make, board: PtyDevice, teensy: Teensy, changes: dict[str, Any], says: str
) -> None:
    device = serial(reconnect_s=0.3)
    device.open(monotonic())
    unplug(board, **changes)
    assert says in fault_of(device)
    assert set(teensy.currents[-5:]) == {(0, 0, 0)}
    device.close()
    teensy.counts, teensy.model = MIDDLE, 3
    device.open(monotonic())
    assert norm(device.latest(monotonic()).position) < 1e-4


def test_restart_that_swallows_answers_loses_home(serial: Make, teensy: Teensy) -> None:
    """However fast a hand may be: in the time of the silence it could have gone there."""
    device = serial()
    device.open(monotonic())
    teensy.faults.silent = True
    sent = len(teensy.currents)
    until(lambda: len(teensy.currents) >= sent + 2, "two messages")
    teensy.counts = (150, -20, 90, 0, 0, 0)
    teensy.faults.silent = False
    said = fault_of(device)
    assert "lost its home: its position jumped" in said or "does not answer" in said
    assert teensy.currents[-1] == (0, 0, 0)


class Jammed(PolhemSerialEmulator):
    """What the host sends is held up until `release_at` messages are there, and then comes at once."""

    release_at = 0

    def receive(self, data: bytes, now: float) -> None:
        if self.release_at and (self._waiting + data).count(b"]") < self.release_at:
            self._waiting += data
            return
        self.release_at = 0
        super().receive(data, now)


def emulated(kind: type[PolhemSerialEmulator] = PolhemSerialEmulator, **options: Any) -> Any:
    """A Polhem with its firmware's habits: one sensor of the gimbal is read per message."""
    return kind(PolhemSerialEmulatorOptions.model_validate({"model": "polhem", **STILL, **options}))


def test_broken_gimbal_loses_orientation_not_force(tmp_path: Path) -> None:
    emulator = emulated()
    with PtyDevice(emulator, tmp_path / "polhem") as pty:
        exchange = BracketExchange(PolhemSerialOptions(port=str(pty.path), model="polhem"), 5.0)

        def reading() -> DeviceReading:
            """The next; what a busy machine answers too late does not count."""
            while True:
                try:
                    return exchange.exchange((0.0, 0.0, 1.0))
                except BadReply as reply:
                    assert "gimbal" not in str(reply)

        exchange.open()
        assert any(reading().orientation for _ in range(50))
        emulator.inject("gimbal_error", 2.0)
        until(lambda: reading().orientation is None, "no orientation", pause=0.0)
        row = 0
        while row < 60:  # in a row, for a busy machine
            row = 0 if reading().orientation else row + 1
        assert exchange.orientation_trouble == "gimbal sensor 2 does not answer"
        until(lambda: reading() and norm(emulator.force) > 0.95, "the force", pause=0.0)
        emulator.inject("gimbal_error", 0.0)
        until(lambda: reading().orientation is not None, "an orientation", pause=0.0)
        exchange.close()


@pytest.mark.realtime(alone=True)  # a stall between two messages costs answers of its own
def test_two_messages_at_once_cost_one_exchange(serial: Make, tmp_path: Path) -> None:
    """A message that was held up comes together with the zeros that follow it: the board answers 8, then 256."""
    emulator = emulated(Jammed)
    with PtyDevice(emulator, tmp_path / "jammed") as pty:
        device = serial(port=str(pty.path), model="polhem")
        device.open(monotonic())
        drive(device, lambda: norm(emulator.force) > 0.95, (0.0, 0.0, 1.0))
        errors = emulator.errors
        emulator.release_at = 2
        drive(device, lambda: emulator.errors >= errors + 2, (0.0, 0.0, 1.0))
        drive(device, lambda: norm(emulator.force) > 0.95, (0.0, 0.0, 1.0))
        assert emulator.errors == errors + 2, "two answers were owed and came"
        device.close()


@pytest.mark.parametrize("checked", [True, False])
def test_weight_is_carried_only_while_loop_commands(serial: Make, tmp_path: Path, checked: bool) -> None:
    emulator = emulated(weight=True)
    with PtyDevice(emulator, tmp_path / "heavy") as pty:
        signs = {} if checked else {"signs_checked": "a0000000"}
        device = serial(port=str(pty.path), model="polhem", gravity_compensation=True, **signs)
        device.open(monotonic())
        assert emulator.currents_ma == (0.0, 0.0, 0.0)
        messages = emulator.messages
        if checked:
            drive(device, lambda: norm(emulator.force) < 0.03)
            until(lambda: emulator.currents_ma == (0.0, 0.0, 0.0), "the end of the force of a silent loop")
            drive(device, lambda: emulator.currents_ma != (0.0, 0.0, 0.0))
        else:
            drive(device, lambda: emulator.messages > messages + 80)
            assert emulator.currents_ma == (0.0, 0.0, 0.0)
        device.close()
        until(lambda: emulator.currents_ma == (0.0, 0.0, 0.0), "the end of the force")


# --- with reports


@pytest.fixture
def hid(closing: list[PolhemDevice]) -> Make:
    """Makes a device on a board; with force, whatever the signs."""

    def make(board: ScriptedHidBoard, **settings: Any) -> PolhemDevice:
        options = PolhemHidOptions(port="/dev/hidraw9", **settings)
        signs = PolhemHidDevice.fingerprint(options)
        options = options.model_copy(update={"signs_checked": signs})
        device = PolhemDevice(
            "polhem_hid",
            options,
            options.wired(),
            lambda force_n: ReportExchange(options, force_n, board),
            TICK,
            signs=signs,
            watchdog_s=WATCHDOG_S,
            buttons=1,
        )
        closing.append(device)
        return device

    return make


def short(counts: tuple[int, ...], **others: Any) -> ScriptedHidBoard:
    """Of the older kind."""
    board = ScriptedHidBoard(counts, **others)
    board.size = SHORT
    return board


def test_force_and_button_and_no_report_that_has_waited(hid: Make) -> None:
    board = ScriptedHidBoard(HID_MIDDLE, stale=(16_000, 0, 0, 0, 0, 0))
    device = hid(board)
    device.open(monotonic())
    assert device.latest(monotonic()).position == pytest.approx(ZERO, abs=1e-4)
    expected = tuple(map(int, HID_WOODY.currents_ma(PUSH, HID_MIDDLE)))
    drive(device, lambda: board.commands[-1] == expected, PUSH)
    board.button = True
    drive(device, lambda: device.latest(monotonic()).buttons == 1)
    device.close()
    assert (board.commands[-1], board.closed) == ((0, 0, 0), 1)


def test_the_older_kind_has_its_own_signs(hid: Make) -> None:
    middle = PARAMETERS["woodenhaptics_2015"].on("hid8").mechanism.counts_at(ZERO)
    board = short(middle, stale=middle)
    device = hid(board, report_bytes=8)
    device.open(monotonic())
    assert device.latest(monotonic()).position == pytest.approx(ZERO, abs=1e-4)
    drive(device, lambda: board.commands[-1] != (0, 0, 0), PUSH)


@pytest.mark.parametrize(("said", "sent"), [(14, 8), (8, 14)])
def test_reports_of_the_other_length_are_refused(hid: Make, said: int, sent: int) -> None:
    """Their firmware counts the other way round."""
    board = ScriptedHidBoard((0,) * (6 if sent == LONG else 3))
    board.size = sent
    assert f"sends reports of {sent} bytes, the file says {said}" in refusal(hid(board, report_bytes=said))
    assert not any(any(command) for command in board.commands if isinstance(command, tuple))


def test_homing_at_open_sets_the_counters_which_may_hold_the_home_counts(hid: Make) -> None:
    plain, own = ScriptedHidBoard(AWAY), ScriptedHidBoard(AWAY)
    device = hid(plain, homing="at_open")
    device.open(monotonic())
    assert SetCounters((0,) * 6) in plain.commands
    assert device.latest(monotonic()).position == HOME
    holding = {"counters_hold_home": True, "parameters": "polhem_v3", "home_counts": (8, 9, 10)}
    hid(own, homing="at_open", **holding).open(monotonic())
    assert SetCounters((8, 9, 10, 0, 30, 0)) in own.commands
    deaf = ScriptedHidBoard(AWAY)
    deaf.sets_counters = False
    assert "does not set its counters" in refusal(hid(deaf, homing="at_open"))


def test_the_older_kind_is_homed_on_the_host_and_has_no_button(hid: Make) -> None:
    board = short(AWAY[:3], stale=(0, 0, 0))
    device = hid(board, homing="at_open", report_bytes=8)
    device.open(monotonic())
    assert device.latest(monotonic()).position == HOME
    assert set(board.commands) == {(0, 0, 0)}
    assert "without a calibration button; set homing: at_open" in refusal(hid(board, homing="button", report_bytes=8))


def test_polhem_gimbal_is_reversed_over_hid(hid: Make) -> None:
    mechanism = PARAMETERS["polhem_v1"].on("hid14").mechanism
    device = hid(ScriptedHidBoard((*mechanism.counts_at(ZERO), 256, 128, 0)), parameters="polhem_v1")
    device.open(monotonic())
    assert device.latest(monotonic()).orientation == mechanism.orientation((*mechanism.counts_at(ZERO), 0, 128, 256))


def test_old_button_press_does_not_count(hid: Make) -> None:
    board = ScriptedHidBoard(HID_MIDDLE)
    board.calibrate = True

    def press_later() -> None:
        until(lambda: not board.calibrate and len(board.commands) > 10, "commands")
        board.calibrate = True

    person = Thread(target=press_later)
    person.start()
    hid(board, homing="button").open(monotonic())
    person.join()
    set_to = [each.counts for each in board.commands if isinstance(each, SetCounters)]
    assert set_to == [(*HID_MIDDLE[:3], 0, 0, 0), (0,) * 6]


def test_lost_report_causes_zeros_and_many_a_fault(hid: Make) -> None:
    board = ScriptedHidBoard(HID_MIDDLE)
    device = hid(board)
    device.open(monotonic())
    drive(device, lambda: board.commands[-1] != (0, 0, 0), PUSH)
    before = len(board.commands)
    board.mute = 2  # a report and the zeros after it
    drive(device, lambda: board.mute == 0 and board.commands[-1] != (0, 0, 0), PUSH)
    assert (0, 0, 0) in board.commands[before:]
    board.mute = 10**9
    assert "does not answer" in fault_of(device)
    assert board.commands[-1] == (0, 0, 0)


def test_unplugged_and_back_without_its_counts_has_lost_its_home(hid: Make) -> None:
    board = ScriptedHidBoard(HID_MIDDLE)
    device = hid(board, reconnect_s=0.2)
    device.open(monotonic())
    board.plugged = False
    until(lambda: board.closed > 0, "the fault to be noticed")
    board.counts, board.plugged = (0,) * 6, True
    assert "lost its home" in fault_of(device)


def test_counters_are_followed_beyond_16_bits(hid: Make) -> None:
    """A device that turns on and on, its home pose far away: 32767 is followed by -32768."""
    mechanism = PARAMETERS["polhem_v2"].on("hid14").mechanism
    near, home = mechanism.counts_at(ZERO), mechanism.drive.home_counts
    shift = 32_760 - near[2]
    board = ScriptedHidBoard((near[0], near[1], near[2] + shift, 0, 0, 0))
    device = hid(board, parameters="polhem_v2", home_counts=(home[0], home[1], home[2] - shift))
    device.open(monotonic())
    board.counts = (near[0], near[1], near[2] + shift + 30, 0, 0, 0)
    expected = pytest.approx(mechanism.position((near[0], near[1], near[2] + 30)), abs=1e-5)
    drive(device, lambda: device.latest(monotonic()).position == expected)
