"""The contract that every robot driver keeps, those of hardware before emulated hardware."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from time import monotonic
from typing import Any

import pytest

from weberlink.geometry.vector import Vector, distance, dot, is_finite, norm
from weberlink.slave.robots import ROBOTS
from weberlink.slave.robots.contract import Robot, RobotFault
from weberlink.testing.contract import FaultContract, assert_is_read_while_open
from weberlink.testing.time import PATIENCE, TICK, until


@dataclass
class RobotBench:
    """A robot before a ground that pushes up."""

    robot: Robot  # not open
    tick: Callable[[], float]  # the time of the next tick [s]; waits for it where time is real
    above: Vector  # a free place over the ground
    below: Vector  # a place in the ground that makes a few newtons
    tolerance_m: float = 1e-3  # how near it comes to where it is told
    settle_ticks: int = 600  # in which it does
    faults: Mapping[str, Callable[[], None]] = field(default_factory=dict)  # none for one that is computed

    def opened(self) -> Robot:
        self.robot.open(self.tick())
        return self.robot

    def hold(self, position: Vector, ticks: int | None = None) -> Iterator[float]:
        """Command a position, tick by tick; gives each time after the command."""
        for _ in range(self.settle_ticks if ticks is None else ticks):
            now = self.tick()
            self.robot.command(position, now)
            yield now


class RobotContract:
    """What every robot driver keeps. A test class inherits from it, and overrides the fixture `bench`.

    Mark the class `realtime` where the time of its bench is real.
    """

    @pytest.fixture
    def bench(self) -> Iterator[RobotBench]:
        """A bench with a robot that is not open; closes the robot at the end."""
        raise NotImplementedError

    def test_the_spec_is_there_before_opening(self, bench: RobotBench) -> None:
        spec = bench.robot.spec
        driver: Any = ROBOTS[spec.name]
        assert type(bench.robot) is driver, "the name is that of its entry point"
        assert set(spec.axes) <= set("xyz")
        assert spec.axes
        assert spec.force_n > 0.0
        assert spec.stiffness_n_m > 0.0
        assert spec.torque_n_m >= 0.0
        assert spec.torque_n_m == 0.0 or hasattr(bench.robot, "point")
        assert spec.rate_hz > 0.0
        assert spec.lag_s >= 0.0
        assert min(spec.force_error) >= 0.0
        lower, upper = spec.workspace_m
        assert all(a < b for a, b in zip(lower, upper, strict=True))
        assert "\n" not in spec.note

    def test_only_open_robots_are_read(self, bench: RobotBench) -> None:
        assert_is_read_while_open(bench.robot, bench.above, bench.tick, RobotFault)

    def test_readings_are_monotonic_and_reproducible(self, bench: RobotBench) -> None:
        robot = bench.opened()
        lower, upper = robot.spec.workspace_m
        readings = []
        for now in bench.hold(bench.above, 300):
            reading = robot.latest(now)
            assert robot.latest(now) == reading
            assert reading.at <= now
            assert is_finite(reading.position)
            assert is_finite(reading.force)
            assert norm(reading.force) <= robot.spec.force_n + 1e-9
            assert norm(reading.torque) <= robot.spec.torque_n_m * (1.0 + 1e-9)
            assert all(a - 0.1 <= p <= b + 0.1 for a, p, b in zip(lower, reading.position, upper, strict=True))
            readings.append(reading)
        assert all(a.at <= b.at for a, b in pairwise(readings))
        assert readings[-1].at > readings[0].at
        assert bench.faults or now - readings[-1].at <= robot.spec.lag_s + 1e-9, "in real time, a host may stall"

    def test_it_goes_where_it_is_told(self, bench: RobotBench) -> None:
        bench.opened()
        approach(bench, bench.above)
        x, y, z = bench.above
        for goal in ((x + 0.015, y, z), (x, y - 0.015, z + 0.015)):

            def arrives(goal: Vector = goal) -> bool:
                return distance(approach(bench, goal), goal) <= bench.tolerance_m

            until(arrives, "it to arrive", pause=0.0)

    def test_the_ground_pushes_back_up(self, bench: RobotBench) -> None:
        robot = bench.opened()
        approach(bench, bench.above)
        absolute, _ = robot.spec.force_error
        free = robot.latest(bench.tick()).force
        assert norm(free) <= absolute + 1e-6, "nothing is touched"

        def pushed() -> Vector | None:
            """The force in the ground; None where a host that stalls has let go for most of the time."""
            approach(bench, bench.below)
            forces = [robot.latest(now).force for now in bench.hold(bench.below, 300)]
            felt = sorted(forces, key=lambda force: force[2])[len(forces) // 2]
            return felt if felt[2] > 1.0 else None

        felt = until(pushed, "the ground to push", pause=0.0)
        assert felt is not None
        assert dot(felt, (0.0, 0.0, 1.0)) > 0.8 * norm(felt) - absolute

    def test_non_finite_command_is_a_value_error(self, bench: RobotBench) -> None:
        robot = bench.opened()
        with pytest.raises(ValueError, match="not finite"):
            robot.command((float("nan"), 0.0, 0.0), bench.tick())
        assert is_finite(robot.latest(bench.tick()).position)


class HardwareRobotContract(FaultContract, RobotContract):
    """What a driver of hardware keeps besides, before an emulated robot: its faults end a session."""

    def test_fault_stops_robot_with_reason(self, fault: str, bench: RobotBench) -> None:
        robot = bench.opened()
        for now in bench.hold(robot.latest(bench.tick()).position, 100):
            robot.latest(now)
        bench.faults[fault]()
        gives_up = monotonic() + PATIENCE
        with pytest.raises(RobotFault, match=bench.robot.spec.name) as caught:
            while monotonic() < gives_up:
                for now in bench.hold(bench.above, 10):
                    robot.latest(now)
        assert "\n" not in str(caught.value)
        assert len(str(caught.value)) > len(bench.robot.spec.name) + 10, "says why"
        robot.command(bench.above, bench.tick())
        with pytest.raises(RobotFault):
            robot.latest(bench.tick())


def approach(bench: RobotBench, goal: Vector) -> Vector:
    """Lead it to a place at 0.2 m/s, and wait; gives where it came to."""
    robot = bench.robot
    start = robot.latest(bench.tick()).position
    steps = max(1, round(distance(start, goal) / 0.2 / TICK))
    for step in range(1, steps + 1):
        share = step / steps
        x, y, z = (a + share * (b - a) for a, b in zip(start, goal, strict=True))
        for now in bench.hold((x, y, z), 1):
            robot.latest(now)
    for now in bench.hold(goal):
        reading = robot.latest(now)
    return reading.position
