"""Emulated devices on the wires of their drivers, as benches: serial ports, services, and HID in place of its port."""

import os
import signal
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, suppress
from functools import partial
from pathlib import Path
from threading import Lock
from time import monotonic, sleep
from typing import Any, Self

from weberlink.geometry.vector import Vector
from weberlink.hardware.emulator import EMULATORS, WireFaults
from weberlink.hardware.fault import HardwareFault
from weberlink.testing.devices import DeviceBench, armed
from weberlink.testing.serving import PtyDevice, ServedDevice
from weberlink.testing.time import ahead_of_other_work, real_time

FLICKER = 3  # bad answers that pass


def emulated(name: str, **options: Any) -> Any:
    """The emulator of a driver."""
    kind = EMULATORS.load(name)
    return kind(kind.Options.model_validate(options))


@contextmanager
def on_a_pty(name: str, folder: Path, **options: Any) -> Iterator[DeviceBench]:
    """A driver on the pseudo terminal of its emulator, with these options."""
    wire = PtyDevice(emulated(name), folder / name)
    with on_a_wire(name, wire, lambda: str(wire.path), **options) as bench:
        yield bench


@contextmanager
def on_a_wire(name: str, wire: ServedDevice, port: Callable[[], str], **options: Any) -> Iterator[DeviceBench]:
    """A driver on the wire of its emulator, which has `force`, `faults` and `handle`, and is served meanwhile.

    Args:
        name: of the driver.
        wire: not plugged in yet.
        port: gives the option `port` once it is.
        options: of the driver, and `checked` as of `armed`.
    """
    emulator: Any = getattr(wire, "emulator")  # noqa: B009 - every kind of wire has one of its own type
    with ahead_of_other_work(), wire:
        device: Any = armed(name, port=port(), **options)

        def felt() -> Vector:
            if not wire.plugged:  # nobody serves it any more, and its time goes on all the same
                emulator.advance(monotonic())
            force: Vector = emulator.force
            return force

        faults = {
            "unplug": wire.unplug,
            "plug": wire.plug,
            "guardian": lambda: os.kill(device._worker._guardian.pid, signal.SIGKILL),
            **_faults_of(emulator, FLICKER),
        }
        told = {key: value for key, value in options.items() if key != "checked"}
        with closing(device):
            hand = None if not hasattr(emulator, "handle") else lambda: emulator.handle.position
            yield DeviceBench(device, real_time(), felt, faults, hand, {"port": port(), **told})


def _faults_of(emulator: Any, flicker: int) -> dict[str, Callable[..., object]]:
    """Those of the answers of an emulator."""
    wrong: WireFaults = emulator.faults
    return {
        **{name: partial(emulator.inject, name, 1.0) for name in emulator.OWN_FAULTS},
        "flicker": lambda: setattr(wrong, "garble", flicker),
        "silent": lambda: setattr(wrong, "silent", True),
        "late": lambda late_s=0.2: setattr(wrong, "late_s", late_s),
        "garbled": lambda: setattr(wrong, "garble", 1_000_000),
    }


class HidWire:
    """In place of a `HidPort`: an emulated board on a bus, which a test may cut by `plugged`."""

    def __init__(self, emulator: Any) -> None:
        self.emulator, self.plugged = emulator, True
        self._coming: deque[tuple[float, bytes]] = deque()
        self._lock = Lock()

    def __call__(self, path: str) -> Self:  # noqa: ARG002
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
        """Force on the hand now [N]."""
        with self._lock, suppress(HardwareFault):
            self._pass()
        force: Vector = self.emulator.force
        return force

    def write(self, report: bytes, number: int = 0) -> None:  # noqa: ARG002
        with self._lock:
            self.emulator.receive(report, self._pass())

    def read_all(self, until: float) -> list[bytes]:
        faults, arrived = self.emulator.faults, list[bytes]()
        while not arrived:
            with self._lock:
                now = self._pass()
                self._coming.extend((now + faults.late_s, reply) for reply in self.emulator.replies(now))
            while self._coming and self._coming[0][0] <= now and not faults.silent:
                report = self._coming.popleft()[1]
                if faults.garble > 0:  # of a HID report nothing arrives then
                    faults.garble -= 1
                else:
                    arrived.append(report)
            if now >= until:
                break
            sleep(1e-4)
        return arrived

    def guard(self, guardian: object) -> None: ...

    def close(self) -> None: ...

    def bench(self, device: Any) -> DeviceBench:
        """The bench of a driver that was built on this wire."""
        faults = {
            "unplug": lambda: setattr(self, "plugged", False),
            "plug": lambda: setattr(self, "plugged", True),
            **_faults_of(self.emulator, 1),  # a lost report costs a driver in lock step a long silence
        }
        has_motors = hasattr(self.emulator, "force")
        hand = (lambda: self.emulator.handle.position) if has_motors else None
        return DeviceBench(device, real_time(), self.felt if has_motors else None, faults, hand)
