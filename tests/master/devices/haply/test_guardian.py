"""A program that drives a Haply is stopped, killed or held up while it pushes: when the torque ends, how it comes back.

Times are those at which the emulated board takes a message.
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
from weberlink.hardware.emulator import PtyDevice
from weberlink.hardware.serial_port import SerialPort
from weberlink.master.devices.haply.board import HaplyBoard
from weberlink.master.devices.haply.linkage import VERSIONS, degrees
from weberlink.master.devices.threaded_device import RAMP_S
from weberlink.master.emulators.haply import HaplyEmulator, HaplyEmulatorOptions

PATIENCE_S = 30.0
LIMIT_S = 0.1
"""In which the force ends."""
FORCE_N = 0.8
KIND = VERSIONS["v3"]
HOME_DEG = degrees(KIND.bar.angles(KIND.center))
STEP_N = FORCE_N * 2.0 * host.TICK / RAMP_S
"""The largest one on the way up: what the ramp has in the longest pause between two messages."""


class Logged(HaplyEmulator):
    """Notes when the board took a message, and the force on the hand then [N]."""

    def __init__(self) -> None:
        handle = {"tremor_m": 0.0, "script": [{"motion": "rest"}], "home_m": ZERO}
        super().__init__(HaplyEmulatorOptions.model_validate({"handle": handle}))
        self.handle.carry(self.handle.position)
        self.log: list[tuple[float, float]] = []

    def receive(self, data: bytes, now: float) -> None:
        super().receive(data, now)
        self.log.append((now, norm(self.force)))

    def zero_after(self, at: float) -> float | None:
        """How long after `at` a message left no force [s]."""
        return next((now - at for now, force in list(self.log) if now >= at and force == 0.0), None)


class Host:
    """The program, while it pushes."""

    def __init__(self, board: Logged, process: "subprocess.Popen[str]") -> None:
        self.board = board
        self.process = process

    @property
    def guardian(self) -> int:
        children = Path(f"/proc/{self.process.pid}/task").glob("*/children")
        (pid,) = [int(pid) for each in children for pid in each.read_text().split()]
        return pid

    def pushes(self) -> bool:
        return norm(self.board.force) > 0.95 * FORCE_N

    def zero_after(self, deed: Callable[[], None]) -> float:
        """How long after a deed, in the middle of a push, the board has no torque [s]."""
        wait_for(self.pushes)
        at = monotonic()
        deed()
        wait_for(lambda: self.board.zero_after(at) is not None)
        return self.board.zero_after(at) or 0.0


@contextmanager
def pushing(folder: Path) -> Iterator[Host]:
    board = Logged()
    with PtyDevice(board, folder / "tty") as port:
        options = json.dumps({"port": str(port.path), "home_deg": HOME_DEG})
        process = subprocess.Popen(
            [sys.executable, "-m", host.__name__, "haply_2diy", options, json.dumps([0.0, FORCE_N, 0.0])],
            cwd=Path(__file__).parents[4],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        try:
            yield Host(board, process)
        finally:
            process.kill()
            process.communicate()


@pytest.mark.realtime(alone=True)
def test_stopped_program_has_no_force_and_ramps_again(tmp_path: Path) -> None:
    with pushing(tmp_path) as at:
        for stopped_s in (0.1, 0.5):
            began = monotonic()
            assert at.zero_after(lambda: at.process.send_signal(signal.SIGSTOP)) <= LIMIT_S
            sleep(max(0.0, began + stopped_s - monotonic()))
            seen = len(at.board.log)
            assert at.board.log[-1][1] == 0.0
            at.process.send_signal(signal.SIGCONT)
            wait_for(at.pushes)
            forces = [force for _, force in at.board.log[seen:]]
            assert forces[0] == 0.0
            assert max(b - a for a, b in pairwise(forces)) <= STEP_N * 1.01


@pytest.mark.realtime(alone=True)
def test_killed_program_has_no_force_and_frees_port(tmp_path: Path) -> None:
    with pushing(tmp_path) as at:
        wait_for(at.pushes)
        guardian = at.guardian
        assert at.zero_after(at.process.kill) <= LIMIT_S
        wait_for(lambda: not Path(f"/proc/{guardian}").exists())
        SerialPort(str(tmp_path / "tty")).close()


@pytest.mark.realtime(alone=True)
def test_stalled_loop_ends_force_despite_device_thread(tmp_path: Path) -> None:
    with pushing(tmp_path) as at:

        def stall() -> None:
            assert at.process.stdin is not None
            at.process.stdin.write("0.3\n")
            at.process.stdin.flush()

        assert at.zero_after(stall) <= LIMIT_S
        wait_for(at.pushes)


@pytest.mark.realtime(alone=True)
def test_without_its_guardian_a_program_ends_without_force(tmp_path: Path) -> None:
    with pushing(tmp_path) as at:
        wait_for(at.pushes)
        guardian = at.guardian
        assert at.zero_after(lambda: os.kill(guardian, signal.SIGKILL)) <= LIMIT_S
        assert at.process.stdout is not None
        assert "haply_2diy: its guardian process died" in at.process.stdout.readline()
        wait_for(lambda: norm(at.board.force) == 0.0)


@pytest.mark.parametrize("sent", range(10))
def test_torques_off_works_behind_a_partial_message(sent: int) -> None:
    """And the board still knows the device: a plain zero would be swallowed, and its rest be taken for resets."""
    emulator, board = Logged(), KIND.board
    push(emulator, board)
    emulator.receive(board.torques(-0.1, 0.05)[:sent], 1.0)
    emulator.receive(board.torques_off, 1.001)
    assert emulator.torques == pytest.approx((0.0, 0.0), abs=1e-30)
    emulator.replies(2.0)
    emulator.receive(board.torques(0.0, 0.0), 2.0)
    assert board.angles(emulator.replies(3.0)[-1])


def test_plain_zero_behind_partial_message_leaves_torque() -> None:
    """What the ignored bytes are for."""
    emulator, board = Logged(), KIND.board
    push(emulator, board)
    emulator.receive(board.torques(-0.1, 0.05)[:6], 1.0)
    emulator.receive(board.torques(0.0, 0.0), 1.001)
    assert max(map(abs, emulator.torques)) > 0.01


def push(emulator: Logged, board: HaplyBoard) -> None:
    emulator.advance(0.0)
    emulator.receive(board.setup, 0.0)
    emulator.receive(board.torques(0.1, -0.1), 0.5)
    assert max(map(abs, emulator.torques)) > 0.05
