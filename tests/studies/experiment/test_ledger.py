"""Ledgers: no rating is lost by kills, torn or damaged lines and full disks; which ledgers are comparable."""

import csv
import json
import os
import resource
import subprocess
import sys
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from random import Random
from time import sleep
from typing import Any

import pytest
from hypothesis import HealthCheck, given
from hypothesis import strategies as st

from tests.examples import examples
from tests.studies.experiment.studies import Rig, Robot, plan
from weberlink.studies.experiment.answers import gather
from weberlink.studies.experiment.conduct import Conduct, SubjectLeft
from weberlink.studies.experiment.ledger import (
    RATED,
    TRAINED,
    Ledger,
    LedgerError,
    SubjectProgress,
    path_of,
    read,
    subjects,
)
from weberlink.studies.paper.claims import PREDICTORS, WEBERS

ROOT = Path(__file__).parents[3]

# A subject's whole experiment as a process, which tells of each rating once it is in the ledger.
CHILD = """
import sys
from pathlib import Path
from time import sleep
from weberlink.studies.experiment.conduct import Conduct
from weberlink.studies.experiment.ledger import Ledger
from tests.studies.experiment.studies import Rig, Robot, plan

class Telling(Ledger):
    def append(self, event, **facts):
        super().append(event, **facts)
        if event == "trial_rated":
            print(facts["trial"], facts["rating"], flush=True)

class Slow(Rig):
    def feel(self, *arguments):
        sleep(0.0005)
        return super().feel(*arguments)

with Telling(Path(sys.argv[1])) as ledger:
    if ledger.progress is None:
        ledger.begin(plan())
    print("begun", flush=True)
    Conduct(ledger, Slow(), Robot(), None).run()
"""


def begun(path: Path, leave_at: int) -> Ledger:
    """A ledger left before a trial; still open."""
    ledger = Ledger(path)
    ledger.begin(plan())
    with pytest.raises(SubjectLeft):
        Conduct(ledger, Rig(), Robot(leave_at=leave_at), None).run()
    return ledger


def left_before(path: Path, trial: int) -> list[bytes]:
    """The lines of such a ledger, closed."""
    with begun(path, trial):
        pass
    return path.read_bytes().splitlines(keepends=True)


def ratings(progress: SubjectProgress | None) -> dict[int, int]:
    assert progress is not None
    return {number: event["rating"] for number, event in progress.rated.items()}


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.hunt), pytest.param(2, marks=pytest.mark.hunt)])
def test_kill_9_loses_no_rating(seed: int, tmp_path: Path) -> None:
    path, chance = tmp_path / "subject-001.jsonl", Random(seed)
    told: dict[int, int] = {}
    ends = []
    for _ in range(200):
        child = subprocess.Popen([sys.executable, "-c", CHILD, str(path)], cwd=ROOT, stdout=subprocess.PIPE, text=True)
        assert child.stdout is not None
        assert child.stdout.readline() == "begun\n"
        output = "".join(child.stdout.readline() for _ in range(chance.randrange(9)))
        sleep(chance.uniform(0.0, 0.002))
        child.kill()
        output += child.communicate()[0]
        for line in output.splitlines(keepends=True):
            if line.endswith("\n"):
                trial, rating = map(int, line.split())
                assert trial not in told  # none is asked for twice
                told[trial] = rating
        found = read(path)
        assert told.items() <= ratings(found).items()
        assert found is not None
        # Without holes, and at most one more than was told of.
        assert list(found.rated) == list(range(1, len(found.rated) + 1))
        assert len(found.rated) - len(told) <= 1
        told = ratings(found)
        ends.append(len(told))
        if found.complete:
            break
    assert ratings(read(path)) == {number: number % 6 for number in range(1, 31)}
    assert len(set(ends)) > 3, ends  # it was killed in the middle, more than once
    rated = [json.loads(line) for line in path.read_text().splitlines() if f'"{RATED}"' in line]
    assert [event["trial"] for event in rated] == list(range(1, 31))
    assert [(event["predictor"], event["weber"]) for event in rated] == [
        (trial.predictor, trial.weber) for trial in plan().trials
    ]


@examples(15, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(cut=st.integers(1, 3000))
def test_a_cut_file_continues_with_the_lost_trial(cut: int, tmp_path: Path) -> None:
    path = tmp_path / f"{cut}-{os.urandom(4).hex()}.jsonl"
    lines = left_before(path, 12)
    data = b"".join(lines)[: -min(cut, sum(map(len, lines[1:])))]
    path.write_bytes(data)
    whole = data[: data.rfind(b"\n") + 1]
    rated = sum(f'"{RATED}"'.encode() in line for line in whole.splitlines())
    with Ledger(path) as ledger:
        assert ledger.progress is not None
        assert ledger.progress.remaining[0] == rated + 1
        assert path.read_bytes() == whole
        if data == whole:
            assert ledger.set_aside is None
        else:
            assert ledger.set_aside is not None
            assert ledger.set_aside.read_bytes() == data[len(whole) :]
        Conduct(ledger, Rig(), Robot(), None).run()
        assert ledger.progress.complete
    assert ratings(read(path)) == {number: number % 6 for number in range(1, 31)}


def test_a_torn_plan_leaves_an_empty_ledger(tmp_path: Path) -> None:
    path = tmp_path / "subject-001.jsonl"
    path.write_bytes(b'{"event": "pla')
    assert read(path) is None
    with Ledger(path) as ledger:
        assert ledger.progress is None
        assert ledger.set_aside == tmp_path / "subject-001.jsonl.torn-1"
        ledger.begin(plan())
    assert read(path) == SubjectProgress(plan())


@pytest.mark.parametrize(
    ("number", "line", "part"),
    [
        (1, b"[]\n", "expected a JSON object"),
        (1, b'{"event": "trial_rated"}\n', "version"),
        (6, b"\x00\x00\x00\n", "not JSON"),
        (6, b'{"event": "trial_\n', "not JSON"),
        (6, b'{"event": "nonsense"}\n', "expected an event, not 'nonsense'"),
        (8, b'{"event": "trial_rated", "trial": 31, "rating": 3}\n', "trial: expected 1 to 30, not 31"),
        (8, b'{"event": "trial_rated", "trial": 1, "rating": 6}\n', "rating: expected 0 to 5, not 6"),
        (8, b'{"event": "trial_rated", "trial": 1, "rating": true}\n', "rating: expected 0 to 5, not True"),
        (
            8,
            b'{"event": "trial_rated", "trial": 1, "rating": 3, "predictor": "zoh", "weber": 9}\n',
            "another condition",
        ),
        (10, None, "trial 1 is rated twice"),
    ],
)
def test_damage_is_one_line_with_file_and_line(number: int, line: bytes | None, part: str, tmp_path: Path) -> None:
    path = tmp_path / "subject-001.jsonl"
    lines = left_before(path, 5)
    rated = next(place for place, text in enumerate(lines) if b'"trial_rated"' in text)
    lines[number - 1] = lines[rated] if line is None else line
    path.write_bytes(b"".join(lines))
    for look in (read, Ledger):
        with pytest.raises(LedgerError) as caught:
            look(path)
        assert str(caught.value).startswith(f"{path}:{number}: damaged: ")
        assert part in str(caught.value)
        assert "\n" not in str(caught.value)
    assert path.read_bytes() == b"".join(lines)  # left as it is


def test_a_second_process_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "subject-001.jsonl"
    with Ledger(path) as ledger:
        ledger.begin(plan())
        with pytest.raises(LedgerError, match="another process"):
            Ledger(path)
        other = subprocess.run(
            [sys.executable, "-c", CHILD, str(path)], cwd=ROOT, capture_output=True, text=True, check=False
        )
        assert "another process runs an experiment with this subject" in other.stderr
        assert read(path) == SubjectProgress(plan())  # who only reads is let in
    with Ledger(path) as again:
        assert again.progress == SubjectProgress(plan())


def test_a_full_disk_does_not_change_the_ledger(tmp_path: Path) -> None:
    """A limit of the file's size stands for the disk's: the write comes back short."""
    path = tmp_path / "subject-001.jsonl"
    with begun(path, 3) as ledger:
        before = path.read_bytes()
        soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
        resource.setrlimit(resource.RLIMIT_FSIZE, (len(before) + 20, hard))
        try:
            with pytest.raises(OSError, match="No space left"):
                ledger.append(TRAINED)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        assert path.read_bytes() == before
        ledger.append(TRAINED)
    assert read(path) is not None


def test_every_event_has_time_and_mark(tmp_path: Path) -> None:
    for simulated in (False, True):
        path = path_of(tmp_path, 3, simulated=simulated)
        with Ledger(path) as ledger:
            ledger.begin(plan(3, simulated=simulated))
            Conduct(ledger, Rig(), Robot(), None).run()
        first, *rest = [json.loads(line) for line in path.read_text().splitlines()]
        assert first["event"] == "plan"
        assert first["simulated"] is simulated
        assert all("at" in line for line in rest)
        assert all(line.get("simulated", False) is simulated for line in rest)


def test_ledgers_of_people_and_programs_differ_in_name(tmp_path: Path) -> None:
    names: list[Any] = ["subject-001.jsonl", "subject-010.jsonl", "subject-x.jsonl", "simulated-002.jsonl", "a.jsonl"]
    for name in names:
        (tmp_path / name).touch()
    (tmp_path / "subject-011.jsonl.torn-1").touch()
    assert subjects(tmp_path, simulated=False) == [1, 10]
    assert subjects(tmp_path, simulated=True) == [2]
    assert path_of(tmp_path, 1234, simulated=False).name == "subject-1234.jsonl"


def subject(folder: Path, number: int, *, simulated: bool = False, leave_at: int = 99, **changes: Any) -> Path:
    """A ledger of somebody who rates trial n as n modulo 6."""
    path = path_of(folder, number, simulated=simulated)
    with Ledger(path) as ledger:
        ledger.begin(replace(plan(number, simulated=simulated), **changes))
        with suppress(SubjectLeft):
            Conduct(ledger, Rig(), Robot(leave_at=leave_at), None).run()
    return path


def test_ratings_are_sorted_by_condition(tmp_path: Path) -> None:
    for number in (1, 2, 5):
        subject(tmp_path, number)
    answers = gather(tmp_path, None)
    assert answers.subjects == [1, 2, 5]
    assert (answers.predictors, answers.webers) == (list(PREDICTORS), list(WEBERS))
    ratings, rates = answers.ratings(), answers.packet_rates()
    assert ratings.shape == rates.shape == (3, 5, 6)
    for row, number in enumerate((1, 2, 5)):
        for place, trial in enumerate(plan(number).trials, 1):
            at = (row, PREDICTORS.index(trial.predictor), WEBERS.index(trial.weber))
            assert ratings[at] == place % 6
            assert rates[at] == pytest.approx(1000.0 / (1 + 100 * trial.weber))
    assert {one.unit for one in answers.observations} == {"subject 1", "subject 2", "subject 5"}
    assert list(dict.fromkeys(one.predictor for one in answers.observations)) == list(PREDICTORS)


def test_incomplete_subjects_are_left_out(tmp_path: Path) -> None:
    subject(tmp_path, 1)
    subject(tmp_path, 2, leave_at=8)
    path_of(tmp_path, 3, simulated=False).touch()
    answers = gather(tmp_path, None)
    assert (answers.subjects, answers.incomplete) == ([1], {2: 7, 3: 0})


def test_people_and_programs_are_never_mixed(tmp_path: Path) -> None:
    subject(tmp_path, 1)
    subject(tmp_path, 1, simulated=True)
    with pytest.raises(LedgerError, match="cannot be analysed together; choose with --only"):
        gather(tmp_path, None)
    assert not gather(tmp_path, "people").simulated
    assert gather(tmp_path, "simulated").simulated


def test_a_renamed_ledger_does_not_pass_for_a_person(tmp_path: Path) -> None:
    made = subject(tmp_path, 1, simulated=True)
    made.rename(path_of(tmp_path, 1, simulated=False))
    with pytest.raises(LedgerError, match=r"subject-001.jsonl:1: is the ledger of simulated subject 1"):
        gather(tmp_path, None)


@pytest.mark.parametrize(
    ("changes", "part"),
    [
        ({"digest": "e" * 64}, "another configuration"),
        ({"duration_s": 5.0}, "trials of another length"),
        ({"wording": {"0": "bad"}}, "another wording"),
        ({"trials": plan().trials[:29]}, "other trials"),
    ],
)
def test_incomparable_ledgers_are_refused(changes: dict[str, Any], part: str, tmp_path: Path) -> None:
    subject(tmp_path, 1)
    subject(tmp_path, 2, **changes)
    with pytest.raises(LedgerError, match=part) as caught:
        gather(tmp_path, None)
    assert "subject-002.jsonl: has" in str(caught.value)


def test_csv_has_every_rating_in_order(tmp_path: Path) -> None:
    path = subject(tmp_path, 4, simulated=True)
    gather(tmp_path, None).write_csv(tmp_path / "out.csv")
    with (tmp_path / "out.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    events = [event for line in path.read_text().splitlines() if (event := json.loads(line))["event"] == "trial_rated"]
    assert [(row["trial"], row["predictor"], row["weber"], row["rating"]) for row in rows] == [
        tuple(str(event[name]) for name in ("trial", "predictor", "weber", "rating")) for event in events
    ]
    assert all(row["simulated"] == "true" and row["subject"] == "4" for row in rows)
