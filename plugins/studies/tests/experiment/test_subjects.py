"""Both kinds of subjects: a person at a terminal, and the simulated one."""

import io
import os
import pty
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from plugins.studies.tests.experiment.studies import Rig, conduct, plan
from weberlink_studies.experiment.conduct import Prompt
from weberlink_studies.experiment.ledger import read
from weberlink_studies.experiment.subjects import Person, level_of
from weberlink_studies.paper.claims import PREDICTORS

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


@pytest.fixture
def terminal() -> Iterator[tuple[int, io.TextIOWrapper]]:
    """Both ends of a pseudo-terminal: that of the person, and that of the program."""
    ours, theirs = pty.openpty()
    with os.fdopen(theirs, "r+b", buffering=0) as raw, io.TextIOWrapper(raw, write_through=True) as stream:
        yield ours, stream
    os.close(ours)


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
