"""A program that pushes with an Inverse3 is stopped, killed or held up, or its service is: when the force ends.

The emulated service keeps a command for ten seconds here, longer than any test: what ends the force is the driver, its
guardian, or the end of the connection.
"""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from time import monotonic, sleep

import pytest

from tests.hardware.scripted import wait_for
from tests.master.devices import pushing_host as host
from weberlink.geometry.vector import ZERO, norm
from weberlink.hardware.websocket_device import WebSocketDevice
from weberlink.master.devices.threaded_device import RAMP_S
from weberlink.master.emulators.inverse3 import Inverse3Emulator, Inverse3EmulatorOptions

pytestmark = pytest.mark.realtime(alone=True)

LIMIT_S = 0.1
"""In which the force ends."""
FORCE_N = 0.8
STEP_N = FORCE_N * 2.0 * host.TICK / RAMP_S
"""The largest one on the way up: what the ramp has in the longest pause between two messages."""


class Logged(Inverse3Emulator):
    """Notes the force on the hand [N] whenever it may have changed, and when."""

    def __init__(self) -> None:
        handle = {"tremor_m": 0.0, "script": [{"motion": "rest"}], "home_m": ZERO}
        super().__init__(Inverse3EmulatorOptions.model_validate({"handle": handle, "time_out_ms": 1e4}))
        self.handle.carry(self.handle.position)
        self.log: list[tuple[float, float]] = []

    def advance_force(self, now: float) -> None:
        super().advance_force(now)
        self.log.append((now, norm(self.force)))


class Host:
    """The program, while it pushes."""

    def __init__(self, service: Logged, process: "subprocess.Popen[str]") -> None:
        self.service = service
        self.process = process

    @property
    def guardian(self) -> int:
        children = Path(f"/proc/{self.process.pid}/task").glob("*/children")
        (pid,) = [int(pid) for each in children for pid in each.read_text().split()]
        return pid

    def pushes(self) -> bool:
        return norm(self.service.force) > 0.95 * FORCE_N

    def zero_after(self, deed: Callable[[], object]) -> float:
        """How long after a deed, in the middle of a push, there is no force [s]."""
        wait_for(self.pushes)
        at = monotonic()
        deed()
        found: list[float] = []

        def ended() -> bool:
            found[:] = [now - at for now, force in list(self.service.log) if now >= at and force == 0.0][:1]
            return bool(found)

        wait_for(ended)
        return found[0]


@contextmanager
def pushing() -> Iterator[Host]:
    service = Logged()
    with WebSocketDevice(service) as wire:
        arguments = ("inverse3", json.dumps({"port": wire.address, "reply_ms": 100.0}), json.dumps([0.0, FORCE_N, 0.0]))
        process = subprocess.Popen(
            [sys.executable, "-m", host.__name__, *arguments],
            cwd=Path(__file__).parents[4],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        try:
            yield Host(service, process)
        finally:
            process.kill()
            process.communicate()


def test_stopped_program_has_no_force_and_ramps_again() -> None:
    with pushing() as at:
        assert at.zero_after(lambda: at.process.send_signal(signal.SIGSTOP)) <= LIMIT_S
        sleep(0.2)
        seen = len(at.service.log)
        assert at.service.log[-1][1] == 0.0
        at.process.send_signal(signal.SIGCONT)
        wait_for(at.pushes)
        forces = [force for _, force in at.service.log[seen:]]
        assert max(b - a for a, b in pairwise(forces)) <= STEP_N * 1.5


def test_killed_program_has_no_force_and_leaves_no_process() -> None:
    with pushing() as at:
        wait_for(at.pushes)
        guardian = at.guardian
        assert at.zero_after(at.process.kill) <= LIMIT_S
        wait_for(lambda: not Path(f"/proc/{guardian}").exists())
        wait_for(lambda: not at.service.sessions)


def test_stalled_loop_ends_force_despite_device_thread() -> None:
    with pushing() as at:

        def stall() -> None:
            assert at.process.stdin is not None
            at.process.stdin.write("0.3\n")
            at.process.stdin.flush()

        assert at.zero_after(stall) <= LIMIT_S
        wait_for(at.pushes)


def test_without_its_guardian_a_program_ends_without_force() -> None:
    with pushing() as at:
        wait_for(at.pushes)
        guardian = at.guardian
        assert at.zero_after(lambda: os.kill(guardian, signal.SIGKILL)) <= LIMIT_S
        assert at.process.stdout is not None
        assert "inverse3: its guardian process died" in at.process.stdout.readline()


def test_silent_service_ends_the_program_with_a_reason() -> None:
    with pushing() as at:
        wait_for(at.pushes)
        at.service.faults.silent = True
        assert at.process.stdout is not None
        assert "no answer within 100 ms" in at.process.stdout.readline()
        wait_for(lambda: at.service.force == ZERO)
