"""Every device driver on a bench: how its time passes, what hangs on its wire, and what can go wrong with it.

A driver of hardware is on a bench with an emulated device, in real time; the others are in virtual time. Serial devices
are behind a real pseudo terminal. Devices of the kernel have a stand-in for their port; `hardware/test_umockdev` has
the real one.
"""

import os
import signal
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, closing, contextmanager, suppress
from dataclasses import dataclass, field
from itertools import chain
from math import sin
from pathlib import Path
from threading import Lock
from time import monotonic, sleep
from typing import Any, Self

import pytest

from tests.master.devices.force_dimension.fake import STATE
from tests.master.devices.force_dimension.fake import Devices as FakeDhd
from tests.master.devices.polhem.boards import hid_device
from tests.master.devices.targets import Targets
from tests.master.devices.test_gamepad import Pad
from tests.master.devices.touch import fake_hd
from weberlink.geometry.vector import Vector, norm
from weberlink.hardware.emulator import PtyDevice, ServedDevice, WireFaults
from weberlink.hardware.emulators import EMULATORS
from weberlink.hardware.fault import HardwareFault
from weberlink.hardware.umockdev_input import EVENT
from weberlink.hardware.websocket_device import WebSocketDevice
from weberlink.master.devices import load
from weberlink.master.devices.contract import Device
from weberlink.master.devices.gamepad import GamepadExchange, GamepadOptions
from weberlink.master.devices.pointer import PointerDevice, PointerOptions
from weberlink.master.devices.rate_control import RateDevice
from weberlink.master.devices.spacemouse.device import PuckExchange, SpaceMouseOptions
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
        options: with which a process of its own can open the device.
        hand: where it is [m], where a bench knows it.
    """

    device: Device
    tick: Callable[[], float]
    displayed: Callable[[], float] | None = None
    faults: Mapping[str, Callable[..., None]] = field(default_factory=dict)
    felt: Callable[[], Vector] | None = None
    options: Mapping[str, Any] = field(default_factory=dict)
    hand: Callable[[], Vector] | None = None

    @classmethod
    def that_feels(
        cls,
        device: Device,
        felt: Callable[[], Vector],
        faults: Mapping[str, Callable[[], None]],
        options: Mapping[str, Any] | None = None,
        emulator: Any = None,
    ) -> Self:
        hand = None if emulator is None else lambda: emulator.handle.position
        return cls(device, real_time(), lambda: norm(felt()), faults, felt, options or {}, hand)

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


@contextmanager
def replay(folder: Path) -> Iterator[Bench]:
    path = folder / "circle.csv"
    rows = [f"{i * 0.01},{0.001 * (i % 7)},{0.0005 * i},{-0.0001 * i},0,0,0" for i in range(101)]
    path.write_text("\n".join(["t,px,py,pz,fx,fy,fz", *rows]) + "\n")
    driver = load("replay")
    yield Bench(driver(driver.Options(trace=path), TICK), virtual_time())


def armed(name: str, /, *, checked: bool = True, **options: Any) -> Device:
    """A device that may have force: its signs count as checked, unless told otherwise."""
    driver: Any = load(name)
    signs = driver.fingerprint(driver.Options(**options)) if checked else None
    device: Device = driver(driver.Options(**options, signs_checked=signs), TICK)
    return device


def emulated(name: str) -> Any:
    kind = EMULATORS.load(name)
    return kind(kind.Options())


@contextmanager
def on_a_wire(name: str, wire: ServedDevice, port: Callable[[], str], **options: Any) -> Iterator[Bench]:
    """A device on the wire of its emulator, which is served there."""
    with wire:
        emulator: Any = wire.emulator
        options = {"port": port(), **options}
        device: Any = armed(name, **options)
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
        with closing(device):
            yield Bench.that_feels(device, felt, faults, options, emulator)


@contextmanager
def force_dimension(folder: Path, *, checked: bool = True, **options: Any) -> Iterator[Bench]:
    """A real library file, compiled, in place of the maker's."""
    fake = FakeDhd(folder / "devices")
    handle = fake[0].plug()
    handle["swing_m"] = 0.05
    options |= {"library": str(fake.library)}
    device = armed("force_dimension", checked=checked, **options)
    faults: dict[str, Callable[[], None]] = {
        "unplug": lambda: handle.__setitem__("present", 0),
        "plug": lambda: handle.plug() and None,
        "silent": lambda: handle.__setitem__("fails", 7),
        "garbled": lambda: handle.__setitem__("not_a_number", 1),
        "restart": lambda: handle.__setitem__("reset", 1),
        "button": lambda: handle.switch_off(1),
        "too_fast": lambda: handle.switch_off(2),
    }
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(STATE, str(fake.state))  # for processes of a test
        yield Bench.that_feels(device, lambda: handle.wrench[0], faults, options)
        device.close()


DHD_FAULTS = ("unplug", "silent", "garbled", "restart", "button", "too_fast")


@contextmanager
def on_a_pty(name: str, folder: Path, **options: Any) -> Iterator[Bench]:
    wire = PtyDevice(emulated(name), folder / name)
    with on_a_wire(name, wire, lambda: str(wire.path), **options) as bench:
        yield bench


@contextmanager
def inverse3(folder: Path, **options: Any) -> Iterator[Bench]:
    wire = WebSocketDevice(emulated("inverse3"))
    with on_a_wire("inverse3", wire, lambda: wire.address, grip="wireless_verse_grip", **options) as bench:
        yield bench


class HidWire:
    """In place of a `HidPort`: an emulated board on a bus, which the test may cut."""

    def __init__(self, emulator: Any) -> None:
        self.emulator, self.plugged = emulator, True
        self._coming: deque[tuple[float, bytes]] = deque()
        self._lock = Lock()

    def __call__(self, path: str) -> "HidWire":
        self._pass()
        return self

    def _pass(self) -> float:
        """The time, which goes on at the board too."""
        now = monotonic()
        self.emulator.advance(now)
        if not self.plugged:
            raise HardwareFault("/dev/hidraw9: unplugged")
        return now

    def felt(self) -> Vector:
        with self._lock, suppress(HardwareFault):
            self._pass()
        force: Vector = self.emulator.force
        return force

    def write(self, report: bytes, number: int = 0) -> None:
        with self._lock:
            self.emulator.receive(report, self._pass())

    def read_all(self, until: float) -> list[bytes]:
        faults, arrived = self.emulator.faults, list[bytes]()
        while not arrived:
            with self._lock:
                now = self._pass()
                self._coming.extend((now + faults.late_s, reply) for reply in self.emulator.replies(now))
            while self._coming and self._coming[0][0] <= now and not faults.silent:
                arrived.append(self._coming.popleft()[1])
            if now >= until:
                break
            sleep(1e-4)
        return arrived

    def guard(self, guardian: object) -> None: ...

    def close(self) -> None: ...


@contextmanager
def polhem_hid(folder: Path, *, checked: bool = True) -> Iterator[Bench]:
    emulator: Any = emulated("polhem_hid")
    wire = HidWire(emulator)
    device = hid_device(wire, checked=checked)
    faults: dict[str, Callable[[], None]] = {
        "unplug": lambda: setattr(wire, "plugged", False),
        "silent": lambda: setattr(emulator.faults, "silent", True),
        "late": lambda: setattr(emulator.faults, "late_s", 0.2),
        "restart": lambda: emulator.inject("restart", 1.0),
    }
    with closing(device):
        yield Bench.that_feels(device, wire.felt, faults, None, emulator)


@contextmanager
def spacemouse(folder: Path) -> Iterator[Bench]:
    wire, options = HidWire(emulated("spacemouse")), SpaceMouseOptions(port="/dev/hidraw9")
    device = RateDevice("spacemouse", options, PuckExchange(options, list, wire), TICK, buttons=2)
    with closing(device):
        yield Bench(device, real_time(), None, {"unplug": lambda: setattr(wire, "plugged", False)})


@contextmanager
def gamepad(folder: Path) -> Iterator[Bench]:
    """Its events come tick by tick."""
    pads, emulator, wait = list[Pad](), emulated("gamepad"), real_time()
    options = GamepadOptions(port="/dev/input/event9")
    exchange = GamepadExchange(options, list, lambda path: pads.append(Pad()) or pads[-1])
    device = RateDevice("gamepad", options, exchange, TICK, buttons=8)

    def unplug() -> None:
        pads[-1].unplug()

    def tick() -> float:
        now = wait()
        emulator.advance(now)
        for _, _, *change in chain.from_iterable(map(EVENT.iter_unpack, emulator.replies(now))):
            if pads and pads[-1].kernel >= 0:
                pads[-1].change(*change)
        return now

    with closing(device):
        yield Bench(device, tick, None, {"unplug": unplug})


@contextmanager
def touch(folder: Path, *, checked: bool = True) -> Iterator[Bench]:
    """The maker's library is a fake one, whose board holds the last force."""
    with fake_hd.plugged(folder) as (board,):
        options = {"library": str(fake_hd.library())}
        device: Any = armed("touch", checked=checked, **options)
        faults: dict[str, Callable[[], None]] = {
            "unplug": lambda: setattr(board, "unplugged", 1),
            "silent": lambda: setattr(board, "silent", 1),
            "killed": lambda: os.kill(device.servo_pid, signal.SIGKILL),
            "stopped": lambda: os.kill(device.servo_pid, signal.SIGSTOP),
        }
        with closing(device):
            yield Bench.that_feels(device, lambda: board.felt, faults, options)


BENCHES: dict[str, Callable[..., AbstractContextManager[Bench]]] = {
    "force_dimension": force_dimension,
    "gamepad": gamepad,
    "haply_2diy": lambda folder, **how: on_a_pty("haply_2diy", folder, **{"reply_ms": 30.0, **how}),
    "inverse3": lambda folder, **how: inverse3(folder, **{"reply_ms": 30.0, **how}),
    "operator": operator,
    "pointer": pointer,
    "polhem_hid": polhem_hid,
    "polhem_serial": lambda folder, **how: on_a_pty("polhem_serial", folder, model="vintage_phantom", **how),
    "replay": replay,
    "spacemouse": spacemouse,
    "touch": touch,
}
ON_A_WIRE = ("force_dimension", "haply_2diy", "inverse3", "polhem_hid", "polhem_serial", "touch")
RECONNECTS = ("force_dimension", "haply_2diy", "inverse3", "polhem_serial")
RATE_CONTROLLED = ("gamepad", "spacemouse")
FAULTS = [
    *((name, fault) for name in ("haply_2diy", "inverse3", "polhem_serial") for fault in SERIAL_FAULTS),
    *((name, "guardian") for name in ("haply_2diy", "inverse3")),
    *(("polhem_hid", fault) for fault in ("unplug", "silent", "late", "restart")),
    *(("force_dimension", fault) for fault in DHD_FAULTS),
    *(("touch", fault) for fault in ("unplug", "silent", "killed", "stopped")),
]
