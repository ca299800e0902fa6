"""A link that fails in one direction stops both ends: a short selection of the cases of `make safety`."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tests.safety.cases import (
    BOTH,
    CUT,
    DELAYS_S,
    DIRECTIONS,
    FLAPS_HZ,
    MOTIONS,
    PREDICTION,
    SCHEMES,
    Case,
    every,
    selection,
)
from tests.safety.observed_link import ObservedLink, loop_ages
from tests.safety.run import Figures, measure, run, violated
from tests.system.systems import configuration, steps, system
from weberlink.protocol.emulation import Emulation
from weberlink.protocol.states import State
from weberlink.telemetry.fault import Fault
from weberlink.telemetry.reader import DTYPE

QUICK = 5
"""One case in so many is run without `--hunt`."""
CASE = Case("press", BOTH)
SAFE = Figures(
    robot_ms=61.0,
    force_ms=95.0,
    robot_age_ms=70.0,
    force_age_ms=98.0,
    beyond_mm=2.0,
    allowed_mm=40.0,
    retreat_mm=(0.0, 0.0),
    hand_n=5.0,
    robot_n=8.0,
    step_n=0.2,
    early_n=0.0,
    step_mm=0.25,
    fault_ms=(99.0, 100.0),
    faults=(("SILENCE",), ("SILENCE",)),
    returned=True,
    round_trip_ms=0.0,
)


@pytest.mark.parametrize(
    "case",
    [
        pytest.param(
            case,
            id=f"{case.fault}, {case.scheme}, {case.force}, {case.motion}",
            marks=[pytest.mark.hunt] if index % QUICK else [],
        )
        for index, case in enumerate(selection())
    ],
)
def test_no_law_is_broken(case: Case) -> None:
    assert run(case).violations == ()


def test_selection_covers_every_value_of_each_factor() -> None:
    chosen = selection()
    assert {case.direction for case in chosen} == set(DIRECTIONS)
    assert {case.flap_hz for case in chosen} == {0.0, *FLAPS_HZ}
    assert {case.scheme for case in chosen} == set(SCHEMES)
    assert {case.motion for case in chosen} == set(MOTIONS)
    assert {(case.force, case.position) for case in chosen} == set(PREDICTION)
    assert {case.delay_s for case in chosen} >= {(delay, delay) for delay in DELAYS_S}
    assert {case.retract for case in chosen} == {True, False}
    assert set(chosen) <= set(every())


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"robot_age_ms": 110.0}, "the robot moved at a loop age of 110 ms"),
        ({"force_age_ms": 110.0}, "force was on the hand at a loop age of 110 ms"),
        ({"robot_ms": 599.0}, "the robot moved after the cut for 599 ms"),
        ({"force_ms": 409.0}, "force was on the hand after the cut for 409 ms"),
        ({"beyond_mm": 46.8}, "46.8 mm beyond the hand"),
        ({"hand_n": 10.1}, "10.10 N on the hand"),
        ({"returned": False}, "no session once the link was good again"),
        ({"fault_ms": (None, 100.0)}, "the master names no fault"),
        ({"fault_ms": (99.0, 300.0)}, "the slave names a fault after 300 ms only"),
        ({"step_n": 3.5}, "the force changed by 3.50 N in a tick, 3.00 N allowed"),
        ({"early_n": 0.4}, "the force came back 0.40 N above its ramp"),
        ({"step_mm": 2.0}, "the robot came back by 2.00 mm in a tick"),
    ],
)
def test_each_law_can_be_broken(changes: dict[str, Any], told: str) -> None:
    loaded = configuration()
    assert violated(CASE, SAFE, loaded) == []
    (found,) = violated(CASE, replace(SAFE, **changes), loaded)
    assert told in found


def test_retreat_too_far_or_sideways_is_found() -> None:
    retracting, loaded = replace(CASE, retract=True), configuration()
    assert violated(retracting, replace(SAFE, retreat_mm=(10.0, 0.0)), loaded) == []
    for retreat in ((12.0, 0.0), (10.0, 3.0)):
        (found,) = violated(retracting, replace(SAFE, retreat_mm=retreat), loaded)
        assert "the robot backed off" in found


def test_figures_are_those_of_the_records() -> None:
    """Hand and robot go on for 0.3 s after the cut, the robot at twice the speed; the force stays for 0.2 s."""
    at = np.arange(0, 2700) * 1e-3
    master, slave = np.zeros(2700, DTYPE), np.zeros(2700, DTYPE)
    for records in (master, slave):
        records["at"], records["state"] = at, State.ENGAGED.value
    going = np.clip(at - CUT, 0.0, 0.3 - 0.5e-3)
    master["position"][:, 0] = 0.1 * going
    slave["output"][:, 0] = 0.2 * going
    master["output"][at < CUT + 0.2 - 0.5e-3, 2] = 4.0
    slave["fault"][at > CUT + 0.1] = Fault.SILENCE
    links = ObservedLink(Emulation()), ObservedLink(Emulation())
    for link in links:  # a datagram in every tick until the cut
        link.arrivals += [(float(now), float(now)) for now in at[at < CUT]]
    figures = measure(CASE, master, slave, *links, agreed=0.0, loaded=configuration())
    assert figures.robot_ms == pytest.approx(300.0, abs=1.5)
    assert figures.force_ms == pytest.approx(199.0, abs=1.5)
    assert figures.robot_age_ms == pytest.approx(301.0, abs=1.5)
    assert figures.force_age_ms == pytest.approx(200.0, abs=1.5)
    assert figures.beyond_mm == pytest.approx(30.0, abs=1.5)
    assert figures.allowed_mm == pytest.approx(10.0, abs=0.1)
    assert (figures.hand_n, figures.faults, figures.returned) == (4.0, ((), ("SILENCE",)), True)
    assert figures.fault_ms[0] is None
    assert figures.fault_ms[1] == pytest.approx(101.0, abs=1.0)


def test_observed_link_records_ages_of_executed_updates() -> None:
    link = ObservedLink(Emulation(delay_s=0.01), hold=lambda at: 0.5 if at == 1.0 else None)
    executed = [0]
    link.executed = lambda: executed[0]
    for now in (0.999, 1.0, 1.0005):
        link.send(b"x", ("there", 1), now)
    assert link.next_due() == pytest.approx(1.009)
    assert link.receive(1.009) == [(b"x", ("there", 1))]
    executed[0] += 1
    assert link.receive(1.3) == [(b"x", ("there", 1))]
    assert link.receive(1.3) == []
    assert link.next_due() == 1.5
    assert len(link.receive(1.5)) == 1
    executed[0] += 1
    link.settle()
    assert link.executions == pytest.approx([0.01, 0.5])
    assert [departure for _, departure in link.arrivals] == [0.999, 1.0005, 1.0]


def test_loop_age_counts_both_directions() -> None:
    outward, inward = ObservedLink(), ObservedLink()
    outward.arrivals = [(1.02, 1.0), (1.03, 1.01)]
    inward.arrivals = [(1.035, 1.025)]  # left when the peer had heard the first one only
    ages = loop_ages(outward, inward, np.array([1.03, 1.035, 1.2]))
    assert ages == pytest.approx([np.inf, 0.035, 0.2])


@pytest.mark.parametrize(("key", "losing"), [("to_slave", "slave"), ("to_master", "master")])
def test_a_file_can_ask_for_faults_of_one_direction(key: str, losing: str) -> None:
    simulated = system(f"link.emulate={{delay_ms: 1, {key}: {{loss: 0.2}}, seed: 3}}")
    for _ in steps(simulated, 1.5):
        pass
    sides = {"master": simulated.master, "slave": simulated.slave}
    assert [name for name, side in sides.items() if side.endpoint.statistics.lost > 0] == [losing]
