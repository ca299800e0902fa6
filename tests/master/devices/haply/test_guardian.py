"""A program that drives a Haply is stopped, killed or held up while it pushes: when the torque ends, how it comes back.

Times are those at which the emulated board takes a message.
"""

import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from time import monotonic, sleep

import pytest

from tests.hardware.scripted import wait_for
from tests.master.devices.pushing import TICK, Pushing, pushing
from weberlink.geometry.vector import ZERO, norm
from weberlink.hardware.emulator import PtyDevice
from weberlink.hardware.serial_port import SerialPort
from weberlink.master.devices.haply.board import HaplyBoard
from weberlink.master.devices.haply.linkage import VERSIONS, degrees
from weberlink.master.emulators.haply import HaplyEmulator, HaplyEmulatorOptions

PATIENCE_S = 30.0
LIMIT_S = 0.1
"""In which the force ends."""
FORCE_N = 0.8
KIND = VERSIONS["v3"]
HOME_DEG = degrees(KIND.bar.angles(KIND.center))


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


@contextmanager
def pushing_at(folder: Path) -> Iterator[Pushing]:
    board = Logged()
    with PtyDevice(board, folder / "tty") as port:
        options = {"port": str(port.path), "home_deg": HOME_DEG}
        with pushing("haply_2diy", options, (0.0, FORCE_N, 0.0), lambda: list(board.log)) as at:
            yield at


@pytest.mark.realtime(alone=True)
def test_stopped_program_has_no_force_and_ramps_again(tmp_path: Path) -> None:
    with pushing_at(tmp_path) as at:
        for stopped_s in (0.1, 0.5):
            began = monotonic()
            assert at.zero_after(lambda: at.process.send_signal(signal.SIGSTOP)) <= LIMIT_S
            sleep(max(0.0, began + stopped_s - monotonic()))
            seen = len(at.log())
            assert at.force == 0.0
            at.process.send_signal(signal.SIGCONT)
            assert at.rises(seen, 2.0 * TICK)


@pytest.mark.realtime(alone=True)
def test_killed_program_has_no_force_and_frees_port(tmp_path: Path) -> None:
    with pushing_at(tmp_path) as at:
        wait_for(at.pushes)
        guardian = at.child
        assert at.zero_after(at.process.kill) <= LIMIT_S
        wait_for(lambda: not Path(f"/proc/{guardian}").exists())
        SerialPort(str(tmp_path / "tty")).close()


@pytest.mark.realtime(alone=True)
def test_stalled_loop_ends_force_despite_device_thread(tmp_path: Path) -> None:
    with pushing_at(tmp_path) as at:
        assert at.zero_after(at.stall) <= LIMIT_S
        wait_for(at.pushes)


@pytest.mark.realtime(alone=True)
def test_without_its_guardian_a_program_ends_without_force(tmp_path: Path) -> None:
    with pushing_at(tmp_path) as at:
        wait_for(at.pushes)
        guardian = at.child
        assert at.zero_after(lambda: os.kill(guardian, signal.SIGKILL)) <= LIMIT_S
        assert "haply_2diy: its guardian process died" in at.says()
        wait_for(lambda: at.force == 0.0)


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
