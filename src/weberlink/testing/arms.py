"""The contracts that every leader arm and every follower arm keeps, those of hardware before emulated hardware."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import inf, nan
from typing import Any, ClassVar

import pytest

from weberlink.arms.contract import ArmFault, ArmReading
from weberlink.geometry.joints import Joints, is_finite
from weberlink.master.devices import LEADERS
from weberlink.slave.robots import FOLLOWERS
from weberlink.testing.contract import FaultContract
from weberlink.testing.time import until

MOVES_RAD = 0.15  # also of a follower that is told to move on by 0.25 rad


@dataclass
class ArmBench:
    """An arm; the first axis of a leader moves by more than `MOVES_RAD`, as its hand or program does."""

    arm: Any  # not open
    tick: Callable[[], float]  # the time of the next tick [s]; waits for it where time is real
    faults: Mapping[str, Callable[[], None]] = field(default_factory=dict)  # none for one that is computed
    torques_on: Callable[[], Sequence[bool]] | None = None  # of the motors of hardware


class _ArmContract:
    """What leaders and followers share."""

    @pytest.fixture
    def bench(self) -> Iterator[ArmBench]:
        """A bench with an arm that is not open; closes the arm at the end."""
        raise NotImplementedError

    def goal(self, first: ArmReading) -> Joints:
        """What makes an arm move, or lets it."""
        raise NotImplementedError

    def test_the_spec_is_there_before_opening(self, bench: ArmBench) -> None:
        spec = bench.arm.spec
        tables: Any = {**LEADERS, **FOLLOWERS}
        assert type(bench.arm) is tables[spec.name], "the name is that of its entry point"
        assert 1 <= len(spec.joints) == len(set(spec.joints)) <= 8
        tuples = (spec.lower, spec.upper, spec.torque_nm, spec.stiffness_nm_rad)
        assert {len(values) for values in tuples} == {spec.axes}
        assert all(low < high for low, high in zip(spec.lower, spec.upper, strict=True))
        assert not spec.gripper or spec.lower[-1] <= 0.0 < spec.upper[-1], "0 is closed"
        assert min(spec.torque_nm) >= 0.0 < min(spec.stiffness_nm_rad)
        assert spec.rate_hz > 0.0 <= min(spec.lag_s, spec.torque_error_nm)
        assert "\n" not in spec.note

    def test_life_of_an_arm(self, bench: ArmBench) -> None:
        arm, tick = bench.arm, bench.tick
        rest = tuple(min(max(0.0, low), high) for low, high in zip(arm.spec.lower, arm.spec.upper, strict=True))
        arm.close()
        for _ in range(2):  # a second session is like the first
            self._is_not_open(bench)
            arm.command(rest, tick())  # no effect
            now = tick()
            arm.open(now)
            first = arm.latest(tick())
            goal = self.goal(first)
            self._moves(bench, goal, first)
            for value in (nan, inf, -inf):
                with pytest.raises(ValueError, match="finite"):
                    arm.command((*goal[:-1], value), tick())
            arm.command(goal, bench.tick())
            arm.close()
            arm.close()
        self._is_not_open(bench)

    def _is_not_open(self, bench: ArmBench) -> None:
        with pytest.raises(ArmFault, match=f"^{bench.arm.spec.name}.* not open"):
            bench.arm.latest(bench.tick())

    def _moves(self, bench: ArmBench, goal: Joints, first: ArmReading) -> None:
        """Follow its readings until the first axis has moved."""
        arm, before = bench.arm, first.at

        def has_moved() -> bool:
            nonlocal before
            arm.command(goal, bench.tick())
            now = bench.tick()
            reading = arm.latest(now)
            assert arm.latest(now) == reading
            assert before <= reading.at <= now
            assert len(reading.angles) == len(reading.torques) == arm.spec.axes
            assert is_finite(reading.angles) and is_finite(reading.torques)
            before = reading.at
            return bool(abs(reading.angles[0] - first.angles[0]) > MOVES_RAD)

        until(has_moved, "the arm to move", pause=0.0)


class LeaderContract(_ArmContract):
    """What every driver of a leader arm keeps. A test class inherits from it, and overrides the fixture `bench`.

    Mark the class `realtime` where the time of its bench is real.
    """

    def goal(self, first: ArmReading) -> Joints:
        return (0.01,) * len(first.angles)


class FollowerContract(_ArmContract):
    """What every driver of a follower arm keeps; see `LeaderContract`."""

    def goal(self, first: ArmReading) -> Joints:
        return (first.angles[0] + 0.25, *first.angles[1:])


class _HardwareArmContract(FaultContract, _ArmContract):
    """What an arm with motors keeps besides: its faults end a session."""

    HOLDS: ClassVar[bool]  # whether the motors have their torque on after a session

    def test_motors_after_a_session(self, bench: ArmBench) -> None:
        bench.arm.open(bench.tick())
        self._moves(bench, self.goal(bench.arm.latest(bench.tick())), bench.arm.latest(bench.tick()))
        bench.arm.close()
        assert bench.torques_on is not None
        assert set(bench.torques_on()) == {self.HOLDS}

    def test_fault_stops_the_arm_with_a_reason(self, fault: str, bench: ArmBench) -> None:
        arm = bench.arm
        arm.open(bench.tick())
        goal = self.goal(arm.latest(bench.tick()))
        bench.faults[fault]()

        def goes_on() -> None:
            arm.command(goal, bench.tick())
            arm.latest(bench.tick())

        with pytest.raises(ArmFault, match=f"^{arm.spec.name}: (?!{arm.spec.name}).{{10,}}") as caught:
            until(goes_on, "the fault", pause=0.0)
        assert "\n" not in str(caught.value)
        with pytest.raises(ArmFault):
            arm.latest(bench.tick())


class HardwareLeaderContract(_HardwareArmContract, LeaderContract):
    """What a leader with motors keeps, before an emulated one: no torque without a session."""

    HOLDS = False


class HardwareFollowerContract(_HardwareArmContract, FollowerContract):
    """What a follower with motors keeps, before an emulated one: it holds itself after a session, unless told so."""

    HOLDS = True
