"""Control schemes in whole systems in virtual time: passive on a bad link, few packets, no trace of a lost session."""

import numpy as np
import pytest

from tests.session.kinds import HAND, Run, changed, run, says
from tests.session.systems import configuration, system
from weberlink.control.contract import CREDIT_STEP
from weberlink.figures.energy import accounts_in
from weberlink.figures.session import Layout, SessionScore
from weberlink.protocol.states import State
from weberlink.session.simulation import Simulation, simulate

BANK = ("zoh", "linear", "plane", "sphere")
ACCOUNTS = accounts_in(configuration().system.model_dump(mode="json"))
BAD_LINK = ("link.emulate.jitter_ms=10", "link.emulate.loss=0.1", "link.emulate.seed=7")
PRESS_AND_TAP = (
    '[{"motion":"rest","duration_s":0.3},'
    '{"motion":"press","at_m":[0,0,0],"approach_s":0.2,"duration_s":0.3,"hold_s":0.4,"height_m":0.005},'
    '{"motion":"tap","at_m":[0,0,0],"approach_s":0.1,"frequency_hz":4.0,"count":4,"height_m":0.005}]'
)


def plane(scheme: str, stiffness: float, round_trip: float) -> tuple[str, ...]:
    """Overrides of a session that presses and taps on a plane."""
    return (
        f"control.scheme={scheme}",
        f"slave.scene=[{{shape: plane, stiffness_n_m: {stiffness}}}]",
        f"link.emulate.delay_ms={500.0 * round_trip}",
        "link.silence_ms=1500",
        "link.longest_round_trip_ms=2000",
        f"master.device.script={PRESS_AND_TAP}",
        "master.device.home_m=[0, 0, 0.005]",
        "slave.robot.home_m=[0, 0, 0.005]",
    )


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


@pytest.mark.parametrize(("round_trip", "fewer"), [(0.1, 0.8), (1.0, 0.9)])
def test_the_network_stays_quiet(round_trip: float, fewer: float) -> None:
    """Of the default scene, at k = 0.10: updates of both channels, and every datagram."""
    far = plane("bounded", 0.0, round_trip)[2:5]
    summary = simulate(configuration(*far, "codec.force.weber=0.10"), 3.5 + 2.0 * round_trip)[0].to_json()
    assert summary["force"]["packets"] > 5
    assert summary["force"]["reduction"] >= fewer
    assert summary["force"]["reduction_all"] >= fewer
    assert summary["position"]["reduction"] >= fewer


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


def test_the_records_of_both_ends_hold_the_credit_that_the_robots_end_has_given() -> None:
    pulled = changed(HAND.robot, says(force=(0.0, 0.0, -3.0)), 0.0)  # the scene gives energy
    ran = run(HAND, 2.4, *plane("bounded", 500.0, 0.02), robot=pulled)
    simulation, master, slave = ran.simulation, ran.master["credit"][-1], ran.slave["credit"][-1]
    assert slave > 1e-4
    assert slave == pytest.approx(CREDIT_STEP * simulation.slave.port.controls[0].credit, rel=1e-6)
    assert master == pytest.approx(CREDIT_STEP * simulation.master.endpoint.credit.known, rel=1e-6)
    assert master == pytest.approx(slave, rel=0.1)
