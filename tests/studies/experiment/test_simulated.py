"""The rule of the simulated subject, and the felt error that it looks at, on records made by hand."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.studies.experiment.studies import plan
from weberlink.protocol.states import State
from weberlink.studies.experiment.conduct import Conduct, ConductError, Elapsed, Felt, Trial
from weberlink.studies.experiment.ledger import Ledger, read
from weberlink.studies.experiment.scale import REFERENCES
from weberlink.studies.experiment.simulated import FELT, THRESHOLD, SimulatedSubject, level_of
from weberlink.system.scoring.perception import FeltError
from weberlink.telemetry.reader import DTYPE

ANCHORS = [(0.1, 5), (0.5, 3), (1.0, 1)]


class Errors:
    """A rig whose felt error is proportional to the Weber factor, and some more."""

    def __init__(self, gain: float = 4.0) -> None:
        self.gain = gain

    def feel(self, trial: Trial, recording: Path | None, elapsed: Elapsed) -> Felt:
        return Felt({FELT: 0.1 + self.gain * trial.condition.weber})


def experiment(path: Path, subject: int, seed: int = 0, gain: float = 4.0) -> dict[int, int]:
    mine = plan(subject, simulated=True, seed=seed)
    with Ledger(path) as ledger:
        ledger.begin(mine)
        Conduct(ledger, Errors(gain), SimulatedSubject(mine, lambda done, of: None), None).run()
    progress = read(path)
    assert progress is not None
    return {number: event["rating"] for number, event in progress.rated.items()}


@pytest.mark.parametrize(
    ("error", "level"),
    [(0.1, 5.0), (0.3, 4.0), (0.5, 3.0), (0.75, 2.0), (1.0, 1.0), (1.125, 0.5), (1.25, 0.0), (9.0, 0.0), (0.0, 5.0)],
)
def test_levels_lie_on_lines_through_the_references(error: float, level: float) -> None:
    assert level_of(error, ANCHORS) == pytest.approx(level)


@given(st.floats(0.0, 10.0), st.floats(0.0, 10.0))
def test_more_error_is_never_rated_better(one: float, other: float) -> None:
    small, large = sorted((one, other))
    assert 5.0 >= level_of(small, ANCHORS) >= level_of(large, ANCHORS) >= 0.0


def test_felt_error_is_in_units_of_a_tenth_of_the_force_and_of_a_newton_at_least() -> None:
    master, slave = np.zeros(4, DTYPE), np.zeros(4, DTYPE)
    for side in (master, slave):
        side["state"] = State.ENGAGED.value
    slave["raw"][:, 2] = [4.0, 0.5, 4.0, 4.0]
    master["output"][:, 2] = [4.4, 0.3, 99.0, 99.0]  # 1 JND, 2 JND, and two that do not count
    master["ramping"][2] = 1
    slave["state"][3] = 0
    felt = FeltError(THRESHOLD)
    felt.add(master[:1], slave[:1])
    felt.add(master[1:], slave[1:])
    assert felt.rms_jnd == pytest.approx(((1.0**2 + 2.0**2) / 2) ** 0.5)
    assert FeltError(THRESHOLD).rms_jnd is None


def test_the_same_seed_rates_alike_and_another_subject_does_not(tmp_path: Path) -> None:
    runs = [experiment(tmp_path / f"{place}.jsonl", subject) for place, subject in enumerate((1, 1, 2))]
    assert runs[0] == runs[1] != runs[2]


def test_ratings_follow_the_error_but_for_chance(tmp_path: Path) -> None:
    """Over some subjects the mean of each Weber factor is that of the rule, within four standard errors."""
    levels: dict[float, list[int]] = {}
    for subject in range(1, 21):
        for number, rating in experiment(tmp_path / f"{subject}.jsonl", subject).items():
            levels.setdefault(plan(subject).trials[number - 1].weber, []).append(rating)
    anchors = [(0.1, 5), (0.6, 3), (1.1, 1)]
    for weber, ratings in levels.items():
        rule = level_of(0.1 + 4.0 * weber, anchors)
        if 1.0 < rule < 4.0:  # away from the ends, where chance is cut off
            assert np.mean(ratings) == pytest.approx(rule, abs=4 * 0.6 / len(ratings) ** 0.5)
        assert len(ratings) == 100
    means = [float(np.mean(levels[weber])) for weber in sorted(levels)]
    assert means == sorted(means, reverse=True)


def test_chance_is_another_in_each_trial() -> None:
    mine = plan(simulated=True)
    subject = SimulatedSubject(mine, lambda done, of: None)
    for reference in REFERENCES:
        subject.learn(reference, Felt({FELT: 0.1 + 4.0 * reference.condition.weber}))
    ratings = [subject.rate(number, Felt({FELT: 0.6})) for number in range(1, 31)]  # level 3, as told
    assert set(ratings) >= {2, 3, 4}
    assert ratings.count(3) > 15


def test_references_that_feel_alike_are_refused_in_one_line(tmp_path: Path) -> None:
    with pytest.raises(ConductError, match=r"cannot be told apart: felt errors of 0.100, 0.100, 0.100 JND") as caught:
        experiment(tmp_path / "simulated-001.jsonl", 1, gain=0.0)
    assert "\n" not in str(caught.value)


def test_what_fails_in_virtual_time_is_not_tried_for_ever() -> None:
    with pytest.raises(ConductError, match="a simulated trial cannot be rated: the link"):
        SimulatedSubject(plan(simulated=True), lambda done, of: None).repeat("trial", "the link")
