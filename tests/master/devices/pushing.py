"""A process that pushes with a device while a test stops, stalls or kills it, and what the hand feels of it."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from time import monotonic
from typing import Any

from tests.master.devices import pushing_host
from tests.master.devices.benches import armed
from tests.master.devices.force_dimension.fake import STATE
from tests.master.devices.force_dimension.fake import Devices as FakeDhd
from tests.master.devices.touch import fake_hd
from tests.program import ROOT
from tests.wait import until
from weberlink.geometry.vector import ZERO, norm
from weberlink.hardware.emulator import PtyDevice
from weberlink.hardware.websocket_device import WebSocketDevice
from weberlink.master.devices.contract import DeviceFault
from weberlink.master.devices.haply.linkage import VERSIONS, degrees
from weberlink.master.devices.threaded_device import RAMP_S
from weberlink.master.emulators import load as load_emulator

Log = list[tuple[float, float]]
TICK = pushing_host.TICK
PUSHES = 0.4
"""Share of its force from which a host counts as pushing: on a busy machine gaps of the loop begin the ramp anew."""
STILL = {"tremor_m": 0.0, "script": [{"motion": "rest"}]}


@dataclass
class Pushed:
    """A device that a host process can push with.

    Args:
        name: of the driver.
        options: of the driver.
        force_n: that the host commands, along +y.
        log: the sizes of the forces on the hand, each with its time: [s, N].
        limit_s: in which the force ends where the board, a guardian or a servo process ends it.
        step_s: time whose rise of the ramp one command may make.
        environment: of the host.
    """

    name: str
    options: Mapping[str, Any]
    force_n: float
    log: Callable[[], Log]
    limit_s: float = 0.5
    step_s: float = 2.0 * TICK
    environment: Mapping[str, str] = field(default_factory=dict)

    @contextmanager
    def host(self) -> Iterator["Host"]:
        """The process; dead at the end of the `with`."""
        arguments = (self.name, json.dumps(self.options), json.dumps((0.0, self.force_n, 0.0)))
        process = subprocess.Popen(
            [sys.executable, "-m", pushing_host.__name__, *arguments],
            cwd=ROOT,
            env=os.environ | dict(self.environment),
            stdin=subprocess.PIPE,
            text=True,
        )
        try:
            yield Host(self, process)
        finally:
            process.kill()
            process.communicate()

    def opens(self) -> bool:
        """Whether another process has the device no more."""
        device = armed(self.name, **self.options)
        try:
            device.open(monotonic())
        except DeviceFault:
            return False
        finally:
            device.close()
        return True


class Host:
    """The process, while it pushes."""

    def __init__(self, pushed: Pushed, process: "subprocess.Popen[str]") -> None:
        self.process = process
        self._pushed = pushed

    @property
    def force(self) -> float:
        """On the hand [N]."""
        log = self._pushed.log()
        return log[-1][1] if log else 0.0

    def await_push(self) -> None:
        until(lambda: self.force > PUSHES * self._pushed.force_n, "the push", pause=1e-3)

    def zero_after(self, deed: Callable[[], Any]) -> float:
        """How long after a deed, in the middle of a push, there is no force [s]."""
        self.await_push()
        before = monotonic()
        deed()
        at = monotonic()  # this process may have had to wait for the processor

        def ends() -> list[float]:
            return [when - at for when, force in self._pushed.log() if when >= before and force == 0.0]

        return until(ends, "the end of the force", pause=1e-3)[0]

    def steepest_rise(self, seen: int) -> float:
        """Largest step of the force back to the full push, after `seen` entries; as a share of the permitted one."""
        self.await_push()
        forces = [0.0, *(force for _, force in self._pushed.log()[seen:])]
        permitted = self._pushed.force_n * self._pushed.step_s / RAMP_S
        return max(b - a for a, b in pairwise(forces)) / permitted

    def stop(self) -> None:
        self.process.send_signal(signal.SIGSTOP)

    def go_on(self) -> None:
        self.process.send_signal(signal.SIGCONT)

    def stall(self) -> None:
        """Make the loop of the program stand still, while the thread of the device goes on."""
        assert self.process.stdin is not None
        self.process.stdin.write("0.3\n")
        self.process.stdin.flush()


def logged(name: str, *methods: str, **options: Any) -> tuple[Any, Log]:
    """An emulator whose handle is in its place, and its forces: each that there is after one of the methods."""
    kind: Any = load_emulator(name)
    emulator = kind(kind.Options.model_validate(options))
    emulator.handle.carry(emulator.handle.position)
    log: Log = []

    def noting(inner: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any) -> Any:
            answer = inner(*arguments)
            force = norm(emulator.force)
            if not log or log[-1][1] != force:
                log.append((monotonic(), force))
            return answer

        return call

    for method in methods:
        setattr(emulator, method, noting(getattr(emulator, method)))
    return emulator, log


@contextmanager
def haply(folder: Path) -> Iterator[Pushed]:
    board, log = logged("haply_2diy", "receive", handle={**STILL, "home_m": ZERO})
    home = degrees(VERSIONS["v3"].bar.angles(VERSIONS["v3"].center))
    with PtyDevice(board, folder / "tty") as port:
        yield Pushed(
            "haply_2diy", {"port": str(port.path), "home_deg": home, "reply_ms": 100.0}, 0.8, lambda: list(log)
        )


@contextmanager
def polhem(folder: Path) -> Iterator[Pushed]:
    board, log = logged("polhem_serial", "replies", "advance", model="woodenhaptics", handle=STILL)
    with PtyDevice(board, folder / "tty") as port:
        options = {"port": str(port.path), "model": "woodenhaptics"}
        yield Pushed("polhem_serial", options, 2.0, lambda: list(log))


@contextmanager
def inverse3(folder: Path) -> Iterator[Pushed]:
    """The service keeps a command for ten seconds: the driver, its guardian or the end of the connection ends it."""
    service, log = logged("inverse3", "advance_force", handle={**STILL, "home_m": ZERO}, time_out_ms=1e4)
    with WebSocketDevice(service) as wire:
        options = {"port": wire.address, "reply_ms": 100.0}
        yield Pushed("inverse3", options, 0.8, lambda: list(log), step_s=3.0 * TICK)


@contextmanager
def force_dimension(folder: Path) -> Iterator[Pushed]:
    """The stand-in keeps the time limit as the maker's documentation says that the device does."""
    devices = FakeDhd(folder / "devices")
    device = devices[0].plug()
    by_watchdog = 3

    def log() -> Log:
        taken = [(at, norm(force)) for at, force in device.log()]
        is_over = device["off_cause"] == by_watchdog and not device["force_on"]
        return [*taken, (device["off_at"], 0.0)] if is_over else taken

    options, environment = {"library": str(devices.library)}, {STATE: str(devices.state)}
    yield Pushed("force_dimension", options, 2.0, log, 0.031875, environment=environment)


@contextmanager
def touch(folder: Path) -> Iterator[Pushed]:
    """The board never removes a force by itself."""
    with fake_hd.plugged(folder) as (board,):
        yield Pushed("touch", {"library": str(fake_hd.library())}, 2.0, lambda: board.forces)


PUSHING: dict[str, Callable[[Path], AbstractContextManager[Pushed]]] = {
    "force_dimension": force_dimension,
    "haply_2diy": haply,
    "inverse3": inverse3,
    "polhem_serial": polhem,
    "touch": touch,
}
