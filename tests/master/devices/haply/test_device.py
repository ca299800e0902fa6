"""The driver and the emulated device, over a real serial port: what is special to a board that keeps its torques."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from time import monotonic
from typing import Any

import pytest

from tests.master.devices.driving import drive
from tests.pace import TICK
from tests.wait import until
from weberlink.geometry.vector import ZERO, Vector, distance, norm
from weberlink.hardware.emulator import PtyDevice
from weberlink.hardware.serial_port import SerialPort
from weberlink.master.devices.haply.device import HaplyDevice
from weberlink.master.devices.haply.linkage import VERSIONS, degrees
from weberlink.master.devices.haply.options import HaplyOptions
from weberlink.master.emulators.haply import HaplyEmulator, HaplyEmulatorOptions

COUNT_M = 2e-4
"""More than a count of the encoders is at the tip, and less than anything that is tested."""


@dataclass
class Bench:
    """An open device and its emulation."""

    emulator: HaplyEmulator
    port: PtyDevice
    device: HaplyDevice
    options: HaplyOptions

    def carry(self, to: Vector) -> None:
        self.emulator.handle.carry(to)
        drive(self.device, lambda: self.emulator.handle.arrived and distance(self.position, to) < COUNT_M)

    @property
    def position(self) -> Vector:
        return self.device.latest(monotonic()).position

    def again(self, **changed: Any) -> HaplyDevice:
        """Another device with other options, open."""
        self.device.close()
        self.device = HaplyDevice(self.options.model_copy(update=changed), TICK)
        self.device.open(monotonic())
        return self.device


@contextmanager
def bench(tmp_path: Path, *, at_home: bool = False, version: str = "v3", **options: Any) -> Iterator[Bench]:
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
        wanted = wanted.model_copy(update={"signs_checked": HaplyDevice.fingerprint(wanted)})
        at = Bench(emulator, port, HaplyDevice(wanted, TICK), wanted)
        try:
            at.device.open(monotonic())
            yield at
        finally:
            at.device.close()


@pytest.mark.parametrize("version", sorted(VERSIONS))
def test_the_position_is_that_of_the_hand(tmp_path: Path, version: str) -> None:
    with bench(tmp_path, at_home=True, version=version) as at:
        assert at.position == pytest.approx(at.emulator.handle.position, abs=COUNT_M)
        for place in (ZERO, (0.01, 0.0, 0.0), (0.01, 0.01, 0.0)):
            at.carry(place)
            lower, upper = at.device.spec.workspace_m
            assert all(a <= p <= b for a, p, b in zip(lower, at.position, upper, strict=True))
            assert at.position[2] == 0.0


def test_limited_torque_keeps_the_force_direction(tmp_path: Path) -> None:
    with bench(tmp_path, force_n=10.0, torque_limit_n_m=0.1) as at:
        forces: list[Vector] = []

        def is_full() -> bool:
            forces.append(at.emulator.force)
            return len(forces) > 50 and max(map(abs, at.emulator.torques)) > 0.0999

        drive(at.device, is_full, (6.0, 8.0, 0.0))
        pushes = [force for force in forces if force != ZERO]
        assert max(map(norm, pushes)) > 0.5
        assert all(y / x == pytest.approx(8.0 / 6.0, rel=0.01) for x, y, _ in pushes)
        assert at.emulator.most_torque <= 0.1 * (1.0 + 1e-6)


def test_torque_of_a_dead_host_is_removed_first(tmp_path: Path) -> None:
    """Its program was killed in the middle of a push: the port closed without a word."""
    with bench(tmp_path) as at:
        at.device.close()
        port = SerialPort(str(at.port.path))
        assert at.options.home_deg is not None
        port.write(replace(VERSIONS["v3"].board, home_deg=at.options.home_deg).torques(0.1, -0.1))
        until(lambda: at.emulator.torques == pytest.approx((0.1, -0.1)), "the torque")
        port.close()
        for home in ("kept", "start"):
            at.emulator.torques = (0.1, -0.1)
            at.again(home=home)
            assert at.emulator.torques == (0.0, 0.0)
            at.device.close()
        assert at.emulator.setups == 2
