"""Verdicts on records whose truth is known."""

from collections.abc import Callable
from math import exp, pi, sin

import numpy as np
import pytest

from weberlink.control.contract import AccountParameters
from weberlink.protocol.states import State
from weberlink.telemetry.fault import Fault
from weberlink.telemetry.reader import Records
from weberlink.telemetry.record import DESCRIPTION
from weberlink_studies.frame import Row
from weberlink_studies.stability.cells import SystemCell, timing
from weberlink_studies.stability.verdict import verdict

CELL = SystemCell("a")
WHEN = timing(CELL)
ACCOUNT = AccountParameters(allowance=0.02, refill=0.01, damping=1.0, rise=160.0)
IDEAL = 0.015 * 300.0 * 500.0 / (300.0 + 500.0)
"""Force [N] of a hand of 300 N/m that means to be 15 mm deep in a wall of 500 N/m."""


def records(force: Callable[[float], float]) -> tuple[Records, Records]:
    """Both sides of a session whose operator is given `force` of the time since the hold began; the robot feels 3 N."""
    count = round(WHEN.end / 1e-3)
    master, slave = np.zeros(count, dtype=DESCRIPTION), np.zeros(count, dtype=DESCRIPTION)
    for side in (master, slave):
        side["tick"] = np.arange(count)
        side["at"] = side["tick"] * 1e-3
        side["state"] = State.ENGAGED.value
    holding = (master["at"] >= WHEN.hold) & (master["at"] < WHEN.release)
    master["output"][holding, 2] = [force(at - WHEN.hold) for at in master["at"][holding]]
    slave["raw"][holding, 2] = 3.0
    slave["updates_sent"] = count // 10
    return master, slave


def judge(master: Records, slave: Records, failure: str | None = None, cell: SystemCell = CELL) -> Row:
    return verdict(cell, WHEN, (master, slave), [ACCOUNT], failure)


def test_a_steady_force_has_settled() -> None:
    found = judge(*records(lambda since: 3.0))
    assert found["state"] == "settled"
    assert found["bounded"]
    assert found["peak_force_n"] == found["peak_contact_n"] == 3.0
    assert found["felt_share"] == found["pressed_share"] == pytest.approx(3.0 / IDEAL)
    assert found["saturated"] == []
    assert found["force_reduction"] == pytest.approx(0.9, abs=0.01)


@pytest.mark.parametrize(
    ("rate", "state"), [(-1.0, "decaying"), (-0.01, "oscillating"), (0.0, "oscillating"), (2.0, "growing")]
)
def test_an_oscillation_is_judged_by_its_variance(rate: float, state: str) -> None:
    found = judge(*records(lambda since: 3.0 + 2.0 * exp(rate * since) * sin(2.0 * pi * 10.0 * since)))
    assert found["state"] == state
    assert found["bounded"] is (state == "decaying")
    assert "settle_s" not in found


def test_a_swing_within_the_deadband_is_steady() -> None:
    assert judge(*records(lambda since: 3.0 + 0.3 * sin(60.0 * since)))["state"] == "settled"
    assert judge(*records(lambda since: 3.0 + 0.5 * sin(60.0 * since)))["state"] == "oscillating"


def test_a_hold_that_loses_contact_is_not_settled() -> None:
    """For 3 ms, in the first half; the second one is steady."""
    master, slave = records(lambda since: 3.0 if not 0.5 < since < 0.503 else 0.0)
    assert judge(master, slave)["state"] == "lost"
    assert not judge(master, slave)["bounded"]
    faint = SystemCell("a", stiffness_n_m=1.0)
    assert judge(*records(lambda since: 0.0), cell=faint)["state"] == "settled"
    assert judge(*records(lambda since: 0.0))["state"] == "lost"


def test_energy_counts_from_the_press_on() -> None:
    """20 mJ in before it; since then 5 mJ in, 12 mJ out, 3 mJ in: a session-long sum never gets below 0."""
    master, slave = records(lambda since: 0.0)
    before = int(WHEN.press / 1e-3)
    steps = np.zeros(len(master))
    steps[100:120] = 1e-3
    steps[before + 10 : before + 40] = 1e-3
    master["position"][:, 0] = np.cumsum(steps)
    force = np.zeros(len(master))
    force[98:120] = -1.0
    force[before + 9 : before + 14], force[before + 14 : before + 26] = -1.0, 1.0
    force[before + 26 : before + 29] = -1.0
    master["output"][:, 0] = force
    assert judge(master, slave)["energy_out_j"] == pytest.approx(0.007)


def test_a_share_of_the_bound_is_got_out() -> None:
    """3 mJ are given from 0.2 s on, of 20 mJ and what refill, damping, scene and the work of one tick add."""
    master, slave = records(lambda since: 0.0)
    master["position"][201:204, 0] = 1e-3, 2e-3, 3e-3
    master["position"][204:, 0] = 3e-3
    master["output"][200:203, 0] = 1.0
    master["credit"][1:] = 2e-3
    assert judge(master, slave)["bound_kept"]
    assert judge(master, slave)["bound_share"] == pytest.approx(3.0 / (20.0 + 2.03 + 3.0 + 2.0 + 1.0))
    master["output"][:, 0] = -1.0
    assert judge(master, slave)["bound_share"] == 0.0


def test_a_moving_wall_is_not_judged_by_its_swing() -> None:
    found = judge(*records(lambda since: 3.0 * sin(60.0 * since)), cell=SystemCell("a", wall_speed_m_s=0.1))
    assert found["state"] == "driven"
    assert not {"felt_share", "energy_out_j"} & found.keys()


def test_faults_during_the_hold_fail_the_cell() -> None:
    master, slave = records(lambda since: 3.0)
    master["state"][master["at"] > WHEN.release - 0.1] = State.SILENT.value
    assert judge(master, slave)["state"] == "failed"
    master, slave = records(lambda since: 3.0)
    pressing = int(((master["at"] > WHEN.press) & (master["at"] < WHEN.release)).argmax())
    master["fault"][pressing] = Fault.SILENCE.value
    found = judge(master, slave)
    assert found["failure"] == "faults during the press: silence"
    assert not found["bounded"]
    assert judge(*records(lambda since: 3.0), failure="the device was lost")["state"] == "failed"
    assert judge(master[:200], slave[:200])["failure"] == "ended before the hold"
