"""A program that pushes with an Inverse3 is stopped, killed or held up, or its service is: when the force ends.

The emulated service keeps a command for ten seconds here, longer than any test: what ends the force is the driver, its
guardian, or the end of the connection.
"""

import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from time import sleep

import pytest

from tests.hardware.scripted import wait_for
from tests.master.devices.pushing import TICK, Pushing, pushing
from weberlink.geometry.vector import ZERO, norm
from weberlink.hardware.websocket_device import WebSocketDevice
from weberlink.master.emulators.inverse3 import Inverse3Emulator, Inverse3EmulatorOptions

pytestmark = pytest.mark.realtime(alone=True)

LIMIT_S = 0.1
"""In which the force ends."""
FORCE_N = 0.8


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


@contextmanager
def pushing_at() -> Iterator[tuple[Logged, Pushing]]:
    service = Logged()
    with WebSocketDevice(service) as wire:
        options = {"port": wire.address, "reply_ms": 100.0}
        with pushing("inverse3", options, (0.0, FORCE_N, 0.0), lambda: list(service.log)) as at:
            yield service, at


def test_stopped_program_has_no_force_and_ramps_again() -> None:
    with pushing_at() as (service, at):
        assert at.zero_after(lambda: at.process.send_signal(signal.SIGSTOP)) <= LIMIT_S
        sleep(0.2)
        seen = len(service.log)
        assert at.force == 0.0
        at.process.send_signal(signal.SIGCONT)
        assert at.rises(seen, 3.0 * TICK)


def test_killed_program_has_no_force_and_leaves_no_process() -> None:
    with pushing_at() as (service, at):
        wait_for(at.pushes)
        guardian = at.child
        assert at.zero_after(at.process.kill) <= LIMIT_S
        wait_for(lambda: not Path(f"/proc/{guardian}").exists())
        wait_for(lambda: not service.sessions)


def test_stalled_loop_ends_force_despite_device_thread() -> None:
    with pushing_at() as (_, at):
        assert at.zero_after(at.stall) <= LIMIT_S
        wait_for(at.pushes)


def test_without_its_guardian_a_program_ends_without_force() -> None:
    with pushing_at() as (_, at):
        wait_for(at.pushes)
        guardian = at.child
        assert at.zero_after(lambda: os.kill(guardian, signal.SIGKILL)) <= LIMIT_S
        assert "inverse3: its guardian process died" in at.says()


def test_silent_service_ends_the_program_with_a_reason() -> None:
    with pushing_at() as (service, at):
        wait_for(at.pushes)
        service.faults.silent = True
        assert "no answer within 100 ms" in at.says()
        wait_for(lambda: service.force == ZERO)
