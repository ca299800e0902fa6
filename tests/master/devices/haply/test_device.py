"""The driver and the emulated device, over a real serial port."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import cycle
from math import hypot
from pathlib import Path
from time import monotonic, sleep
from typing import Any

import pytest

from tests.hardware.scripted import wait_for
from weberlink.geometry.vector import ZERO, Vector, distance
from weberlink.hardware.emulator import PtyDevice
from weberlink.hardware.serial_port import SerialPort
from weberlink.master.devices.contract import DeviceFault
from weberlink.master.devices.haply.device import HaplyDevice
from weberlink.master.devices.haply.linkage import VERSIONS, degrees
from weberlink.master.devices.haply.options import HaplyOptions
from weberlink.master.emulators.haply import HaplyEmulator, HaplyEmulatorOptions

TICK = 0.001
PATIENCE_S = 10.0
COUNT_M = 2e-4
"""More than a count of the encoders is at the tip, and less than anything that is tested."""
PULL: Vector = (0.0, 0.8, 0.0)


@dataclass
class Bench:
    """A device and its emulation."""

    emulator: HaplyEmulator
    port: PtyDevice
    device: HaplyDevice
    options: HaplyOptions

    def run(self, until: Callable[[], bool], force: Vector = ZERO) -> list[Vector]:
        """Tick until something is so; the positions seen."""
        positions, patience = [], monotonic() + PATIENCE_S
        while not until():
            assert monotonic() < patience, "it did not come to be so"
            now = monotonic()
            positions.append(self.device.latest(now).position)
            self.device.command(force, now)
            sleep(TICK)
        return positions

    def run_into_fault(self, force: Vector = PULL) -> str:
        with pytest.raises(DeviceFault) as fault:
            self.run(lambda: False, force)
        return str(fault.value)

    def carry(self, to: Vector) -> None:
        self.emulator.handle.carry(to)
        self.run(lambda: self.emulator.handle.arrived and distance(self.position, to) < COUNT_M)

    @property
    def position(self) -> Vector:
        return self.device.latest(monotonic()).position


@contextmanager
def bench(
    tmp_path: Path, *, signs: bool = True, at_home: bool = False, version: str = "v3", **options: Any
) -> Iterator[Bench]:
    """The handle stands in the middle, and the options say that this is its starting place, but for `at_home`.

    Patient with the emulated device: a machine that stalls is not what is tested.
    """
    kind = VERSIONS[version]
    still: dict[str, Any] = {"tremor_m": 0.0, "script": [{"motion": "rest"}]}
    given: dict[str, Any] = {"version": version, "reply_ms": 100.0}
    if not at_home:
        still["home_m"] = ZERO
        given["home_deg"] = degrees(kind.bar.angles(kind.center))
    emulator = HaplyEmulator(HaplyEmulatorOptions.model_validate({"version": version, "handle": still}))
    emulator.handle.carry(emulator.handle.position)
    with PtyDevice(emulator, tmp_path / "tty") as port:
        wanted = HaplyOptions.model_validate({"port": str(port.path), **given, **options})
        if signs:
            wanted = wanted.model_copy(update={"signs_checked": HaplyDevice.fingerprint(wanted)})
        device = HaplyDevice(wanted, TICK)
        try:
            yield Bench(emulator, port, device, wanted)
        finally:
            device.close()


@pytest.fixture
def there(tmp_path: Path) -> Iterator[Bench]:
    with bench(tmp_path) as at:
        at.device.open(monotonic())
        yield at


@pytest.mark.parametrize("version", sorted(VERSIONS))
def test_the_position_is_that_of_the_hand(tmp_path: Path, version: str) -> None:
    with bench(tmp_path, at_home=True, version=version) as at:
        at.device.open(monotonic())
        assert at.position == pytest.approx(at.emulator.handle.position, abs=COUNT_M)
        for place in (ZERO, (0.01, 0.0, 0.0), (0.01, 0.01, 0.0)):
            at.carry(place)
            lower, upper = at.device.spec.workspace_m
            assert all(a <= p <= b for a, p, b in zip(lower, at.position, upper, strict=True))
            assert at.position[2] == 0.0


def test_limited_torque_keeps_the_force_direction(tmp_path: Path) -> None:
    with bench(tmp_path, force_n=10.0, torque_limit_n_m=0.1) as at:
        at.device.open(monotonic())
        forces: list[Vector] = []

        def is_full() -> bool:
            forces.append(at.emulator.force)
            return max(map(abs, at.emulator.torques)) > 0.0999

        at.run(is_full, (6.0, 8.0, 0.0))
        at.run(is_full, (6.0, 8.0, 0.0))
        pushes = [force for force in forces if force != ZERO]
        assert max(hypot(*force) for force in pushes) > 0.5
        assert all(y / x == pytest.approx(8.0 / 6.0, rel=0.01) for x, y, _ in pushes)
        assert at.emulator.most_torque <= 0.1 * (1.0 + 1e-6)


def test_torque_of_a_dead_host_is_removed_first(there: Bench) -> None:
    """Its program was killed in the middle of a push: the port closed without a word."""
    there.device.close()
    port = SerialPort(str(there.port.path))
    assert there.options.home_deg is not None
    board = replace(VERSIONS["v3"].board, home_deg=there.options.home_deg)
    port.write(board.torques(0.1, -0.1))
    wait_for(lambda: there.emulator.torques == pytest.approx((0.1, -0.1)))
    port.close()
    for home in ("kept", "start"):
        there.emulator.torques = (0.1, -0.1)
        device = HaplyDevice(there.options.model_copy(update={"home": home}), TICK)
        device.open(monotonic())
        assert there.emulator.torques == (0.0, 0.0)
        device.close()
    assert there.emulator.setups == 2


@pytest.mark.parametrize("fault", ["slip", "garble"])
def test_passing_bad_answers_interrupt_the_force(there: Bench, fault: str) -> None:
    there.run(lambda: there.emulator.force[1] > 0.7, PULL)
    worker = there.device._worker
    bad = worker.bad_count

    def is_bad() -> bool:
        if worker.bad_count > bad:
            return True
        if fault == "slip":
            there.emulator.inject("slip", 2)
        else:
            there.emulator.faults.garble = 2  # again: after a stall of this machine no jump is too large
        return False

    forces: list[float] = []

    def is_pushed() -> bool:
        forces.append(there.emulator.force[1])
        return forces[-1] > 0.7

    there.run(is_bad, PULL)
    wait_for(lambda: there.emulator.torques == (0.0, 0.0))
    there.run(is_pushed, PULL)
    assert any(0.05 < force < 0.6 for force in forces), "on the way up"
    assert distance(there.position, there.emulator.handle.position) < COUNT_M
    assert there.emulator.setups == 1


def test_broken_encoder_is_noticed_in_motion(there: Bench) -> None:
    there.emulator.inject("stuck_encoder", 2)
    places = cycle(((0.02, 0.03, 0.0), (0.02, -0.03, 0.0)))

    def goes_on() -> bool:
        if there.emulator.handle.arrived:
            there.emulator.handle.carry(next(places))
        return False

    with pytest.raises(DeviceFault) as fault:
        there.run(goes_on, (0.1, 0.0, 0.0))
    message = str(fault.value)
    assert "encoder 2 stands still" in message
    wait_for(lambda: there.emulator.torques == (0.0, 0.0))


def test_reconnected_device_ramps_force_from_zero(tmp_path: Path) -> None:
    with bench(tmp_path, reconnect_s=20.0) as at:
        at.device.open(monotonic())
        before = at.position
        at.run(lambda: at.emulator.force[1] > 0.7, PULL)
        worker = at.device._worker
        connected = worker.connected_at
        at.port.unplug()
        at.emulator.torques = (0.0, 0.0)
        ticks = iter(range(20))
        gone = at.run(lambda: next(ticks, None) is None, PULL)
        assert all(distance(position, before) < 2 * COUNT_M for position in gone)
        at.port.plug()
        forces: list[float] = []

        def is_back() -> bool:
            forces.append(at.emulator.force[1])
            return worker.connected_at > connected and forces[-1] > 0.7

        back = at.run(is_back, PULL)
        assert all(distance(position, before) < 2 * COUNT_M for position in back)
        assert any(0.05 < force < 0.6 for force in forces), "on the way up"
        assert at.emulator.setups == 1


def test_board_without_power_is_not_taken_back(tmp_path: Path) -> None:
    with bench(tmp_path, reconnect_s=0.1) as at:
        at.device.open(monotonic())
        at.port.unplug()
        at.emulator.inject("restart", 1)
        at.port.plug()
        assert "has forgotten where the arms are" in at.run_into_fault()
        assert at.emulator.setups == 1
        assert at.emulator.torques == (0.0, 0.0)


def test_origin_lasts_over_sessions_unless_home_is_start(tmp_path: Path) -> None:
    with bench(tmp_path) as at:
        at.device.open(monotonic())
        at.carry((0.0, 0.01, 0.0))
        at.device.close()
        at.device.open(monotonic())
        assert distance(at.position, (0.0, 0.01, 0.0)) < COUNT_M
        at.device.close()
        fresh = HaplyDevice(at.options.model_copy(update={"home": "start"}), TICK)
        fresh.open(monotonic())
        try:
            assert distance(fresh.latest(monotonic()).position, ZERO) < COUNT_M, "it takes this for the starting place"
        finally:
            fresh.close()
