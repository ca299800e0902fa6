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

from tests.studies.experiment.studies import Rig, plan
from weberlink.studies.experiment.conduct import Conduct, ConductError, Elapsed, FeltTrial, SubjectLeft, TrialResult
from weberlink.studies.experiment.ledger import Ledger, read
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


def run(path: Path, typed: str, rig: Rig | None = None) -> str:
    """What is on the screen of a person who types this and no more."""
    screen = io.StringIO()
    with Ledger(path) as ledger:
        if ledger.progress is None:
            ledger.begin(plan())
        try:
            Conduct(ledger, rig or Rig(), Person(Keyboard(typed, screen), screen, plan()), None).run()
        except SubjectLeft:
            screen.write("LEFT")
    return screen.getvalue()


def rated(path: Path) -> list[int]:
    progress = read(path)
    assert progress is not None
    return [event["rating"] for event in progress.rated.values()]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "subject-001.jsonl"


def answers(numbers: range) -> str:
    """Enter, a rating, and Enter after each break."""
    return "".join(("\n" if number in (11, 21) else "") + f"\n{number % 6}\n" for number in numbers)


def test_a_whole_experiment_at_the_keyboard(path: Path) -> None:
    screen = run(path, TRAINING + answers(range(1, 31)))
    assert rated(path) == [number % 6 for number in range(1, 31)]
    assert screen.endswith("That was the last trial. Thank you.\n")
    assert max(map(len, screen.splitlines())) < WIDTH
    assert screen.count("a break") == 3  # announced, and had twice
    for text in plan().wording.values():
        assert screen.count(text) >= 31  # before the first trial, and with every question


def test_the_screen_does_not_reveal_conditions(path: Path) -> None:
    """The same words come whatever the plan has in store."""
    screens = []
    for subject in (1, 2):
        screen = io.StringIO()
        with Ledger(path.with_name(f"{subject}.jsonl")) as ledger:
            ledger.begin(plan(subject))
            person = Person(io.StringIO(TRAINING + answers(range(1, 31))), screen, plan(subject))
            Conduct(ledger, Rig(), person, None).run()
        screens.append(screen.getvalue().replace(f"Subject {subject}", "Subject"))
    assert screens[0] == screens[1]
    assert plan(1).trials != plan(2).trials
    words = {*PREDICTORS, "predictor", "Weber", "weber", "deadband", "%", "packet"}
    assert not any(word in screens[0] for word in words)


def test_wrong_answers_are_asked_again(path: Path) -> None:
    screen = run(path, TRAINING + "\n6\n-1\n3.5\n\nvery good\nr\n 4 \n")
    assert rated(path) == [4]
    assert screen.count("Please type one number from 0 to 5, and Enter.") == 6


def test_only_references_can_be_repeated(path: Path) -> None:
    rig = Rig()
    screen = run(path, "\nr\n\nagain\nR\n\n\n" + "\n\n\n\n" + "\nr\n5\n", rig)
    assert [trial.name for trial in rig.felt] == ["training-1"] * 3 + ["training-2", "training-3", "trial-01"]
    assert screen.count("Please press Enter alone, or r and Enter.") == 1
    assert rated(path) == [5]


@pytest.mark.parametrize("lines", [0, 2, 7, 28])
def test_end_of_input_leaves_and_loses_nothing(lines: int, path: Path) -> None:
    typed = (TRAINING + answers(range(1, 31))).splitlines(keepends=True)
    screen = run(path, "".join(typed[:lines]))
    assert screen.endswith("\nLEFT")
    done = len(rated(path))
    assert done == min(10, max(0, (lines - 6) // 2))
    left = answers(range(done + 1, 31))
    run(path, (TRAINING if lines < 6 else "") + left)
    assert rated(path) == [number % 6 for number in range(1, 31)] or lines < 6


def test_a_repeated_trial_is_announced(path: Path) -> None:
    screen = run(path, TRAINING + "\n\n3\n", Rig([None] * 3 + ["the force was interrupted (slave silence)"]))
    assert "This trial does not count and is repeated: the force was interrupted (slave silence)\n" in screen
    assert rated(path) == [3]


@pytest.fixture
def terminal() -> Iterator[tuple[int, io.TextIOWrapper]]:
    """Both ends of a pseudo-terminal: that of the person, and that of the program."""
    ours, theirs = pty.openpty()
    with os.fdopen(theirs, "r+b", buffering=0) as raw, io.TextIOWrapper(raw, write_through=True) as stream:
        yield ours, stream
    os.close(ours)


def read_all(terminal: int) -> str:
    """What has come; a terminal may hand it over in pieces."""
    text = b""
    while select.select([terminal], [], [], 0.3)[0]:
        text += os.read(terminal, 4096)
    return text.decode()


def test_the_bar_shows_time_and_disappears(terminal: tuple[int, io.TextIOWrapper]) -> None:
    ours, stream = terminal
    person = Person(stream, stream, plan())
    for seconds in (0.0, 2.5, 12.0):
        person.elapsed(seconds)
    person.leave()
    shown = read_all(ours).split("\r")
    assert shown[1].strip() == f"[{'.' * 40}] starting"
    assert shown[2].strip() == f"[{'#' * 10}{'.' * 30}]    8 s left"
    assert shown[3].strip() == f"[{'#' * 40}]    0 s left"
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

    assert Person(stream, Screen(), plan()).rate(1, TrialResult({})) == 4


ANCHORS = [(0.1, 5), (0.5, 3), (1.0, 1)]


class Errors:
    """A rig whose felt error is proportional to the Weber factor, and some more."""

    def __init__(self, gain: float = 4.0) -> None:
        self.gain = gain

    def feel(self, trial: FeltTrial, recording: Path | None, elapsed: Elapsed) -> TrialResult:
        return TrialResult({FELT: 0.1 + self.gain * trial.condition.weber})


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
def test_levels_are_linear_between_references(error: float, level: float) -> None:
    assert level_of(error, ANCHORS) == pytest.approx(level)


@given(st.floats(0.0, 10.0), st.floats(0.0, 10.0))
def test_more_error_is_never_rated_better(one: float, other: float) -> None:
    small, large = sorted((one, other))
    assert 5.0 >= level_of(small, ANCHORS) >= level_of(large, ANCHORS) >= 0.0


def test_mean_ratings_follow_the_rule(tmp_path: Path) -> None:
    """Over some subjects the mean of each Weber factor is that of the rule, within five standard errors."""
    levels: dict[float, list[int]] = {}
    for subject in range(1, 9):
        for number, rating in experiment(tmp_path / f"{subject}.jsonl", subject).items():
            levels.setdefault(plan(subject).trials[number - 1].weber, []).append(rating)
    anchors = [(0.1, 5), (0.6, 3), (1.1, 1)]
    for weber, ratings in levels.items():
        rule = level_of(0.1 + 4.0 * weber, anchors)
        if 1.0 < rule < 4.0:  # away from the ends, where chance is cut off
            assert np.mean(ratings) == pytest.approx(rule, abs=5 * 0.6 / len(ratings) ** 0.5)
        assert len(ratings) == 40
    again = experiment(tmp_path / "again.jsonl", 1)
    assert again == experiment(tmp_path / "once_more.jsonl", 1) != experiment(tmp_path / "other.jsonl", 2)


def test_noise_differs_between_trials() -> None:
    mine = plan(simulated=True)
    subject = SimulatedSubject(mine, lambda done, of: None)
    for reference in REFERENCES:
        subject.learn(reference, TrialResult({FELT: 0.1 + 4.0 * reference.condition.weber}))
    ratings = [subject.rate(number, TrialResult({FELT: 0.6})) for number in range(1, 31)]  # level 3, as told
    assert set(ratings) >= {2, 3, 4}
    assert ratings.count(3) > 15


def test_equal_references_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ConductError, match=r"do not rise: 0.100, 0.100, 0.100 JND") as caught:
        experiment(tmp_path / "simulated-001.jsonl", 1, gain=0.0)
    assert "\n" not in str(caught.value)


def test_a_failed_simulated_trial_is_an_error() -> None:
    with pytest.raises(ConductError, match="a simulated trial cannot be rated: the link"):
        SimulatedSubject(plan(simulated=True), lambda done, of: None).repeat("trial", "the link")
