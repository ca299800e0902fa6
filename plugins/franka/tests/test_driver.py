"""The driver with its controller process, on the stand-in of the library: ends, deaths and refusals."""

import subprocess
import sys
from pathlib import Path
from time import monotonic

import pytest

from plugins.franka.tests import library
from plugins.franka.tests.library import PROGRAM, ROOT
from tests.wait import until
from weberlink.geometry.vector import Vector
from weberlink.slave.robots.contract import RobotFault
from weberlink_franka.controller import RefusedError, check_mode, check_place
from weberlink_franka.driver import FrankaRobot
from weberlink_franka.options import FrankaOptions

TICK = 0.001
ASIDE: Vector = (0.5, 0.25, 0.45)


def robot_at(host: str = "arm", **options: object) -> FrankaRobot:
    wanted = FrankaOptions.model_validate({"host": host, "priority": 0, "lost_ms": 1000.0, **options})
    return FrankaRobot(wanted, None, TICK, PROGRAM)


@pytest.mark.parametrize(
    ("scenario", "reason"), [("reflex", "cartesian_reflex.*slave.robot.recover=true"), ("user_stop", "user stop")]
)
def test_robot_that_takes_no_commands_is_named(scenario: str, reason: str) -> None:
    robot = library.Robot(scenario)
    with pytest.raises(RefusedError, match=reason):
        check_mode(library, robot, FrankaOptions())
    if scenario == "reflex":
        check_mode(library, robot, FrankaOptions(recover=True))
        assert not robot.read_once().current_errors


def test_start_outside_of_the_workspace_is_refused() -> None:
    state = library.Robot("arm").read_once()
    check_place(state, FrankaOptions())
    with pytest.raises(RefusedError, match=r"at \[0.500, 0.000, 0.450\], outside of workspace_m"):
        check_place(state, FrankaOptions(workspace_m=((0.3, -0.3, 0.5), (0.7, 0.3, 0.7))))


@pytest.mark.realtime
def test_refusal_ends_the_opening_with_its_reason() -> None:
    robot = robot_at("arm,reflex")
    with pytest.raises(RobotFault, match=r"^franka: the robot has stopped \(cartesian_reflex\)"):
        robot.open(monotonic())
    assert robot.controller_pid is None


@pytest.mark.realtime
def test_close_waits_for_rest_and_the_end() -> None:
    robot = robot_at(approach_m_s=0.4)
    robot.open(monotonic())

    def moves() -> bool:
        robot.command(ASIDE, monotonic())
        robot.latest(monotonic())
        return robot.state.joint_speed > 0.05

    until(moves, "the arm to move", pause=TICK)
    controller = robot._child
    robot.close()
    assert controller is not None
    assert controller.how_it_ended == "ended with status 0", "with the arm at rest"


DAEMON = f"""
import sys
from time import monotonic, sleep
sys.path.insert(0, {str(ROOT)!r})
from plugins.franka.tests.test_driver import ASIDE, robot_at
robot = robot_at(approach_m_s=0.4)
robot.open(monotonic())
print(robot.controller_pid, flush=True)
while True:
    robot.command(ASIDE, monotonic())
    sleep(0.001)
"""


@pytest.mark.realtime
def test_controller_ends_with_a_killed_daemon() -> None:
    with subprocess.Popen([sys.executable, "-c", DAEMON], stdout=subprocess.PIPE, text=True) as daemon:
        assert daemon.stdout is not None
        child = Path(f"/proc/{daemon.stdout.readline().strip()}")
        assert child.exists()
        daemon.kill()
    until(lambda: not child.exists(), "the controller to end")
