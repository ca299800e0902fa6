"""No force without a contact, in whole sessions: what was reported, robots that are held back, and random ones."""

from typing import Any

import numpy as np
import pytest

from tests.session.systems import configuration
from trials.safety.unfounded import Cell, Finding, found, run
from weberlink.figures.session import score_of
from weberlink.session.channels import UNREACHED_S
from weberlink.session.simulation import build_simulation
from weberlink.telemetry.fault import Fault

DELAY_S = 0.05
LINK = ("link.emulate={delay_ms: 50, seed: 0}",)
DAMPED = "slave.scene=[{shape: plane, stiffness_n_m: 500, damping_n_s_m: 1.0}]"
FORMER = 7
"""A seed with which a force was on the hand for longer before there was the law."""
LONG = 2767
"""One with a round trip that is longer than the silence limit."""
CLAIMED = 832
"""In which a model claimed a contact for some ms that the robot's end then contradicted."""
OTHERS = [pytest.param(each, marks=pytest.mark.hunt) for each in (11, 14, 899)]


def session(*overrides: str, file: str = "loopback.yaml", seconds: float = 4.0) -> tuple[Finding, dict[str, Any]]:
    """What a session showed, and its report."""
    loaded = configuration(*LINK, *overrides, file=file)
    period, score = loaded.system.tick_period, score_of(loaded.system)
    master, slave = build_simulation(loaded).advance(round(seconds / period))
    score.add(master, slave)
    return found(Cell(0, overrides, (DELAY_S, DELAY_S)), master, slave, period), score.figures().to_json()


@pytest.mark.parametrize("predictor", ["surface", "adaptive"])
def test_a_damped_wall_that_is_taken_for_a_moving_one_leaves_the_hand(predictor: str) -> None:
    """The damping is fitted as motion, and an extrapolated motion would carry the wall after the hand."""
    overrides = (DAMPED, f"codec.force.predictor={predictor}")
    finding, summary = session(*overrides, file="scene-plane.yaml", seconds=4.0)
    assert finding.contact > 0.3
    assert (finding.ticks, finding.faults) == (0, 0)
    assert summary["energy"]["bound_share"] < 1.0  # 0.59 J came out when the wall was carried along
    assert summary["limited"]["force_ticks"] < 100


PRESS = "master.device.script=[{motion: press, at_m: [-0.01, 0, 0], depth_m: 0.03, hold_s: 3, duration_s: 0.4}]"


@pytest.mark.parametrize(
    ("predictor", "scheme"), [("zoh", "none"), ("plane", "bounded"), ("surface", "bounded"), ("affine", "none")]
)
def test_a_robot_that_has_backed_off_leaves_the_hand(predictor: str, scheme: str) -> None:
    """It touches nothing and its model states nothing there, while the hand presses on the same model."""
    asked = (f"codec.force.predictor={predictor}", f"control.scheme={scheme}")
    finding, _ = session(PRESS, "slave.limits.trip_n=4", *asked, seconds=2.0)
    assert 0.0 < finding.contact < 0.2
    assert (finding.ticks, finding.faults) == (0, 0)


STICK = (
    "master.device.script=[{motion: reach, to_m: [-0.01, -0.05, 0.025], turn_deg: [0, 20, 0], duration_s: 0.6},"
    " {motion: reach, to_m: [-0.01, -0.05, 0.002], duration_s: 0.5},"  # one end presses: its torque is learned
    " {motion: turn, turn_deg: [0, 14, 0], duration_s: 0.4}, {motion: turn, turn_deg: [0, 20, 0], duration_s: 0.4},"
    " {motion: turn, turn_deg: [0, 8, 0], duration_s: 0.6}, {motion: turn, turn_deg: [0, 0, 0], duration_s: 0.3},"
    " {motion: reach, to_m: [-0.01, -0.05, -0.03], duration_s: 0.3},"  # both ends press, until the robot backs off
    " {motion: rest, duration_s: 0.4}, {motion: turn, turn_deg: [0, 30, 0], duration_s: 0.5},"
    " {motion: rest, duration_s: 3}]"
)


def test_a_tool_that_does_not_turn_leaves_the_hand() -> None:
    """The robot has backed off and holds its tool, while the hand turns to where the model states a torque."""
    link = ("link.emulate={delay_ms: 20, seed: 0}",)
    overrides = ("codec.rotation.torque.predictor=affine", "slave.limits.trip_n=6", *link, STICK)
    simulation = build_simulation(configuration(*overrides, file="rotation.yaml"))
    master, slave = simulation.advance(5000)
    felt, touched = (
        np.linalg.norm(each, axis=1) > least
        for each, least in ((master["rotation_output"], 0.05), (slave["rotation_raw"], 0.005))
    )
    assert simulation.slave.faults == {"tripped": 1}
    alone = felt & ~touched & (master["at"] > 3.2)
    assert np.sum(alone) * 1e-3 <= 2.0 * 0.02 + UNREACHED_S + 0.02
    assert np.sum(touched) > 100


@pytest.mark.parametrize(("scheme", "delay_ms"), [("none", 250), ("bounded", 0)])
def test_a_clean_session_is_never_at_fault(scheme: str, delay_ms: int) -> None:
    loaded = configuration(
        f"control.scheme={scheme}",
        f"link.emulate={{delay_ms: {delay_ms}, jitter_ms: 5, loss: 0.02, seed: 1}}",
        f"link.longest_round_trip_ms={4 * delay_ms + 400}",
    )
    simulation = build_simulation(loaded)
    master, _ = simulation.advance(4000)
    assert Fault.UNFOUNDED not in set(master["fault"])
    assert np.abs(master["output"][:, 2]).max() > 1.0


def test_a_lost_correction_of_a_model_leaves_the_hand_as_soon_as_one_that_comes() -> None:
    """The model of one bump claims a contact above the others, and the first loss of all takes the update that says
    so. Nothing else comes while the robot's end waits for its acknowledgement: a force lasted for 421 ms."""
    link = "link.emulate={delay_ms: 100, jitter_ms: 5, loss: 0.05, burst: 3, seed: 6}"
    loaded = configuration(link, "link.silence_ms=637", file="scene-height-field.yaml")
    period = loaded.system.tick_period
    cell = Cell(6, (), (0.1, 0.1), jitter_s=0.005)
    finding = found(cell, *build_simulation(loaded).advance(round(5.6 / period)), period)
    assert (finding.ticks, finding.faults) == (0, 0)


@pytest.mark.parametrize("seed", [FORMER, LONG, CLAIMED, *OTHERS])
def test_in_random_sessions_no_force_lasts_without_a_contact(seed: int) -> None:
    """`python -m trials.safety.unfounded` runs more."""
    finding = run(seed)
    assert finding.contact > 0.0
    assert (finding.ticks, finding.rash) == (0, 0)
