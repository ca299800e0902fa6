"""The control loop in virtual time: where the arm goes, what it presses with, and when it stops."""

from math import inf

import pytest

from tests.slave.robots.franka.library import HOME
from tests.slave.robots.franka.loop_bench import LoopBench
from weberlink.geometry.rotation import quaternion
from weberlink.geometry.vector import Vector, norm
from weberlink.slave.robots.franka.goal import REST_RAD_S
from weberlink.slave.robots.franka.impedance import HIGHEST, TORQUE_STEP_N_M
from weberlink.slave.robots.franka.messages import Phase
from weberlink.slave.robots.franka.sensing import SensingError

START: Vector = (0.5, 0.0, 0.45)
ASIDE: Vector = (0.5, 0.2, 0.45)
GROUND = "arm,ground=0.44"
BELOW: Vector = (0.5, 0.0, 0.41)


@pytest.mark.parametrize("goal", [ASIDE, (0.5, 5.0, 0.45)])
def test_tip_follows_slowly_and_arrives_within_the_workspace(goal: Vector) -> None:
    bench, fastest = LoopBench(approach_m_s=0.3), 0.0
    for _ in range(2000):
        bench.lead(goal, 0.001)
        fastest = max(fastest, abs(bench.arm.dq[1]))
    assert bench.state.position[1] == pytest.approx(min(goal[1], 0.30), abs=2e-3)
    assert 0.15 < fastest < 0.36
    assert bench.largest_step <= TORQUE_STEP_N_M + 1e-9


@pytest.mark.parametrize(("deep", "most"), [(BELOW, 30.0), ((0.5, 0.0, 0.15), 5.0)])
def test_contact_force_is_that_of_the_spring_up_to_its_limit(deep: Vector, most: float) -> None:
    bench = LoopBench(f"{GROUND},offset=2", stiffness_n_m=600.0, approach_m_s=0.5, force_n=most)
    assert norm(bench.state.force) < 1e-9
    state = bench.lead(deep, 3.0)
    assert state.force[2] == pytest.approx(min(most, 600.0 * (state.position[2] - deep[2])), rel=0.02)


def test_arm_without_commands_stops_without_turning_back() -> None:
    bench = LoopBench(approach_m_s=0.5)
    bench.lead(ASIDE, 0.35)
    places = [bench.cycle().position[1] for _ in range(1500)]
    assert bench.state.joint_speed < REST_RAD_S
    assert places[-1] < ASIDE[1] - 0.03
    assert max(places) - places[-1] < 0.002


def test_pressed_contact_is_released_without_commands() -> None:
    bench = LoopBench(GROUND, approach_m_s=0.5)
    pressed = bench.lead(BELOW, 1.5).force[2]
    assert pressed > 8.0
    assert bench.wait(1.0).force[2] < 0.3 * pressed


def test_pause_of_the_loop_stops_the_arm() -> None:
    bench = LoopBench(approach_m_s=0.5)
    bench.lead(ASIDE, 0.35)
    bench.cycle(0.1)
    assert bench.wait(1.0, lambda: bench.state.joint_speed < REST_RAD_S).joint_speed < REST_RAD_S
    assert bench.loop.pace().startswith("99 of ")


def test_commands_that_go_on_during_a_pause_of_the_loop_are_approached_anew() -> None:
    """The pause was the loop's alone: no command is stale."""
    fastest = []
    for pause in (0.001, 0.1):
        bench = LoopBench(approach_m_s=0.2)
        bench.lead(ASIDE, 1.5)
        bench.cycle(pause, START)
        fastest.append(max(bench.lead(START, 0.001).joint_speed for _ in range(100)))
    assert fastest[1] < 0.5 * fastest[0]


@pytest.mark.parametrize("way", ["order", "orphan"])
def test_end_leaves_the_arm_at_rest(way: str) -> None:
    bench = LoopBench(approach_m_s=0.5)
    bench.lead(ASIDE, 0.35)
    assert bench.state.joint_speed > 0.2
    bench.orphaned = way == "orphan"
    if way == "order":
        bench.command(START, ends=True)
    state = bench.wait(1.1, lambda: bench.loop.finished)
    assert bench.loop.finished
    assert (state.phase, state.joint_speed < REST_RAD_S) == (Phase.ENDED, True)


def test_tool_turns_to_commanded_orientation() -> None:
    bench = LoopBench(approach_rad_s=1.0)
    bench.lead(START, 2.0, quaternion((0.0, 0.3, 0.0)))
    assert bench.arm.q[4] - HOME[4] == pytest.approx(0.3, abs=2e-3)
    assert bench.largest_step <= TORQUE_STEP_N_M + 1e-9


def test_joint_is_held_before_its_limit() -> None:
    bench = LoopBench(turning_n_m=6.0, approach_rad_s=2.0)
    bench.lead(START, 3.0, quaternion((3.0, 0.0, 0.0)))
    assert HIGHEST[3] - 0.12 < bench.arm.q[3] < HIGHEST[3]


@pytest.mark.parametrize(
    ("scenario", "offset", "goal", "says"),
    [
        ("arm,offset=8", 8.0, START, r"8\.0 N at rest"),
        (f"{GROUND},reversed", 0.0, BELOW, "the same way"),
        ("arm,offset=2", 0.0, START, "singularity"),
        ("arm", inf, START, "not finite"),
    ],
)
def test_force_that_cannot_be_trusted_is_named(scenario: str, offset: float, goal: Vector, says: str) -> None:
    with pytest.raises(SensingError, match=says):
        bench = LoopBench(scenario, approach_m_s=0.5)
        bench.arm.offset = offset
        bench.lead(goal, 3.0)
