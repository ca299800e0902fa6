"""The program, or its servo process, is stopped or killed in a push: when the force ends, and how it comes back.

Times are those at which the board of the fake library takes a force; that board never removes one by itself.
"""

import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from time import sleep

import pytest

from tests.hardware.scripted import wait_for
from tests.master.devices.pushing import Pushing, pushing
from tests.master.devices.touch.fake_hd import Board, library, plugged
from weberlink.master.devices.touch.servo import LONGEST_S

pytestmark = pytest.mark.realtime(alone=True)

FORCE_N = 2.0
LIMIT_S = 0.1
"""In which the force ends where the servo process lives."""
RELEASE_LIMIT_S = 10.0
"""In which another servo process, which must start first, takes the force off: below a second on an idle host."""


@contextmanager
def pushing_at(folder: Path) -> Iterator[tuple[Board, Pushing, int]]:
    """The board, the program, and the process id of its servo process."""
    with plugged(folder) as (board,):
        options = {"library": str(library())}
        with pushing("touch", options, (0.0, FORCE_N, 0.0), lambda: board.forces) as at:
            wait_for(at.pushes)
            yield board, at, at.child


def test_stopped_program_has_no_force_and_ramps_again(tmp_path: Path) -> None:
    with pushing_at(tmp_path) as (board, at, _):
        assert at.zero_after(lambda: at.process.send_signal(signal.SIGSTOP)) <= LIMIT_S
        sleep(0.3)
        assert board.displayed == 0.0
        seen = board.logged
        at.process.send_signal(signal.SIGCONT)
        assert at.rises(seen, LONGEST_S)


def test_killed_program_has_no_force_and_releases_device(tmp_path: Path) -> None:
    with pushing_at(tmp_path) as (board, at, _):
        assert at.zero_after(at.process.kill) <= LIMIT_S
        wait_for(lambda: board.owner == 0)
        assert board.displayed == 0.0


def test_killed_servo_is_a_fault_and_force_is_taken_off(tmp_path: Path) -> None:
    with pushing_at(tmp_path) as (board, at, servo):
        assert at.zero_after(lambda: os.kill(servo, signal.SIGKILL)) <= RELEASE_LIMIT_S
        assert at.says() == "touch: its servo process ended by SIGKILL\n"
        wait_for(lambda: at.process.poll() == 0)
        assert (board.owner, board.displayed) == (0, 0.0)


def test_force_that_cannot_be_taken_off_is_told(tmp_path: Path) -> None:
    """The device of a killed program may refuse the next one, as users report."""
    with pushing_at(tmp_path) as (board, at, servo):
        wait_for(at.pushes)
        board.jams = 1
        os.kill(servo, signal.SIGKILL)
        assert at.says() == "touch: its servo process ended by SIGKILL\n"
        said = at.says()
        assert "died with a force on the hand: switch the device off" in said
        assert "HD_COMM_CONFIG_ERROR" in said
        assert board.displayed == pytest.approx(FORCE_N, rel=0.05)


def test_stopped_servo_is_a_fault_and_force_is_taken_off(tmp_path: Path) -> None:
    with pushing_at(tmp_path) as (board, at, servo):
        assert at.zero_after(lambda: os.kill(servo, signal.SIGSTOP)) <= RELEASE_LIMIT_S
        assert at.says().startswith("touch: its servo process has been silent for 0.2")
        wait_for(lambda: at.process.poll() == 0)
        assert not Path(f"/proc/{servo}").exists()
        assert (board.owner, board.displayed) == (0, 0.0)


def test_both_stopped_together_leave_the_force(tmp_path: Path) -> None:
    """As a frozen container: nothing on this host can help, and the page says so; afterwards it ramps up again."""
    with pushing_at(tmp_path) as (board, at, servo):
        wait_for(at.pushes)
        for pid in (servo, at.process.pid):
            os.kill(pid, signal.SIGSTOP)
        sleep(0.3)
        seen, held = board.logged, board.displayed
        for pid in (servo, at.process.pid):
            os.kill(pid, signal.SIGCONT)
        wait_for(lambda: any(force == 0.0 for _, force in board.forces[seen:]))
        assert held == pytest.approx(FORCE_N, rel=0.05)
        first = [force for _, force in board.forces[seen : seen + 2]]
        assert 0.0 in first, "only the frame that was stopped may come before"
        wait_for(at.pushes)
