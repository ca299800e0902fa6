"""Interrupted sessions of arms in virtual time: torque fades in again, and the follower does not jump."""

from dataclasses import replace
from itertools import pairwise
from math import isfinite, nan
from pathlib import Path
from typing import Any

import pytest

from tests.system.stops import StoppedSide
from tests.system.systems import Step, steps
from weberlink.arms.contract import ArmReading
from weberlink.geometry.joints import Joints
from weberlink.protocol.emulation import EmulatedLink, Emulation
from weberlink.protocol.events import Address
from weberlink.protocol.states import State
from weberlink.system.configuration import load
from weberlink.system.configuration.loading import Part
from weberlink.system.simulate import build_simulation
from weberlink.system.simulation import Simulation
from weberlink.telemetry.fault import Fault
from weberlink.telemetry.record import RELEASED, Record

pytest.importorskip("mujoco", reason="needs mujoco (extra: mujoco)")

from weberlink.master.devices.arm_operator import ArmOperator
from weberlink.slave.robots.mujoco_arm import MujocoArm

TICK = 1e-3
BEGIN = 0.8
"""When something happens [s]: the follower presses on a box by then."""
APPROACH = 0.5
"""Speed of the approach by default [rad/s]."""
AXES = ("1", "2", "3", "4", "5", "gripper")
SESSION = """
rate_hz: 1000
link: {listen: "127.0.0.1:0", slave: "127.0.0.1:0", security: none}
codec:
  joints: {names: [shoulder_pan, shoulder_lift, elbow_flex, wrist_flex, wrist_roll]}
  gripper: {}
master:
  device:
    driver: arm_operator
    model: koch_leader
    script:
      - {motion: move, duration_s: 0.5, joints_rad: [0.1, 0.4, 0.3, 0, 0]}
      - {motion: hold, duration_s: 10}
  joint_mapping: {torque_scale: 0.08, gripper: {follower_rad: [0, 1.7]}}
slave:
  robot:
    driver: mujoco_arm
    model: so101
    objects:
      - {kind: box, position_m: [0.4, 0, 0.1], size_m: [0.2, 0.6, 0.2]}
"""


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("arms") / "arms.yaml"
    path.write_text(SESSION, encoding="utf-8")
    return path


def built(file: Path, *overrides: str, leader: Any = None, follower: Any = None) -> Simulation:
    loaded = load(file, overrides)
    assert loaded.device is not None
    assert loaded.robot is not None
    return build_simulation(
        replace(
            loaded,
            device=Part(leader or loaded.device.driver, loaded.device.options),
            robot=Part(follower or loaded.robot.driver, loaded.robot.options),
        )
    )


def stopped(file: Path, side: str, seconds: float, *overrides: str) -> tuple[Simulation, list[Step]]:
    """A run in contact in which a side's process stands still from `BEGIN` on, over a link of 5 ms each way."""
    whole = built(file, *overrides)
    sides: dict[str, Any] = {"master": whole.master, "slave": whole.slave}
    sides[side] = StoppedSide(sides[side], BEGIN, BEGIN + seconds)
    links = (
        EmulatedLink[Address](Emulation(delay_s=0.005), lambda: 0.0),
        EmulatedLink[Address](Emulation(delay_s=0.005), lambda: 0.0),
    )
    simulation = Simulation(master=sides["master"], slave=sides["slave"], links=links, tick_period=TICK)
    return whole, list(steps(simulation, BEGIN + seconds + 0.4))


def of(record: Record, field: str) -> Joints:
    return tuple(getattr(record, f"joint_{field}_{axis}") for axis in AXES)


def largest(values: Joints) -> float:
    return max(map(abs, values))


def moved(before: Record, after: Record) -> float:
    """Largest change of an axis of what is commanded [rad | N m]."""
    return largest(tuple(b - a for a, b in zip(of(before, "output"), of(after, "output"), strict=True)))


@pytest.mark.parametrize("scheme", ["none", "bounded"])
def test_stall_of_leader_restarts_torque_at_zero_and_follower_slowly(file: Path, scheme: str) -> None:
    whole, run = stopped(file, "master", 0.3, f"control.scheme={scheme}")
    end = round((BEGIN + 0.3) / TICK)
    assert largest(of(run[end - 1].master, "output")) > 0.5
    assert largest(of(run[end].master, "output")) == 0.0
    assert whole.master.faults["stalled"] == 1
    held = run[round(BEGIN / TICK) + 150 : end]
    assert {of(step.slave, "output") for step in held} == {of(held[0].slave, "output")}
    approach = [moved(a.slave, b.slave) for a, b in pairwise(run[end - 1 : end + 20])]
    assert 0.0 < max(approach) <= APPROACH * TICK * (1 + 1e-4)
    assert run[-1].master.state == run[-1].slave.state == State.ENGAGED.value
    assert largest(of(run[-1].master, "output")) > 0.2, "it works again"


def test_silence_of_follower_ends_torque_before_its_limit(file: Path) -> None:
    whole, run = stopped(file, "slave", 0.3)
    begin, end = round(BEGIN / TICK), round((BEGIN + 0.3) / TICK)
    assert largest(of(run[begin].master, "output")) > 0.5
    assert max(largest(of(step.master, "output")) for step in run[begin + 100 : end]) == 0.0
    fade = [moved(a.master, b.master) for a, b in pairwise(run[begin:end])]
    assert max(fade) < 0.2 * largest(of(run[begin].master, "output"))
    assert whole.slave.faults["stalled"] == 1
    assert moved(run[end - 1].slave, run[end].slave) <= 1e-3, "it holds, as deep as it may press where it is now"
    assert max(moved(a.slave, b.slave) for a, b in pairwise(run[end - 1 : end + 50])) <= APPROACH * TICK * (1 + 1e-4)
    first = next(step for step in run[end:] if step.slave.sent)
    assert largest(of(first.slave, "raw")) < 0.2
    assert largest(of(run[-1].slave, "raw")) > 0.5


class WithButton(ArmOperator):
    """A leader with two buttons, of which the second is released for a while."""

    def __init__(self, options: Any, tick_period: float) -> None:
        super().__init__(options, tick_period)
        self.spec = replace(self.spec, buttons=2)

    def latest(self, now: float) -> ArmReading:
        return super().latest(now)._replace(buttons=0 if BEGIN <= now < BEGIN + 0.2 else 2)


def test_released_button_holds_follower_and_removes_torque(file: Path) -> None:
    run = list(steps(built(file, "master.engage.button=1", leader=WithButton), BEGIN + 0.5))
    begin, end = round(BEGIN / TICK), round((BEGIN + 0.2) / TICK)
    released = run[begin + 60 : end]
    assert {largest(of(step.master, "output")) for step in released} == {0.0}
    assert {of(step.slave, "output") for step in released} == {of(released[0].slave, "output")}
    assert {step.master.ramping for step in released} == {step.slave.ramping for step in released} == {RELEASED}
    assert largest(of(run[-1].master, "output")) > 0.3  # the account returns within what the hand presses


class Overloaded(MujocoArm):
    """A follower whose second joint is pushed up too hard for a while."""

    def latest(self, now: float) -> ArmReading:
        reading = super().latest(now)
        if BEGIN <= now < BEGIN + 0.01:
            return reading._replace(torques=(0.0, -5.0, *reading.torques[2:]))
        return reading


def test_torque_above_the_limit_trips_the_follower(file: Path) -> None:
    simulation = built(file, follower=Overloaded)
    run = list(steps(simulation, BEGIN + 0.3))
    assert simulation.slave.faults["tripped"] == 1
    assert run[-1].slave.fault == Fault.TRIPPED
    assert largest(of(run[-1].master, "output")) < 0.03, "within the deadband of no torque"
    begin = round(BEGIN / TICK)
    assert max(moved(a.slave, b.slave) for a, b in pairwise(run[begin:])) <= APPROACH * TICK * (1 + 1e-4)
    assert of(run[-1].slave, "output")[1] < of(run[begin - 1].slave, "output")[1]


class Failing(MujocoArm):
    """A follower that reports no numbers from `BEGIN` on."""

    def latest(self, now: float) -> ArmReading:
        reading = super().latest(now)
        return reading if now < BEGIN else reading._replace(angles=(*reading.angles[:-1], nan))


class Lost(ArmOperator):
    """A leader that reports no numbers from `BEGIN` on."""

    def latest(self, now: float) -> ArmReading:
        reading = super().latest(now)
        return reading if now < BEGIN else reading._replace(angles=(nan, *reading.angles[1:]))


@pytest.mark.parametrize(("parts", "side"), [({"follower": Failing}, "slave"), ({"leader": Lost}, "master")])
def test_angles_that_are_no_numbers_end_the_session_safely(file: Path, parts: dict[str, Any], side: str) -> None:
    simulation = built(file, **parts)
    run = list(steps(simulation, BEGIN + 0.2))
    failure = getattr(simulation, side).failure
    assert "reports the angles" in failure
    assert "nan" in failure
    for step in run:
        for record in (step.master, step.slave):
            assert all(map(isfinite, of(record, "output") + of(record, "raw")))
    assert largest(of(run[-1].master, "output")) == 0.0
    held = run[round(BEGIN / TICK) + 150 :]
    assert len({of(step.slave, "output") for step in held}) <= 1
