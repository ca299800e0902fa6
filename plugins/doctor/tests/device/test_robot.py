"""`device test` of a robot: a small slow motion along each axis and back."""

import io
import re
from collections.abc import Callable
from itertools import pairwise
from typing import Any, ClassVar

import pytest

from plugins.doctor.tests.device.people import Clock, sitting
from weberlink.cli.output import CommandError
from weberlink.geometry.vector import Vector, distance
from weberlink.hardware.discovery import PluggedDevice
from weberlink.slave.robots.contract import RobotReading, RobotSpec
from weberlink_doctor.device.commissioning import WAY_M, try_robot

BOX = ((-0.1, -0.1, -0.1), (0.1, 0.1, 0.1))


class Arm:
    """A robot that follows by `gain`, and feels `force`."""

    gain: ClassVar[float]
    force: ClassVar[Callable[[Vector], Vector]]
    start: ClassVar[Vector]
    log: ClassVar[list[tuple[str, Any]]]

    @classmethod
    def plugged(cls) -> list[PluggedDevice]:
        return []

    def __init__(self) -> None:
        self.spec = RobotSpec("arm", "xyz", 20.0, 1000.0, BOX, 1000.0, True, force_error=(0.5, 0.2))
        self._position = self.start

    def open(self, now: float) -> None:
        self.log.append(("open", None))

    def command(self, position: Vector, now: float) -> None:
        self.log.append(("command", position))
        x, y, z = (a + self.gain * (b - a) for a, b in zip(self.start, position, strict=True))
        self._position = (x, y, z)

    def latest(self, now: float) -> RobotReading:
        return RobotReading(now, self._position, type(self).force(self._position))

    def close(self) -> None:
        self.log.append(("close", None))


@pytest.fixture(autouse=True)
def _fresh() -> None:
    Arm.gain, Arm.start, Arm.log = 1.0, (0.02, 0.0, 0.099), []
    Arm.force = staticmethod(lambda position: (0.0, 0.0, -1.0))


def outcome_of(*lines: str) -> tuple[str, str]:
    """The screen, and the error at the end."""
    screen, error = io.StringIO(), ""
    dialog, keyboard = sitting(Clock(), screen, *lines)
    try:
        try_robot(Arm, Arm, dialog)
    except CommandError as caught:
        error = str(caught)
    assert [kind for kind, _ in Arm.log if kind != "command"] == ["open", "close"]
    assert keyboard.left == []
    return screen.getvalue(), error


def commands() -> list[Vector]:
    return [what for kind, what in Arm.log if kind == "command"]


def test_good_robot_moves_slowly_along_each_axis() -> None:
    screen, error = outcome_of("", "", "yes")
    assert (error, screen.endswith("The motion is right.\n")) == ("", True)
    assert "  +x: went 10.0 mm, came back to within 0.0 mm, force changed by 0.00 N" in screen
    assert "  -z: went 10.0 mm" in screen, "there is no room above"
    assert max(distance(at, Arm.start) for at in commands()) == pytest.approx(WAY_M, rel=1e-3)
    assert max(distance(a, b) for a, b in pairwise(commands())) < 0.0005


@pytest.mark.parametrize("gain", [0.0, 0.3, -1.0], ids=["not at all", "too little", "the other way"])
def test_robot_that_does_not_follow_fails(gain: float) -> None:
    Arm.gain = gain
    assert "arm: does not follow along x, y, z" in outcome_of("", "", "yes")[1]


@pytest.mark.parametrize(
    ("start_m", "agreed", "complaint"), [(0.099, "sure", ""), (0.2, "yes", "arm: is at 200 mm along z")]
)
def test_robot_without_yes_or_outside_its_workspace_does_not_move(start_m: float, agreed: str, complaint: str) -> None:
    Arm.start = (0.0, 0.0, start_m)
    error = outcome_of("", "", agreed)[1]
    assert (complaint in error, bool(error), commands()) == (True, bool(complaint), [])


def test_robot_stops_at_a_contact() -> None:
    Arm.gain = 0.8
    Arm.force = staticmethod(lambda p: (-1000.0 * max(0.0, p[0] - 0.022), 0.0, -1.0))
    assert re.fullmatch(r"arm: met 5\.\d N along x and was stopped", outcome_of("", "", "yes")[1])
    assert commands()[-1][0] == pytest.approx(0.0272, abs=5e-4)
    assert commands()[-2][0] > 0.0285, "it was commanded farther"
