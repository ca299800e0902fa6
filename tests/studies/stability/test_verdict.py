"""Verdicts on records whose truth is known."""

from collections.abc import Callable
from math import exp, pi, sin

import numpy as np
import pytest

from weberlink.protocol.states import State
from weberlink.studies.stability.cells import SystemCell, timing
from weberlink.studies.stability.verdict import CellObserver, CellVerdict
from weberlink.system.scoring.session import Records
from weberlink.telemetry.fault import Fault
from weberlink.telemetry.record import DESCRIPTION

CELL = SystemCell("a")
WHEN = timing(CELL)
ENERGY: dict[str, float | None] = {"generated_j": 0.5, "link_generated_j": 0.25}


def records(force: Callable[[float], float]) -> tuple[Records, Records]:
    """Both sides of a session whose operator is given `force` of the time since the hold began; the robot feels 3 N."""
    count = round(WHEN.end / 1e-3)
    master, slave = np.zeros(count, dtype=DESCRIPTION), np.zeros(count, dtype=DESCRIPTION)
    for side in (master, slave):
        side["at"] = np.arange(count) * 1e-3
        side["state"] = State.ENGAGED.value
    holding = (master["at"] >= WHEN.hold) & (master["at"] < WHEN.release)
    master["output"][holding, 2] = [force(at - WHEN.hold) for at in master["at"][holding]]
    slave["raw"][holding, 2] = 3.0
    slave["updates_sent"] = count // 10
    return master, slave


def judge(master: Records, slave: Records, failure: str | None = None) -> CellVerdict:
    observer = CellObserver()
    for begin in range(0, len(master), 700):
        observer.add(master[begin : begin + 700], slave[begin : begin + 700])
    return observer.verdict(CELL, WHEN, ENERGY, failure)


def test_a_steady_force_has_settled() -> None:
    verdict = judge(*records(lambda since: 3.0))
    assert verdict.state == "settled"
    assert verdict.bounded
    assert verdict.energy_generated_j == 0.5
    assert verdict.peak_force_n == 3.0
    assert verdict.felt_share == pytest.approx(1.0)
    assert verdict.force_reduction == pytest.approx(0.9, abs=0.01)


@pytest.mark.parametrize(
    ("rate", "state"), [(-1.0, "decaying"), (-0.01, "oscillating"), (0.0, "oscillating"), (2.0, "growing")]
)
def test_an_oscillation_is_judged_by_its_variance(rate: float, state: str) -> None:
    verdict = judge(*records(lambda since: 3.0 + 2.0 * exp(rate * since) * sin(2.0 * pi * 10.0 * since)))
    assert verdict.state == state
    assert verdict.bounded is (state == "decaying")
    assert verdict.settle_s is None


def test_a_swing_within_the_deadband_is_steady() -> None:
    assert judge(*records(lambda since: 3.0 + 0.3 * sin(60.0 * since))).state == "settled"
    assert judge(*records(lambda since: 3.0 + 0.5 * sin(60.0 * since))).state == "oscillating"


def test_a_limited_force_is_not_decaying() -> None:
    master, slave = records(lambda since: 3.0 + 2.0 * exp(-1.0 * since) * sin(60.0 * since))
    master["clipped"][master["at"] > WHEN.release - 0.1] = 1
    assert judge(master, slave).state == "oscillating"


def test_settling_counts_from_the_press() -> None:
    verdict = judge(*records(lambda since: 3.0 * (1.0 - exp(-since / 0.1))))
    # The force stays within 10 % after 0.1 s x ln 10 of the hold.
    assert verdict.settle_s == pytest.approx(WHEN.hold - WHEN.press + 0.230, abs=0.003)


def test_faults_during_the_hold_fail_the_cell() -> None:
    master, slave = records(lambda since: 3.0)
    master["state"][master["at"] > WHEN.release - 0.1] = State.SILENT.value
    assert judge(master, slave).state == "failed"
    master, slave = records(lambda since: 3.0)
    pressing = int(((master["at"] > WHEN.press) & (master["at"] < WHEN.release)).argmax())
    master["fault"][pressing] = Fault.SILENCE.value
    verdict = judge(master, slave)
    assert verdict.failure == "faults during the press: silence"
    assert not verdict.bounded
    assert judge(*records(lambda since: 3.0), failure="the device was lost").state == "failed"
    assert judge(master[:200], slave[:200]).failure == "ended before the hold"
