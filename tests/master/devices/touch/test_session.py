"""A live session: the handle of the fake presses on a floor, and daemon and servo process are stopped and killed."""

import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from time import monotonic, sleep

import pytest

from tests.master.devices.touch.fake_hd import Board, library, plugged
from tests.program import Program, document
from tests.wait import until
from weberlink.master.devices.threaded_device import RAMP_S
from weberlink.master.devices.touch.device import TouchDevice
from weberlink.master.devices.touch.options import TouchOptions

pytestmark = pytest.mark.realtime(alone=True)

LIMIT_S = 0.1
RELEASE_LIMIT_S = 10.0
DEPTH_M, STIFFNESS = 0.006, 300.0
FILE = """
axes: xyz
link: {{listen: "127.0.0.1:0", slave: "127.0.0.1:0", security: session, silence_ms: 500}}
master:
  device: {{driver: touch, library: {library}, signs_checked: {checked}}}
slave:
  robot: {{driver: point, workspace_m: 0.3}}
  scene: [{{shape: plane, stiffness_n_m: {stiffness}}}]
  limits: {{robot_ms: 500}}
"""


@contextmanager
def pressing(folder: Path) -> Iterator[tuple[Board, Program, int]]:
    """A session whose hand presses on a floor: the board, the program, and the process id of the master."""
    with plugged(folder) as (board,):
        board.radius, board.centre[1] = 0.0, -1e3 * DEPTH_M  # y of the library is up
        options = TouchOptions(library=str(library()))
        file = folder / "pressing.yaml"
        checked = TouchDevice.fingerprint(options)
        file.write_text(FILE.format(library=options.library, checked=checked, stiffness=STIFFNESS))
        with Program("loopback", file, "--json", "-") as program:
            master = program.engaged("master")
            until(lambda: board.displayed > 1.0, "a force on the hand")
            yield board, program, master.pid


def ends_after(board: Board, pid: int, number: signal.Signals) -> float:
    """How long after a signal the board has no force [s]."""
    sent_at = monotonic()
    os.kill(pid, number)
    until(lambda: board.displayed == 0.0, "no force")
    return board.zero_after(sent_at) or 0.0


def test_master_stopped_then_killed_in_contact(tmp_path: Path) -> None:
    with pressing(tmp_path) as (board, _, pid):
        until(lambda: tuple(board.force) == pytest.approx((0.0, STIFFNESS * DEPTH_M, 0.0), rel=0.1), "the floor")
        assert ends_after(board, pid, signal.SIGSTOP) <= LIMIT_S
        sleep(0.2)
        seen = board.logged
        os.kill(pid, signal.SIGCONT)
        until(lambda: board.displayed > 1.0, "the force again")
        for (before, a), (after, b) in pairwise(board.forces[seen:]):
            assert b - a <= 1.1 * STIFFNESS * DEPTH_M * (after - before + 0.002) / RAMP_S
        assert ends_after(board, pid, signal.SIGKILL) <= LIMIT_S
        until(lambda: board.owner == 0, "the end of the servo process")
        assert board.displayed == 0.0


@pytest.mark.hunt
def test_killed_servo_process_ends_session_without_force(tmp_path: Path) -> None:
    with pressing(tmp_path) as (board, program, _):
        servo = board.owner
        assert ends_after(board, servo, signal.SIGKILL) <= RELEASE_LIMIT_S
        status, output, _ = program.finish()
        assert status == 1
        assert "device fault: touch: its servo process ended by SIGKILL" in document(output)["outcome"]
