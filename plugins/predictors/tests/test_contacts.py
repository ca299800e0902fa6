"""Sessions in which a model states a contact that is none: it is taken back, and no force lasts."""

import numpy as np
import pytest

from tests.safety.test_unfounded import DELAY_S, LINK, check_that_the_hand_is_left
from tests.session.systems import configuration
from tests.slave.test_unreached import check_that_it_takes_the_contact_back
from trials.safety.unfounded import Cell, found, run
from weberlink.cli.shipped import find
from weberlink.control.contract import UNREACHED_S
from weberlink.session.simulation import build_simulation
from weberlink.telemetry.record import TORQUE
from weberlink_figures.session import score_of

DAMPED = "slave.scene=[{shape: plane, stiffness_n_m: 500, damping_n_s_m: 1.0}]"
FORMER = 7
"""A seed with which a force was on the hand for longer before there was the law."""
LONG = 2767
"""One with a round trip that is longer than the silence limit."""
CLAIMED = 832
"""In which a model claimed a contact for some ms that the robot's end then contradicted."""
OTHERS = [pytest.param(each, marks=pytest.mark.hunt) for each in (11, 14, 899)]


@pytest.mark.parametrize("predictor", ["surface", "affine"])
def test_a_robot_that_is_held_back_takes_the_contact_back_in_time(predictor: str) -> None:
    check_that_it_takes_the_contact_back(predictor)


@pytest.mark.parametrize(("predictor", "scheme"), [("surface", "bounded"), ("affine", "none")])
def test_a_robot_that_has_backed_off_leaves_the_hand(predictor: str, scheme: str) -> None:
    check_that_the_hand_is_left(predictor, scheme)


@pytest.mark.parametrize("predictor", ["surface", "adaptive"])
def test_a_damped_wall_that_is_taken_for_a_moving_one_leaves_the_hand(predictor: str) -> None:
    """The damping is fitted as motion, and an extrapolated motion would carry the wall after the hand."""
    overrides = (DAMPED, f"codec.force.predictor={predictor}")
    loaded = configuration(*LINK, *overrides, file=find("scene-plane"))
    score, records = score_of(loaded.system), build_simulation(loaded).advance(4000)
    score.add(*records)
    finding, figures = found(Cell(0, overrides, (DELAY_S, DELAY_S)), *records, 1e-3), score.figures()
    assert finding.contact > 0.3
    assert (finding.ticks, finding.faults) == (0, 0)
    assert figures.energy.bound_share is not None
    assert figures.energy.bound_share < 1.0  # 0.59 J came out when the wall was carried along
    assert figures.limited.force_ticks < 100


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
        np.linalg.norm(each[:, TORQUE], axis=1) > least
        for each, least in ((master["output"], 0.05), (slave["raw"], 0.005))
    )
    assert simulation.slave.faults == {"tripped": 1}
    alone = felt & ~touched & (master["at"] > 3.2)
    assert np.sum(alone) * 1e-3 <= 2.0 * 0.02 + UNREACHED_S + 0.02
    assert np.sum(touched) > 100


@pytest.mark.parametrize("seed", [FORMER, LONG, CLAIMED, *OTHERS])
def test_in_random_sessions_no_force_lasts_without_a_contact(seed: int) -> None:
    """`python -m trials.safety.unfounded` runs more."""
    finding = run(seed)
    assert finding.contact > 0.0
    assert (finding.ticks, finding.rash) == (0, 0)
