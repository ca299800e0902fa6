"""The frame of a study: rows in the order of the cases wherever they run, what a result states, and lost workers."""

import csv
import json
import os
import signal
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from weberlink_studies.frame import Row, Study, StudyError


def square(number: int) -> list[Row]:
    """A number, its square, and for odd ones its half."""
    return [{"number": number, "square": number**2} | ({"odd": {"half": number / 2}} if number % 2 else {})]


def die(number: int) -> list[Row]:
    """Ends its process as the kernel does when memory runs out."""
    os.kill(os.getpid(), signal.SIGKILL)
    return square(number)


def square_until_two(number: int) -> list[Row]:
    if number > 2:
        raise KeyboardInterrupt
    return square(number)


STUDY: Study[int, int] = Study(
    name="squares",
    cases=range,
    run=square,
    summary=lambda most, rows: {"most": most, "sum": int(rows["square"].sum())},
    tables=lambda most, rows, run_time_s, caption: f"{len(rows)} of {most} squares; {caption}",
    plots=lambda most, rows, folder, caption: (folder / "squares").write_text(caption) and None,
    cost=float,
    seed=7,
)


@pytest.mark.parametrize("workers", [1, 2, None])
def test_rows_stand_in_the_order_of_the_cases(workers: int | None) -> None:
    told: list[tuple[int, int]] = []
    result = STUDY.result(6, workers=workers, progress=lambda *counts: told.append(counts))
    assert [row["number"] for row in result.rows] == list(range(6))
    assert told == [(done, 6) for done in range(1, 7)]
    assert result.interrupted == ""


def test_a_result_states_seed_and_environment(tmp_path: Path) -> None:
    result = STUDY.result(4, workers=1)
    document = json.loads(json.dumps(result.document, allow_nan=False))
    assert list(document) == ["most", "sum", "rows", "seed", "run_time_s", "environment"]
    assert (document["most"], document["sum"], document["seed"]) == (4, 14, 7)
    assert document["rows"][3] == {"number": 3, "square": 9, "odd": {"half": 1.5}}
    result.write_csv(tmp_path / "rows.csv")
    with (tmp_path / "rows.csv").open(newline="", encoding="utf-8") as file:
        assert list(csv.DictReader(file))[:2] == [
            {"number": "0", "square": "0", "odd_half": ""},
            {"number": "1", "square": "1", "odd_half": "0.5"},
        ]


def test_ctrl_c_keeps_finished_rows_and_draws_nothing(tmp_path: Path) -> None:
    result = replace(STUDY, run=square_until_two).result(5, workers=1)
    assert [row["number"] for row in result.rows] == [0, 1, 2]
    assert result.interrupted == "3 of 5 cases"
    result.draw(tmp_path / "none")
    assert not (tmp_path / "none").exists()


def test_a_dead_worker_process_is_one_line() -> None:
    with pytest.raises(StudyError, match=r"^a worker process died before the end, .* with --workers$"):
        replace(STUDY, run=die).result(3, workers=2)


# --- a cluster


@pytest.fixture(scope="module")
def scheduler() -> Iterator[str]:
    """The address of a cluster of two workers on loopback, in threads of this process."""
    distributed = pytest.importorskip("distributed", reason="needs distributed (extra: dask)")
    options = {"processes": False, "dashboard_address": None, "protocol": "tcp", "host": "127.0.0.1"}
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, **options) as cluster:
        yield cluster.scheduler_address


def test_rows_of_a_cluster_are_those_of_this_machine(scheduler: str) -> None:
    told: list[tuple[int, int]] = []
    result = STUDY.result(20, dask=scheduler, progress=lambda *counts: told.append(counts))
    assert result.rows == STUDY.result(20, workers=1).rows
    assert told == [(done, 20) for done in range(1, 21)]
