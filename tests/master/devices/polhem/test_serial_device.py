"""`polhem_serial` over a real pty, against a board of few lines."""

from collections.abc import Callable, Iterator
from pathlib import Path
from threading import Thread
from time import monotonic, sleep
from typing import Any

import pytest

from tests.hardware.scripted import wait_for
from tests.master.devices.polhem.boards import Counts6, Teensy
from weberlink.geometry.vector import ZERO, Vector, norm
from weberlink.hardware.emulator import PtyDevice
from weberlink.hardware.fault import BadReply
from weberlink.master.devices.contract import DeviceFault, DeviceReading
from weberlink.master.devices.polhem.lock_step import QUIET_S
from weberlink.master.devices.polhem.options import PolhemSerialOptions
from weberlink.master.devices.polhem.parameters import PARAMETERS
from weberlink.master.devices.polhem.serial_device import BracketExchange, PolhemSerialDevice
from weberlink.master.emulators.polhem.serial_board import PolhemSerialEmulator, PolhemSerialEmulatorOptions

TICK = 0.001
PATIENCE = 10.0
WOODY = PARAMETERS["woodenhaptics_2015"].mechanism
MIDDLE: Counts6 = (*WOODY.counts_at(ZERO), 0, 0, 0)


@pytest.fixture
def board(tmp_path: Path) -> Iterator[PtyDevice]:
    with PtyDevice(Teensy(counts=MIDDLE), tmp_path / "tty") as pty:
        yield pty


def teensy(board: PtyDevice) -> Teensy:
    assert isinstance(board.emulator, Teensy)
    return board.emulator


@pytest.fixture
def device_of(board: PtyDevice) -> Iterator[Callable[..., PolhemSerialDevice]]:
    """Makes a device on the board, with its signs checked unless told otherwise."""
    made: list[PolhemSerialDevice] = []

    def make(**settings: Any) -> PolhemSerialDevice:
        options = PolhemSerialOptions(**{"port": str(board.path), "model": "woodenhaptics", **settings})
        if "signs_checked" not in settings:
            options = options.model_copy(update={"signs_checked": PolhemSerialDevice.fingerprint(options)})
        made.append(PolhemSerialDevice(options, TICK))
        return made[-1]

    yield make
    for device in made:
        device.close()


Make = Callable[..., PolhemSerialDevice]


def press(device: PolhemSerialDevice, force: Vector) -> None:
    device.command(force, monotonic())


def press_until(device: PolhemSerialDevice, force: Vector, condition: Callable[[], bool]) -> None:
    def pressed() -> bool:
        press(device, force)
        return condition()

    wait_for(pressed)


@pytest.mark.parametrize(
    ("settings", "model", "complaint"),
    [
        ({"model": "polhem"}, 3, r"model 3 \(woodenhaptics\), the file says polhem; set master.device.model: woodenh"),
        ({}, 1, r"model 1 \(polhem\), the file says woodenhaptics"),
        ({"model": "auto"}, 9, "model 9, which is none of 1 polhem, 2 vintage_phantom, 3 woodenhaptics"),
    ],
)
def test_the_wrong_model_is_refused_in_one_line(
    device_of: Make, board: PtyDevice, settings: dict[str, Any], model: int, complaint: str
) -> None:
    teensy(board).model = model
    device = device_of(**settings)
    with pytest.raises(DeviceFault, match=complaint) as fault:
        device.open(monotonic())
    assert "\n" not in str(fault.value)
    assert str(board.path) in str(fault.value)


def test_auto_takes_the_word_of_the_device(device_of: Make, board: PtyDevice) -> None:
    phantom = PARAMETERS["vintage_phantom"].mechanism
    teensy(board).model, teensy(board).counts = 2, (*phantom.counts_at((0.01, 0.02, 0.03)), 0, 0, 0)
    device = device_of(model="auto")
    device.open(monotonic())
    assert device.latest(monotonic()).position == pytest.approx((0.01, 0.02, 0.03), abs=1e-4)
    assert device.latest(monotonic()).orientation is None


def test_an_orientation_comes_where_there_are_sensors(device_of: Make, board: PtyDevice) -> None:
    teensy(board).model = 1
    device = device_of(model="polhem")
    teensy(board).counts = (*PARAMETERS["polhem_v3"].mechanism.counts_at(ZERO), 0, 0, 0)
    device.open(monotonic())
    orientation = device.latest(monotonic()).orientation
    assert orientation is not None
    assert sum(part * part for part in orientation) == pytest.approx(1.0)
    teensy(board).error = 2
    wait_for(lambda: device.latest(monotonic()).orientation is None)
    wait_for(lambda: device.trouble == "gimbal sensor 2 does not answer")


def test_homed_where_it_is_held(device_of: Make, board: PtyDevice) -> None:
    teensy(board).counts = (16_000, -3, 77, 0, 0, 0)
    device = device_of(homing="at_open")
    device.open(monotonic())
    assert device.latest(monotonic()).position == pytest.approx((0.025, 0.0, 0.205))


def test_homed_by_the_button(device_of: Make, board: PtyDevice) -> None:
    def press_later() -> None:
        wait_for(lambda: len(teensy(board).currents) > 10)
        teensy(board).counts = (0, 0, 0, 0, 0, 0)

    person = Thread(target=press_later)
    person.start()
    device = device_of(homing="button")
    device.open(monotonic())
    person.join()
    assert device.latest(monotonic()).position == pytest.approx((0.025, 0.0, 0.205))
    assert set(teensy(board).currents) == {(0, 0, 0)}


def test_garbled_answers_rest_the_motors_and_are_survived(device_of: Make, board: PtyDevice) -> None:
    device = device_of()
    device.open(monotonic())
    force = (0.0, 2.0, 0.0)
    press_until(device, force, lambda: teensy(board).currents[-1] != (0, 0, 0))
    before = len(teensy(board).currents)
    board.emulator.faults.garble = 5
    press_until(device, force, lambda: board.emulator.faults.garble == 0 and len(teensy(board).currents) > before + 20)
    assert (0, 0, 0) in teensy(board).currents[before:]
    press_until(device, force, lambda: teensy(board).currents[-1] != (0, 0, 0))
    device.latest(monotonic())


@pytest.mark.parametrize("error", [8, 1024, 1 | 8])
def test_lasting_error_is_a_fault_without_current(device_of: Make, board: PtyDevice, error: int) -> None:
    device = device_of()
    device.open(monotonic())
    teensy(board).error = error
    with pytest.raises(DeviceFault, match="reports "):
        press_until(device, (1.0, 1.0, 1.0), lambda: not device.latest(monotonic()))
    assert teensy(board).currents[-1] == (0, 0, 0)


@pytest.fixture
def polhem(tmp_path: Path) -> Iterator[tuple[PolhemSerialEmulator, Path]]:
    """An emulated Polhem with its firmware's habits: one sensor of the gimbal is read per message."""
    still = {"script": [{"motion": "rest", "duration_s": 100.0}], "tremor_m": 0.0}
    emulator = PolhemSerialEmulator(PolhemSerialEmulatorOptions.model_validate({"model": "polhem", "handle": still}))
    with PtyDevice(emulator, tmp_path / "polhem") as pty:
        yield emulator, pty.path


def test_broken_gimbal_loses_orientation_not_force(polhem: tuple[PolhemSerialEmulator, Path]) -> None:
    emulator, path = polhem
    exchange = BracketExchange(PolhemSerialOptions(port=str(path), model="polhem"), 5.0)
    force = (0.0, 0.0, 1.0)

    def readings(count: int) -> list[DeviceReading]:
        """As many as that; what a busy machine answers too late does not count."""
        found: list[DeviceReading] = []
        gives_up = monotonic() + PATIENCE
        while len(found) < count:
            assert monotonic() < gives_up
            try:
                found.append(exchange.exchange(force))
            except BadReply as reply:
                assert "gimbal" not in str(reply)
        return found

    exchange.open()
    assert any(each.orientation for each in readings(50))
    emulator.inject("gimbal_error", 2.0)
    wait_for(lambda: readings(1)[0].orientation is None)
    assert not any(each.orientation for each in readings(60))
    assert exchange.orientation_trouble == "gimbal sensor 2 does not answer"
    wait_for(lambda: bool(readings(1)) and norm(emulator.force) > 0.95)
    emulator.inject("gimbal_error", 0.0)
    wait_for(lambda: readings(1)[0].orientation is not None)
    exchange.close()


class Jammed(PolhemSerialEmulator):
    """What the host sends is held up until `release_at` messages are there, and then comes at once."""

    release_at = 0

    def receive(self, data: bytes, now: float) -> None:
        if self.release_at and (self._waiting + data).count(b"]") < self.release_at:
            self._waiting += data
            return
        self.release_at = 0
        super().receive(data, now)


def test_two_messages_at_once_cost_one_exchange(device_of: Make, tmp_path: Path) -> None:
    """A message that was held up comes together with the zeros that follow it: the board answers 8, then 256."""
    still = {"script": [{"motion": "rest", "duration_s": 100.0}], "tremor_m": 0.0}
    emulator = Jammed(PolhemSerialEmulatorOptions.model_validate({"model": "polhem", "handle": still}))
    with PtyDevice(emulator, tmp_path / "jammed") as pty:
        device = device_of(port=str(pty.path), model="polhem")
        device.open(monotonic())
        force = (0.0, 0.0, 1.0)
        press_until(device, force, lambda: norm(emulator.force) > 0.95)
        errors = emulator.errors
        emulator.release_at = 2
        press_until(device, force, lambda: emulator.errors >= errors + 2)
        began = monotonic()
        press_until(device, force, lambda: norm(emulator.force) > 0.95)
        assert monotonic() - began < QUIET_S, "two answers were owed and came: there is no silence to wait for"
        assert emulator.errors == errors + 2
        device.latest(monotonic())
        device.close()


def test_weight_is_carried_only_while_loop_commands(device_of: Make, tmp_path: Path) -> None:
    handle = {"script": [{"motion": "rest", "duration_s": 100.0}], "tremor_m": 0.0}
    options = PolhemSerialEmulatorOptions.model_validate({"model": "polhem", "handle": handle, "weight": True})
    emulator = PolhemSerialEmulator(options)
    with PtyDevice(emulator, tmp_path / "heavy") as pty:
        device = device_of(port=str(pty.path), model="polhem", gravity_compensation=True)
        device.open(monotonic())
        assert emulator.currents_ma == (0.0, 0.0, 0.0)
        press_until(device, ZERO, lambda: norm(emulator.force) < 0.03)
        wait_for(lambda: emulator.currents_ma == (0.0, 0.0, 0.0))
        press_until(device, ZERO, lambda: emulator.currents_ma != (0.0, 0.0, 0.0))
        device.close()
        wait_for(lambda: emulator.currents_ma == (0.0, 0.0, 0.0))
        unchecked = device_of(port=str(pty.path), model="polhem", gravity_compensation=True, signs_checked="a0000000")
        unchecked.open(monotonic())
        messages = emulator.messages
        press_until(unchecked, ZERO, lambda: emulator.messages > messages + 80)
        assert emulator.currents_ma == (0.0, 0.0, 0.0)


def test_replugged_with_power_ramps_force_from_zero(device_of: Make, board: PtyDevice) -> None:
    device = device_of(reconnect_s=PATIENCE)
    device.open(monotonic())
    force = (0.0, 0.0, 4.0)
    full = tuple(map(int, WOODY.currents_ma(force, MIDDLE)))
    press_until(device, force, lambda: teensy(board).currents[-1] == full)
    board.unplug()
    count = len(teensy(board).currents)
    sleep(0.02)
    board.plug()
    press_until(device, force, lambda: full in teensy(board).currents[count:])
    after = [sum(map(abs, currents)) for currents in teensy(board).currents[count:]]
    assert after[0] == 0
    rising = [current for current in after if 0 < current < sum(map(abs, full))]
    assert rising
    assert rising[0] < 0.5 * sum(map(abs, full))
    device.latest(monotonic())


def test_replugged_without_power_has_lost_home(device_of: Make, board: PtyDevice) -> None:
    device = device_of(reconnect_s=0.3)
    device.open(monotonic())
    board.unplug()
    teensy(board).counts = (0, 0, 0, 0, 0, 0)
    board.plug()
    with pytest.raises(DeviceFault, match=r"lost its home.*home it again"):
        press_until(device, (1.0, 1.0, 1.0), lambda: not device.latest(monotonic()))
    assert set(teensy(board).currents[-5:]) == {(0, 0, 0)}
    device.close()
    teensy(board).counts = MIDDLE
    device.open(monotonic())
    assert norm(device.latest(monotonic()).position) < 1e-4


def test_restart_that_swallows_answers_loses_home(device_of: Make, board: PtyDevice) -> None:
    """However fast a hand may be: in the time of the silence it could have gone there."""
    device = device_of()
    device.open(monotonic())
    board.emulator.faults.silent = True
    sent = len(teensy(board).currents)
    wait_for(lambda: len(teensy(board).currents) >= sent + 2)
    teensy(board).counts = (150, -20, 90, 0, 0, 0)
    board.emulator.faults.silent = False
    with pytest.raises(DeviceFault, match=r"lost its home: its position jumped|does not answer"):
        press_until(device, (1.0, 1.0, 1.0), lambda: not device.latest(monotonic()))
    assert teensy(board).currents[-1] == (0, 0, 0)


def test_another_model_in_its_place_is_no_return(device_of: Make, board: PtyDevice) -> None:
    device = device_of(reconnect_s=0.2)
    device.open(monotonic())
    board.unplug()
    teensy(board).model = 1
    board.plug()
    with pytest.raises(DeviceFault, match=r"came back as another one: model 1 \(polhem\), not model 3"):
        wait_for(lambda: not device.latest(monotonic()))
