"""What a person reads and may answer, through streams as a terminal has them."""

import io
import os
import pty
import re
import select
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.studies.experiment.studies import Rig, plan
from weberlink.studies.experiment.conduct import Conduct, Felt, Left
from weberlink.studies.experiment.ledger import Ledger, read
from weberlink.studies.experiment.person import Person
from weberlink.studies.experiment.plan import PREDICTORS
from weberlink.studies.experiment.scale import REFERENCES

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
        except Left:
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


def test_nothing_on_the_screen_tells_what_is_felt(path: Path) -> None:
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


def test_a_reference_may_be_felt_again_and_a_trial_may_not(path: Path) -> None:
    rig = Rig()
    screen = run(path, "\nr\n\nagain\nR\n\n\n" + "\n\n\n\n" + "\nr\n5\n", rig)
    assert [trial.name for trial in rig.felt] == ["training-1"] * 3 + ["training-2", "training-3", "trial-01"]
    assert screen.count("Please press Enter alone, or r and Enter.") == 1
    assert rated(path) == [5]


@pytest.mark.parametrize("lines", [0, 1, 2, 6, 7, 8, 9, 28])
def test_the_end_of_input_at_any_question_leaves_and_loses_nothing(lines: int, path: Path) -> None:
    typed = (TRAINING + answers(range(1, 31))).splitlines(keepends=True)
    screen = run(path, "".join(typed[:lines]))
    assert screen.endswith("\nLEFT")
    done = len(rated(path))
    assert done == min(10, max(0, (lines - 6) // 2))
    left = answers(range(done + 1, 31))
    run(path, (TRAINING if lines < 6 else "") + left)
    assert rated(path) == [number % 6 for number in range(1, 31)] or lines < 6


def test_who_comes_back_is_told_how_far_they_are(path: Path) -> None:
    run(path, TRAINING + answers(range(1, 4)))
    screen = run(path, "")
    assert "27 trials" in screen
    assert "The training is done, and 3 trials are rated." in screen
    assert "First come" not in screen


def test_a_trial_that_does_not_count_is_said_in_one_line(path: Path) -> None:
    screen = run(path, TRAINING + "\n\n3\n", Rig([None] * 3 + ["the force was interrupted (slave silence)"]))
    assert "This trial does not count and comes again: the force was interrupted (slave silence)\n" in screen
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


def test_the_bar_tells_time_and_is_gone_when_the_question_comes(terminal: tuple[int, io.TextIOWrapper]) -> None:
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


@pytest.mark.parametrize("question", ["rate", "learn", "repeat"])
def test_every_word_after_a_trial_begins_on_a_line_of_its_own(question: str) -> None:
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    screen = Terminal()
    person = Person(io.StringIO("3\n" if question == "rate" else "\n"), screen, plan())
    person.elapsed(9.9)
    {
        "rate": lambda: person.rate(1, Felt({})),
        "learn": lambda: person.learn(REFERENCES[0], Felt({})),
        "repeat": lambda: person.repeat("trial", "the link was silent"),
    }[question]()
    bar, blank, words = screen.getvalue().lstrip("\r").split("\r")
    assert bar.strip()
    assert not blank.strip()
    assert len(blank) >= len(bar)
    assert words.strip()


def test_what_was_typed_during_a_trial_is_no_rating(terminal: tuple[int, io.TextIOWrapper]) -> None:
    ours, stream = terminal
    os.write(ours, b"0\n")

    class Screen(io.StringIO):
        def write(self, text: str) -> int:
            if "Rating" in text:
                os.write(ours, b"4\n")  # now it is asked for
            return super().write(text)

    assert Person(stream, Screen(), plan()).rate(1, Felt({})) == 4
