"""Every device driver on a bench: how its time passes, what hangs on its wire, and what can go wrong with it.

A driver of hardware is on a bench with an emulated device behind a real pseudo terminal, in real time; the others are
in virtual time. A device of the kernel is seen only by the process that `test_hid_contract` starts.
"""

import os
import signal
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from functools import partial
from math import sin
from pathlib import Path
from time import monotonic
from typing import Any, Self

import pytest

from tests.master.devices.force_dimension.fake import Devices as FakeDhd
from tests.master.devices.hid_bench import ADDRESS, outer_bench
from tests.master.devices.hid_bench import FAULTS as HID_FAULTS
from tests.master.devices.targets import Targets
from tests.master.devices.touch import fake_hd
from weberlink.geometry.vector import Vector, norm
from weberlink.hardware.emulator import PtyDevice, ServedDevice, WireFaults
from weberlink.hardware.websocket_device import WebSocketDevice
from weberlink.master.devices import load
from weberlink.master.devices.contract import Device
from weberlink.master.devices.pointer import PointerDevice, PointerOptions
from weberlink.master.devices.ros2.device import Ros2Device
from weberlink.master.devices.ros2.options import Ros2Options
from weberlink.master.emulators import load as load_emulator
from weberlink.testing.time import TICK, real_time, virtual_time

SERIAL_FAULTS = ("unplug", "silent", "late", "garbled", "restart")


@dataclass
class Bench:
    """A device, and the world that it is in.

    Args:
        device: not open.
        tick: the time of the next tick [s]; waits for it where time is real.
        displayed: the size of the force that its motors put on the hand now [N]; None where there are no motors.
        faults: by name, each as a deed; empty for a device that only exists in the computer.
        felt: that force itself [N], where a bench knows it.
    """

    device: Device
    tick: Callable[[], float]
    displayed: Callable[[], float] | None = None
    faults: Mapping[str, Callable[..., None]] = field(default_factory=dict)
    felt: Callable[[], Vector] | None = None

    @classmethod
    def that_feels(cls, device: Device, felt: Callable[[], Vector], faults: Mapping[str, Callable[[], None]]) -> Self:
        return cls(device, real_time(), lambda: norm(felt()), faults, felt)

    def hold(self, force: Vector, ticks: int) -> Iterator[float]:
        """Command a force, tick by tick; gives each time after the command."""
        for _ in range(ticks):
            now = self.tick()
            self.device.command(force, now)
            yield now


@contextmanager
def operator(folder: Path) -> Iterator[Bench]:
    driver = load("operator")
    yield Bench(driver(driver.Options(), TICK), virtual_time())


@contextmanager
def pointer(folder: Path) -> Iterator[Bench]:
    swing = Targets(lambda time: ((0.05 * sin(3.0 * time), 0.0, 0.02), True))
    yield Bench(PointerDevice(PointerOptions(), TICK, swing), virtual_time())


class Poses(Targets):
    """Poses of a topic as its listener hands them on."""

    trouble: str | None = None
    failure: str | None = None


@contextmanager
def ros2(folder: Path) -> Iterator[Bench]:
    swing = Poses(lambda time: ((0.05 * sin(3.0 * time), 0.0, 0.02), True))
    yield Bench(Ros2Device(Ros2Options(), TICK, swing), virtual_time())


@contextmanager
def replay(folder: Path) -> Iterator[Bench]:
    path = folder / "circle.csv"
    rows = [f"{i * 0.01},{0.001 * (i % 7)},{0.0005 * i},{-0.0001 * i},0,0,0" for i in range(101)]
    path.write_text("\n".join(["t,px,py,pz,fx,fy,fz", *rows]) + "\n")
    driver = load("replay")
    yield Bench(driver(driver.Options(trace=path), TICK), virtual_time())


def armed(name: str, *, checked: bool = True, **options: Any) -> Device:
    """A device that may have force: its signs count as checked, unless told otherwise."""
    driver: Any = load(name)
    signs = driver.fingerprint(driver.Options(**options)) if checked else None
    device: Device = driver(driver.Options(**options, signs_checked=signs), TICK)
    return device


@contextmanager
def on_a_wire(emulator: Any, wire: ServedDevice, make: Callable[[], Device]) -> Iterator[Bench]:
    """A device on the wire of its emulator, which is served there."""
    with wire:
        device: Any = make()
        wrong: WireFaults = emulator.faults

        def felt() -> Vector:
            if not wire.plugged:  # nobody serves it any more, and its time goes on all the same
                emulator.advance(monotonic())
            force: Vector = emulator.force
            return force

        faults: dict[str, Callable[[], None]] = {
            "unplug": wire.unplug,
            "plug": wire.plug,
            "flicker": lambda: setattr(wrong, "garble", 3),
            "silent": lambda: setattr(wrong, "silent", True),
            "late": lambda late_s=0.2: setattr(wrong, "late_s", late_s),
            "garbled": lambda: setattr(wrong, "garble", 1_000_000),
            "restart": lambda: emulator.inject("restart", 1.0),
            "guardian": lambda: os.kill(device._worker._guardian.pid, signal.SIGKILL),
        }
        try:
            yield Bench.that_feels(device, felt, faults)
        finally:
            device.close()


@contextmanager
def force_dimension(folder: Path, *, checked: bool = True, **options: Any) -> Iterator[Bench]:
    """A real library file, compiled, in place of the maker's."""
    fake = FakeDhd(folder / "devices")
    handle = fake[0].plug()
    handle["swing_m"] = 0.05
    device = armed("force_dimension", checked=checked, library=str(fake.library), **options)
    faults: dict[str, Callable[[], None]] = {
        "unplug": lambda: handle.__setitem__("present", 0),
        "plug": lambda: handle.plug() and None,
        "silent": lambda: handle.__setitem__("fails", 7),
        "garbled": lambda: handle.__setitem__("not_a_number", 1),
        "restart": lambda: handle.__setitem__("reset", 1),
        "button": lambda: handle.switch_off(1),
        "too_fast": lambda: handle.switch_off(2),
    }
    try:
        yield Bench.that_feels(device, lambda: handle.wrench[0], faults)
    finally:
        device.close()


DHD_FAULTS = ("unplug", "silent", "garbled", "restart", "button", "too_fast")


@contextmanager
def on_a_pty(name: str, folder: Path, **options: Any) -> Iterator[Bench]:
    emulator_class = load_emulator(name)
    emulator = emulator_class(emulator_class.Options())
    wire = PtyDevice(emulator, folder / name)
    with on_a_wire(emulator, wire, lambda: armed(name, port=str(wire.path), **options)) as bench:
        yield bench


@contextmanager
def on_a_websocket(name: str, **options: Any) -> Iterator[Bench]:
    emulator_class = load_emulator(name)
    emulator = emulator_class(emulator_class.Options())
    wire = WebSocketDevice(emulator)
    with on_a_wire(emulator, wire, lambda: armed(name, port=wire.address, **options)) as bench:
        yield bench


@contextmanager
def polhem_hid(folder: Path, *, checked: bool = True) -> Iterator[Bench]:
    if ADDRESS not in os.environ:
        pytest.skip("in the process that test_hid_contract starts")
    with outer_bench("polhem_hid") as (path, ask):
        device = armed("polhem_hid", checked=checked, port=path)
        faults: dict[str, Callable[[], None]] = {fault: partial(ask, fault) for fault in HID_FAULTS}
        try:
            yield Bench.that_feels(device, partial(ask, "felt"), faults)
        finally:
            device.close()


@contextmanager
def seen_by_the_kernel(name: str) -> Iterator[Bench]:
    """A rate-controlled device in the process that test_hid_contract starts; it has no motors."""
    if ADDRESS not in os.environ:
        pytest.skip("in the process that test_hid_contract starts")
    with outer_bench(name) as (path, ask):
        driver = load(name)
        device = driver(driver.Options(port=path), TICK)
        try:
            yield Bench(device, real_time(), None, {"unplug": partial(ask, "unplug")})
        finally:
            device.close()


@contextmanager
def touch(folder: Path, *, checked: bool = True) -> Iterator[Bench]:
    """The maker's library is a fake one, whose board holds the last force."""
    with fake_hd.plugged(folder) as (board,):
        device: Any = armed("touch", checked=checked, library=str(fake_hd.library()))
        faults: dict[str, Callable[[], None]] = {
            "unplug": lambda: setattr(board, "unplugged", 1),
            "silent": lambda: setattr(board, "silent", 1),
            "killed": lambda: os.kill(device.servo_pid, signal.SIGKILL),
            "stopped": lambda: os.kill(device.servo_pid, signal.SIGSTOP),
        }
        try:
            yield Bench.that_feels(device, lambda: board.felt, faults)
        finally:
            device.close()


BENCHES: dict[str, Callable[..., AbstractContextManager[Bench]]] = {
    "force_dimension": force_dimension,
    "gamepad": lambda folder: seen_by_the_kernel("gamepad"),
    "haply_2diy": lambda folder, **how: on_a_pty("haply_2diy", folder, reply_ms=30.0, **how),
    "inverse3": lambda folder, **how: on_a_websocket("inverse3", grip="wireless_verse_grip", reply_ms=30.0, **how),
    "operator": operator,
    "pointer": pointer,
    "polhem_hid": polhem_hid,
    "polhem_serial": lambda folder, **how: on_a_pty("polhem_serial", folder, model="vintage_phantom", **how),
    "replay": replay,
    "ros2": ros2,
    "spacemouse": lambda folder: seen_by_the_kernel("spacemouse"),
    "touch": touch,
}
ON_A_WIRE = ("force_dimension", "haply_2diy", "inverse3", "polhem_hid", "polhem_serial", "touch")
RECONNECTS = ("force_dimension", "haply_2diy", "inverse3", "polhem_serial")
RATE_CONTROLLED = ("gamepad", "spacemouse")
FAULTS = [
    *((name, fault) for name in ("haply_2diy", "inverse3", "polhem_serial") for fault in SERIAL_FAULTS),
    *((name, "guardian") for name in ("haply_2diy", "inverse3")),
    *(("polhem_hid", fault) for fault in HID_FAULTS),
    *(("force_dimension", fault) for fault in DHD_FAULTS),
    *(("touch", fault) for fault in ("unplug", "silent", "killed", "stopped")),
]
