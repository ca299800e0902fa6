"""Both kinds of subjects: a person at a terminal, and the simulated one."""

import io
from pathlib import Path

import pytest

from plugins.doctor.tests.device.people import Keyboard
from plugins.studies.tests.experiment.studies import Rig, conduct, plan
from weberlink_studies.experiment.ledger import read
from weberlink_studies.experiment.subjects import Person, level_of
from weberlink_studies.paper.claims import PREDICTORS

TRAINING = "\n\n\n\n\n\n"
"""Enter to start and Enter to go on, for each of three references."""


def run(path: Path, typed: str, rig: Rig | None = None, subject: int = 1) -> str:
    """What is on the screen of a person who types this and no more."""
    screen = io.StringIO()
    conduct(path, rig, Person(Keyboard(screen, *typed.splitlines()), screen, 10.0), first=plan(subject))  # type: ignore[arg-type]
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
    words = {*PREDICTORS, "predictor", "Weber", "weber", "deadband", "%", "packet"}
    assert not any(word in screens[0] for word in words)


def test_wrong_answers_are_asked_again(path: Path) -> None:
    screen = run(path, TRAINING + "\n6\n-1\n3.5\n\nvery good\nr\n05\n\u0663\n\u00b2\n 4 \n")
    assert rated(path) == [4]
    assert screen.count("Rating 0 to 5: ") == 10


# --- the simulated subject


@pytest.mark.parametrize(
    ("error", "level"), [(0.0, 5.0), (0.1, 5.0), (0.3, 4.0), (0.75, 2.0), (1.125, 0.5), (9.0, 0.0)]
)
def test_levels_are_linear_between_references(error: float, level: float) -> None:
    assert level_of(error, [(0.1, 5), (0.5, 3), (1.0, 1)]) == pytest.approx(level)
