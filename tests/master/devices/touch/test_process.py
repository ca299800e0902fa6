"""The program, or its servo process, is stopped or killed in a push: when the force ends, and how it comes back.

Times are those at which the board of the fake library takes a force; that board never removes one by itself.
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
from tests.master.devices.touch import host
from tests.master.devices.touch.fake_hd import Board, library, plugged
from weberlink.master.devices.threaded_device import RAMP_S
from weberlink.master.devices.touch.servo import LONGEST_S

pytestmark = pytest.mark.realtime(alone=True)

FORCE_N = 2.0
LIMIT_S = 0.1
"""In which the force ends where the servo process lives."""
RELEASE_LIMIT_S = 10.0
"""In which another servo process, which must start first, takes the force off: below a second on an idle host."""
STEP_N = FORCE_N * LONGEST_S / RAMP_S
"""In one frame on the way up, at most."""


class Host:
    """The program, while it pushes."""

    def __init__(self, board: Board, process: "subprocess.Popen[str]") -> None:
        self.board = board
        self.process = process
        assert process.stdout is not None
        self.servo = int(process.stdout.readline())

    def pushes(self) -> bool:
        return self.board.displayed > 0.99 * FORCE_N

    def zero_after(self, deed: Callable[[], None]) -> float:
        """How long after a deed, in the middle of a push, the board has no force [s]."""
        wait_for(self.pushes)
        at = monotonic()
        deed()
        wait_for(lambda: self.board.zero_after(at) is not None)
        return self.board.zero_after(at) or 0.0

    def last_words(self) -> str:
        assert self.process.stdout is not None
        return self.process.stdout.readline()

    def servo_is_gone(self) -> bool:
        return not Path(f"/proc/{self.servo}").exists()


@contextmanager
def pushing(folder: Path) -> Iterator[Host]:
    with plugged(folder) as (board,):
        options = json.dumps({"library": str(library())})
        process = subprocess.Popen(
            [sys.executable, "-m", host.__name__, options, json.dumps([0.0, FORCE_N, 0.0])],
            cwd=Path(__file__).parents[4],
            stdout=subprocess.PIPE,
            text=True,
        )
        try:
            yield Host(board, process)
        finally:
            process.kill()
            process.communicate()


def test_stopped_program_has_no_force_and_ramps_again(tmp_path: Path) -> None:
    with pushing(tmp_path) as at:
        assert at.zero_after(lambda: at.process.send_signal(signal.SIGSTOP)) <= LIMIT_S
        sleep(0.3)
        assert at.board.displayed == 0.0
        seen = at.board.logged
        at.process.send_signal(signal.SIGCONT)
        wait_for(at.pushes)
        forces = [0.0, *(force for _, force in at.board.forces[seen:])]
        assert max(b - a for a, b in pairwise(forces)) <= STEP_N * 1.01


def test_killed_program_has_no_force_and_releases_device(tmp_path: Path) -> None:
    with pushing(tmp_path) as at:
        assert at.zero_after(at.process.kill) <= LIMIT_S
        wait_for(lambda: at.board.owner == 0)
        assert at.board.displayed == 0.0


def test_killed_servo_is_a_fault_and_force_is_taken_off(tmp_path: Path) -> None:
    with pushing(tmp_path) as at:
        assert at.zero_after(lambda: os.kill(at.servo, signal.SIGKILL)) <= RELEASE_LIMIT_S
        assert at.last_words() == "touch: its servo process ended by SIGKILL\n"
        wait_for(lambda: at.process.poll() == 0)
        assert (at.board.owner, at.board.displayed) == (0, 0.0)


def test_force_that_cannot_be_taken_off_is_told(tmp_path: Path) -> None:
    """The device of a killed program may refuse the next one, as users report."""
    with pushing(tmp_path) as at:
        wait_for(at.pushes)
        at.board.jams = 1
        os.kill(at.servo, signal.SIGKILL)
        assert at.last_words() == "touch: its servo process ended by SIGKILL\n"
        said = at.last_words()
        assert "died with a force on the hand: switch the device off" in said
        assert "HD_COMM_CONFIG_ERROR" in said
        assert at.board.displayed == pytest.approx(FORCE_N, rel=0.05)


def test_stopped_servo_is_a_fault_and_force_is_taken_off(tmp_path: Path) -> None:
    with pushing(tmp_path) as at:
        assert at.zero_after(lambda: os.kill(at.servo, signal.SIGSTOP)) <= RELEASE_LIMIT_S
        assert at.last_words().startswith("touch: its servo process has been silent for 0.2")
        wait_for(lambda: at.process.poll() == 0)
        assert at.servo_is_gone()
        assert (at.board.owner, at.board.displayed) == (0, 0.0)


def test_both_stopped_together_leave_the_force(tmp_path: Path) -> None:
    """As a frozen container: nothing on this host can help, and the page says so; afterwards it ramps up again."""
    with pushing(tmp_path) as at:
        wait_for(at.pushes)
        for pid in (at.servo, at.process.pid):
            os.kill(pid, signal.SIGSTOP)
        sleep(0.3)
        seen, held = at.board.logged, at.board.displayed
        for pid in (at.servo, at.process.pid):
            os.kill(pid, signal.SIGCONT)
        wait_for(lambda: at.board.logged > seen)
        assert held == pytest.approx(FORCE_N, rel=0.05)
        assert at.board.forces[seen][1] == 0.0
        wait_for(at.pushes)
