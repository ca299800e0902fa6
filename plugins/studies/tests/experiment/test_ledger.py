"""Ledgers: no rating is lost by kills, torn or damaged lines and full disks."""

import os
import resource
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, strategies as st

from plugins.studies.tests.experiment.studies import Robot, conduct
from tests.examples import examples
from weberlink_studies.experiment.ledger import LedgerError, SubjectProgress, TrainingDone, opened, read

DATA = Path(__file__).parent


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "subject-001.jsonl"


def left_before(path: Path, trial: int) -> list[bytes]:
    """The lines of a ledger that was left before a trial."""
    conduct(path, robot=Robot(leave_at=trial))
    return path.read_bytes().splitlines(keepends=True)


def ratings(progress: SubjectProgress | None) -> dict[int, int]:
    assert progress is not None
    return {number: entry.rating for number, entry in progress.rated.items()}


@examples(15, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(cut=st.integers(1, 3000))
def test_a_cut_file_continues_with_the_lost_trial(cut: int, tmp_path: Path) -> None:
    path = tmp_path / f"{cut}-{os.urandom(4).hex()}.jsonl"
    lines = left_before(path, 12)
    data = b"".join(lines)[: -min(cut, sum(map(len, lines[1:])))]
    path.write_bytes(data)
    whole = data[: data.rfind(b"\n") + 1]
    with opened(path) as ledger:
        assert ledger.progress is not None
        assert ledger.progress.remaining[0] == 1 + whole.count(b'"trial_rated"')
        assert path.read_bytes() == whole
        if data == whole:
            assert ledger.set_aside is None
        else:
            assert ledger.set_aside is not None
            assert ledger.set_aside.read_bytes() == data[len(whole) :] + b"\n"
    assert ratings(conduct(path)) == ratings(read(path)) == {number: number % 6 for number in range(1, 31)}


@pytest.mark.parametrize(
    ("number", "line", "part"),
    [
        (1, b'{"event": "trial_rated"}\n', "event"),
        (6, b"\x00\x00\x00\n", "JSON"),
        (8, b'{"event": "trial_begun", "trial": 31}\n', "trial: expected 1 to 30, not 31"),
        (8, b'{"event": "trial_rated", "trial": 1, "rating": 6, "predictor": "zoh", "weber": 9}\n', "rating"),
        (8, b'{"event": "trial_rated", "trial": 1, "rating": 3, "predictor": "zoh", "weber": 9}\n', "condition"),
        (10, None, "trial 1 is rated twice"),
    ],
)
def test_damage_is_one_line_with_file_and_line(number: int, line: bytes | None, part: str, path: Path) -> None:
    lines = left_before(path, 5)
    rated = next(text for text in lines if b'"trial_rated"' in text)
    lines[number - 1] = rated if line is None else line
    path.write_bytes(b"".join(lines))
    for look in (read, conduct):
        with pytest.raises(LedgerError) as caught:
            look(path)
        assert str(caught.value).startswith(f"{path}:{number}: damaged: ")
        assert part in str(caught.value)
        assert "\n" not in str(caught.value)
    assert path.read_bytes() == b"".join(lines)  # left as it is


def test_a_full_disk_does_not_change_the_ledger(path: Path) -> None:
    """A limit of the file's size stands for the disk's: the write comes back short."""
    before = b"".join(left_before(path, 3))
    with opened(path) as ledger:
        soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
        resource.setrlimit(resource.RLIMIT_FSIZE, (len(before) + 20, hard))
        try:
            with pytest.raises(OSError, match="No space left"):
                ledger.append(TrainingDone())
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        assert path.read_bytes() == before
        ledger.append(TrainingDone())
    assert read(path) is not None


def test_a_ledger_of_the_first_release_is_read() -> None:
    """Its lines have a space after colons and commas, levels as text, and no mark where a person rates."""
    progress = read(DATA / "first_release.jsonl")
    assert progress is not None
    assert (progress.plan.subject, progress.plan.simulated, progress.trained) == (1, False, True)
    assert [(entry.rating, entry.attempt) for entry in progress.rated.values()] == [(1, 2)]
    assert progress.remaining == [*range(2, 31)]
