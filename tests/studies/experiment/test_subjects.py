"""Both kinds of subjects: a person at a terminal, and the simulated one."""

import io
import os
import pty
import re
import select
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.studies.experiment.studies import Rig, conduct, plan
from weberlink.studies.experiment.conduct import Conduct, ConductError, Elapsed, FeltTrial, Prompt, TrialResult
from weberlink.studies.experiment.ledger import SubjectProgress, opened, read
from weberlink.studies.experiment.plan import REFERENCES
from weberlink.studies.experiment.subjects import FELT, Person, SimulatedSubject, level_of
from weberlink.studies.paper.claims import PREDICTORS

WIDTH = 80
TRAINING = "\n\n\n\n\n\n"
"""Enter to start and Enter to go on, for each of three references."""


class Keyboard(io.StringIO):
    """Types these lines and no more, and shows them as a terminal does."""

    def __init__(self, typed: str, screen: io.StringIO) -> None:
        super().__init__(typed)
        self._screen = screen

    def readline(self, size: int | None = -1, /) -> str:
        line = super().readline(size)
        self._screen.write(line)
        return line


def run(path: Path, typed: str, rig: Rig | None = None, subject: int = 1) -> str:
    """What is on the screen of a person who types this and no more."""
    screen = io.StringIO()
    conduct(path, rig, Person(Keyboard(typed, screen), screen, 10.0), first=plan(subject))  # type: ignore[arg-type]
    return screen.getvalue()


def rated(path: Path) -> list[int]:
    progress = read(path)
    assert progress is not None
    return [entry.rating for entry in progress.rated.values()]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "subject-001.jsonl"


def answers(numbers: range) -> str:
    """Enter, a rating, and Enter after each break."""
    return "".join(("\n" if number in (11, 21) else "") + f"\n{number % 6}\n" for number in numbers)


def test_a_whole_experiment_at_the_keyboard(path: Path) -> None:
    """The same words come whatever the plan has in store, and they do not reveal it."""
    screens = []
    for subject in (1, 2):
        place = path.with_name(f"{subject}.jsonl")
        screen = run(place, TRAINING + answers(range(1, 31)), subject=subject)
        assert rated(place) == [number % 6 for number in range(1, 31)]
        screens.append(screen.replace(f"Subject {subject}", "Subject"))
    assert plan(1).trials != plan(2).trials
    assert screens[0] == screens[1]
    assert max(map(len, screens[0].splitlines())) < WIDTH
    assert screens[0].count("a break") == 3  # announced, and had twice
    for text in plan().wording.values():
        assert screens[0].count(text) >= 31  # before the first trial, and with every question
    words = {*PREDICTORS, "predictor", "Weber", "weber", "deadband", "%", "packet"}
    assert not any(word in screens[0] for word in words)


def test_wrong_answers_are_asked_again(path: Path) -> None:
    screen = run(path, TRAINING + "\n6\n-1\n3.5\n\nvery good\nr\n05\n\u0663\n\u00b2\n 4 \n")
    assert rated(path) == [4]
    assert screen.count("Rating 0 to 5: ") == 10


def test_only_references_can_be_repeated(path: Path) -> None:
    rig = Rig()
    run(path, "\nr\n\nagain\nR\n\n\n" + "\n\n\n\n" + "\n\nr\n5\n", rig)
    assert [trial.name for trial in rig.felt] == ["training-1"] * 3 + ["training-2", "training-3", "trial-01"]
    assert rated(path) == [5]


@pytest.mark.parametrize("lines", [0, 2, 7, 28])
def test_end_of_input_leaves_and_loses_nothing(lines: int, path: Path) -> None:
    typed = (TRAINING + answers(range(1, 31))).splitlines(keepends=True)
    run(path, "".join(typed[:lines]))
    done = len(rated(path))
    assert done == min(10, max(0, (lines - 6) // 2))
    run(path, "\n" * max(0, 6 - lines) + answers(range(done + 1, 31)))
    assert rated(path) == [number % 6 for number in range(1, 31)]


def test_a_repeated_trial_is_announced(path: Path) -> None:
    screen = run(path, TRAINING + "\n\n3\n", Rig([None] * 3 + ["the force was interrupted (slave silence)"]))
    assert "the force was interrupted (slave silence)\n" in screen
    assert rated(path) == [3]


@pytest.fixture
def terminal() -> Iterator[tuple[int, io.TextIOWrapper]]:
    """Both ends of a pseudo-terminal: that of the person, and that of the program."""
    ours, theirs = pty.openpty()
    with os.fdopen(theirs, "r+b", buffering=0) as raw, io.TextIOWrapper(raw, write_through=True) as stream:
        yield ours, stream
    os.close(ours)


def test_the_bar_shows_time_and_disappears(terminal: tuple[int, io.TextIOWrapper]) -> None:
    ours, stream = terminal
    person = Person(stream, stream, 10.0)
    for seconds in (0.0, 2.5, 12.0, None):
        person.elapsed(seconds)
    text = b""
    while select.select([ours], [], [], 0.3)[0]:  # a terminal may hand it over in pieces
        text += os.read(ours, 4096)
    shown = text.decode().split("\r")
    assert [(line.count("#"), line.count(".")) for line in shown[1:4]] == [(0, 40), (10, 30), (40, 0)]
    assert ["8 s" in line for line in shown[1:4]] == [False, True, False]
    assert re.fullmatch(r" +", shown[4])
    assert all(len(line) < WIDTH for line in shown)


def test_keys_typed_during_a_trial_are_dropped(terminal: tuple[int, io.TextIOWrapper]) -> None:
    ours, stream = terminal
    os.write(ours, b"0\n")

    class Screen(io.StringIO):
        def write(self, text: str) -> int:
            if "Rating" in text:
                os.write(ours, b"4\n")  # now it is asked for
            return super().write(text)

    assert Person(stream, Screen(), 10.0).answer(Prompt((), "Rating: ", ("0", "4"))) == "4"


# --- the simulated subject


class Errors:
    """A rig whose felt error is proportional to the Weber factor, and some more."""

    def __init__(self, gain: float = 4.0) -> None:
        self.gain = gain

    def feel(self, trial: FeltTrial, recording: Path | None, elapsed: Elapsed) -> TrialResult:
        return TrialResult({FELT: 0.1 + self.gain * trial.condition.weber})


def experiment(path: Path, subject: int, gain: float = 4.0) -> dict[int, int]:
    with opened(path) as ledger:
        progress = ledger.append(plan(subject, simulated=True))
        Conduct(ledger, Errors(gain), SimulatedSubject(progress, lambda done, of: None), None).run()
    return {number: entry.rating for number, entry in progress.rated.items()}


@pytest.mark.parametrize(
    ("error", "level"),
    [(0.1, 5.0), (0.3, 4.0), (0.5, 3.0), (0.75, 2.0), (1.0, 1.0), (1.125, 0.5), (1.25, 0.0), (9.0, 0.0), (0.0, 5.0)],
)
def test_levels_are_linear_between_references(error: float, level: float) -> None:
    assert level_of(error, [(0.1, 5), (0.5, 3), (1.0, 1)]) == pytest.approx(level)


@given(st.floats(0.0, 10.0), st.floats(0.0, 10.0))
def test_more_error_is_never_rated_better(one: float, other: float) -> None:
    anchors = [(0.1, 5), (0.5, 3), (1.0, 1)]
    assert 5.0 >= level_of(min(one, other), anchors) >= level_of(max(one, other), anchors) >= 0.0


def test_mean_ratings_follow_the_rule(tmp_path: Path) -> None:
    """Over some subjects the mean of each Weber factor is that of the rule, within five standard errors."""
    levels: dict[float, list[int]] = {}
    for subject in range(1, 9):
        for number, rating in experiment(tmp_path / f"{subject}.jsonl", subject).items():
            levels.setdefault(plan(subject).trials[number - 1].weber, []).append(rating)
    for weber, ratings in levels.items():
        rule = level_of(0.1 + 4.0 * weber, [(0.1, 5), (0.6, 3), (1.1, 1)])
        if 1.0 < rule < 4.0:  # away from the ends, where chance is cut off
            assert np.mean(ratings) == pytest.approx(rule, abs=5 * 0.6 / len(ratings) ** 0.5)
        assert len(ratings) == 40
    again = experiment(tmp_path / "again.jsonl", 1)
    assert again == experiment(tmp_path / "once_more.jsonl", 1) != experiment(tmp_path / "other.jsonl", 2)


def simulated(*errors: float) -> SimulatedSubject:
    """A subject who has felt the references."""
    figures = dict(enumerate({FELT: error} for error in errors))
    return SimulatedSubject(SubjectProgress(plan(simulated=True), figures), lambda done, of: None)


def test_noise_differs_between_trials() -> None:
    subject = simulated(*(0.1 + 4.0 * reference.condition.weber for reference in REFERENCES))
    felt = TrialResult({FELT: 0.6})  # level 3, as told
    ratings = [int(subject.answer(Prompt(felt=felt, rated=number))) for number in range(1, 31)]
    assert set(ratings) >= {2, 3, 4}
    assert ratings.count(3) > 15


@pytest.mark.parametrize(
    ("subject", "felt", "part"),
    [
        (simulated(0.1, 0.1, 0.1), TrialResult({FELT: 0.6}), "do not rise: 0.100, 0.100, 0.100 JND"),
        (simulated(0.1, 0.5, 1.0), TrialResult({}, "no link"), "cannot be rated: no link"),
    ],
)
def test_what_cannot_be_rated_is_one_line(subject: SimulatedSubject, felt: TrialResult, part: str) -> None:
    with pytest.raises(ConductError, match=part) as caught:
        subject.answer(Prompt(felt=felt, rated=1))
    assert "\n" not in str(caught.value)
