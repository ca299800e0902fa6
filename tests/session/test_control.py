"""Control schemes in whole systems in virtual time: few packets, and the credit of the robot's end in the records."""

import numpy as np
import pytest

from tests.session.kinds import FORCE, HAND, changed, run, says
from weberlink.control.contract import CREDIT_STEP, LEAST_CONTACT
from weberlink.protocol.states import State
from weberlink.telemetry.reader import Records

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


@pytest.mark.parametrize("round_trip", [0.0, 0.01, 0.1])
@pytest.mark.parametrize(("stiffness", "within"), [(500.0, 0.07), (1e4, 0.15)])
def test_the_wall_is_felt_and_pressed_on_alike(stiffness: float, within: float, round_trip: float) -> None:
    """A control that displays no force at all would be passive too. A hard wall is tapped on gently at first."""
    fine = ("codec.force.predictor=zoh", "codec.force.weber=0.02")
    ran = run(HAND, 3.5 + 2.0 * round_trip, *plane("bounded", stiffness, round_trip), *fine)
    felt, pressed = (np.linalg.norm(forces, axis=1) for forces in (FORCE.output(ran.master), FORCE.raw(ran.slave)))
    assert felt.sum() / pressed.sum() == pytest.approx(1.0, abs=within)
    assert felt.max() >= 3.0


@pytest.mark.parametrize("round_trip", [0.02, 0.04, 0.1])
def test_a_light_hand_does_not_bounce_off_a_hard_wall_that_it_feels_late(round_trip: float) -> None:
    """A press and four taps, each of which begins and ends once: without damping of the contact up to 23 more."""
    hand = "master.device.hand={mass_kg: 0.1, stiffness_n_m: 100, damping_n_s_m: 3}"
    ran = run(HAND, 3.5 + 2.0 * round_trip, *plane("bounded", 2500.0, round_trip), hand)
    touches = np.linalg.norm(FORCE.raw(ran.slave), axis=1) > LEAST_CONTACT
    assert np.count_nonzero(np.diff(touches)) <= 20


@pytest.mark.parametrize(("round_trip", "fewer"), [(0.1, 0.8), (1.0, 0.9)])
def test_the_network_stays_quiet(round_trip: float, fewer: float) -> None:
    """Of the default scene, at k = 0.10: updates of both channels, and every datagram of the robot's end."""
    far = plane("bounded", 0.0, round_trip)[2:5]
    ran = run(HAND, 3.5 + 2.0 * round_trip, *far, "codec.force.weber=0.10")

    def reduction(records: Records, counter: str) -> float:
        return 1.0 - int(records[counter][-1]) / int((records["state"] == State.ENGAGED.value).sum())

    assert ran.slave["updates_sent"][-1] > 5
    assert reduction(ran.slave, "updates_sent") >= fewer
    assert reduction(ran.slave, "datagrams_sent") >= fewer
    assert reduction(ran.master, "updates_sent") >= fewer


def test_the_records_of_both_ends_hold_the_credit_that_the_robots_end_has_given() -> None:
    pulled = changed(HAND.robot, says(force=(0.0, 0.0, -3.0)), 0.0)  # the scene gives energy
    ran = run(HAND, 2.4, *plane("bounded", 500.0, 0.02), robot=pulled)
    simulation, master, slave = ran.simulation, ran.master["credit"][-1], ran.slave["credit"][-1]
    assert slave > 1e-4
    assert slave == pytest.approx(CREDIT_STEP * simulation.slave.port.controls[0].credit, rel=1e-6)
    assert master == pytest.approx(CREDIT_STEP * simulation.master.endpoint.credit.known, rel=1e-6)
    assert master == pytest.approx(slave, rel=0.1)
