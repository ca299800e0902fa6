"""The energy out of the hand in whole sessions in virtual time: bounded on a bad link, and after a lost session."""

import numpy as np
import pytest

from tests.session.kinds import HAND, Run, run
from tests.session.systems import configuration, system
from tests.session.test_control import plane
from weberlink.protocol.states import State
from weberlink.session.simulation import Simulation
from weberlink_figures.energy import accounts_in
from weberlink_figures.session import Layout, SessionScore

BANK = ("zoh", "linear", "plane", "sphere")
ACCOUNTS = accounts_in(configuration().system.model_dump(mode="json"))
BAD_LINK = ("link.emulate.jitter_ms=10", "link.emulate.loss=0.1", "link.emulate.seed=7")


def bound_share(ran: Run) -> float:
    """The largest share of what the account of the default settings allows out of the hand that came out."""
    score = SessionScore(Layout.hand(1000.0, BANK, accounts=ACCOUNTS))
    score.add(ran.master, ran.slave)
    return score.figures().energy.bound_share or 0.0


@pytest.mark.parametrize(("round_trip", "stiffness"), [(0.005, 500.0), (0.1, 500.0), (0.1, 1e6), (0.7, 1e6)])
def test_on_a_bad_link_the_hand_gets_no_more_energy_than_its_bound(round_trip: float, stiffness: float) -> None:
    ran = run(HAND, 2.4 + 2.0 * round_trip, *plane("bounded", stiffness, round_trip), *BAD_LINK)
    assert bound_share(ran) <= 1.0
    assert 1.0 < np.linalg.norm(ran.master["output"], axis=1).max() <= 10.0 * (1 + 1e-9)
    assert np.linalg.norm(ran.slave["raw"], axis=1).max() > 1.0


def test_without_control_a_delay_of_100_ms_gives_more_energy_out() -> None:
    """Or the test above could not fail."""
    assert bound_share(run(HAND, 2.6, *plane("none", 500.0, 0.1))) > 1.0


def test_a_silence_outlasted_in_the_session_keeps_the_bound() -> None:
    """The blackout falls into the press; both sides go on with what they had."""
    cut = ("link.silence_ms=200", "link.emulate.blackouts_s=[[0.8, 0.6]]")
    ran = run(HAND, 3.0, *plane("bounded", 500.0, 0.04), *cut)
    states = ran.master["state"]
    assert (states == State.SILENT.value).any() and states[-500] == State.ENGAGED.value
    assert np.abs(ran.master["output"]).max() > 1.0
    assert bound_share(ran) <= 1.0


def test_a_session_lost_and_begun_anew_starts_with_the_allowance_and_keeps_the_bound() -> None:
    """The slave is built anew, as after a crash of its host; the master finds it by itself."""
    settings = *plane("bounded", 500.0, 0.04), "link.silence_ms=200"

    def restart(simulation: Simulation) -> None:
        simulation.slave = system(*settings).slave
        simulation.slave.open(1.0)

    ran = run(HAND, 3.4, *settings, acts={1.0: restart})
    states = ran.master["state"].tolist()
    begun = states.index(State.ENGAGED.value, states.index(State.SILENT.value))
    assert begun > 1000
    assert states[-1] == State.ENGAGED.value
    assert ran.master["energy"][begun] == pytest.approx(ACCOUNTS[0].allowance, rel=0.01)
    assert bound_share(ran) <= 1.0
