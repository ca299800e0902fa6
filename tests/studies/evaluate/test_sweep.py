"""How a study is cut into tasks and put together again."""

import pickle
from dataclasses import replace
from itertools import permutations

import pytest

from tests.studies.evaluate.signals import walk, wall
from weberlink.studies.evaluate.study import Recording, Row, Study, length, rows_of

RECORDINGS = [Recording("wall", wall(150)), Recording("walk", walk(200, seed=1))]
STUDY = Study(("plane", "zoh", "hybrid"), (0.20, 0.05))


def timeless(rows: list[Row]) -> list[Row]:
    """Without the one figure that is measured."""
    return [replace(row, tick_us=0.0) for row in rows]


def test_rows_come_traces_outermost_then_predictors_then_weber_factors() -> None:
    tasks = STUDY.tasks(RECORDINGS)
    rows = STUDY.ordered(dict(enumerate(map(rows_of, tasks))))
    assert [(row.trace, row.predictor, row.weber) for row in rows] == [
        (trace, predictor, weber)
        for trace in ("wall", "walk")
        for predictor in ("plane", "zoh", "hybrid")
        for weber in (0.20, 0.05)
    ]
    one_by_one = [row for recording in RECORDINGS for row in STUDY.rows(recording)]
    assert timeless(rows) == timeless(one_by_one)


def test_the_order_in_which_tasks_end_does_not_matter() -> None:
    results = dict(enumerate(map(rows_of, STUDY.tasks(RECORDINGS))))
    expected = STUDY.ordered(results)
    for order in permutations(results):
        assert STUDY.ordered({index: results[index] for index in order}) == expected


def test_a_row_does_not_depend_on_what_else_is_studied() -> None:
    both = [row for row in STUDY.rows(RECORDINGS[1]) if (row.predictor, row.weber) == ("plane", 0.05)]
    alone = list(Study(("plane",), (0.05,)).rows(RECORDINGS[1]))
    assert timeless(both) == timeless(alone)


def test_a_task_travels() -> None:
    task = STUDY.tasks(RECORDINGS)[1]
    assert timeless(rows_of(pickle.loads(pickle.dumps(task)))) == timeless(rows_of(task))


def test_a_task_is_as_long_as_what_is_coded() -> None:
    assert [length(task) for task in STUDY.tasks(RECORDINGS)] == [450.0, 450.0, 600.0, 600.0]


def test_a_person_is_judged_alike_in_every_row() -> None:
    """Half the JND doubles the errors in units of it, where the floor does not count."""
    recording = Recording("walk", replace(walk(200, seed=1), force_n=walk(200, seed=1).force_n + 5.0))
    keen, dull = (list(Study(("zoh",), (0.05, 0.20), jnd=jnd).rows(recording)) for jnd in (0.05, 0.10))
    for one, other in zip(keen, dull, strict=True):
        assert one.error_rms_jnd == pytest.approx(2.0 * other.error_rms_jnd)
        assert one.packets == other.packets
