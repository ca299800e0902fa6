"""Late wake-ups and steal time."""

from itertools import islice, pairwise
from pathlib import Path
from time import monotonic, sleep

import pytest

from tests.wait import PATIENCE
from weberlink_figures.host import Steal, wake_ups

LINES = """cpu  100 0 20 1000 5 0 3 {steal} 7 0
cpu0 60 0 10 400 5 0 1 {steal} 7 0
cpu1 40 0 10 600 0 0 2 0 0 0
intr 12345 0 0
"""


def statistics(folder: Path, text: str) -> Path:
    path = folder / "stat"
    path.write_text(text, encoding="ascii")
    return path


def test_steal_is_that_of_the_processors_alone(tmp_path: Path) -> None:
    path = statistics(tmp_path, LINES.format(steal=24))
    assert Steal.read({0}, path) == (24, 500)  # guest time is part of user time, and is not added again
    assert Steal.read({0, 1}, path) == (24, 1152)
    assert Steal.read({1}, path) == (0, 652)  # the machine counts steal; this processor lost none


@pytest.mark.parametrize(
    "text",
    [LINES.format(steal=0), "", "cpu  1 2 3 4 5 6 7\ncpu0 1 2 3 4 5 6 7\n", "cpu  a b c d e f g h\n"],
    ids=["zeros", "empty", "kernel without steal", "no numbers"],
)
def test_steal_that_was_never_counted_is_unknown(tmp_path: Path, text: str) -> None:
    assert Steal.read({0}, statistics(tmp_path, text)) is None
    assert Steal.read({0}, tmp_path / "none") is None


def test_share_of_steal_is_of_the_time_that_passed() -> None:
    assert Steal(30, 1200).share_since(Steal(10, 1000)) == pytest.approx(0.1)
    assert Steal(10, 1000).share_since(Steal(10, 1000)) is None
    assert Steal(5, 1200).share_since(Steal(10, 1000)) == 0.0  # some hosts let it fall after a migration


def test_wake_ups_keep_their_phase_and_replay_nothing() -> None:
    first, interval = monotonic() + 0.01, 0.005
    seen = []
    for wake_up in islice(wake_ups(first, interval, first + PATIENCE), 15):
        seen.append(wake_up)
        if len(seen) == 3:
            sleep(0.022)  # the reader is slow
    for before, wake_up in pairwise(seen):
        assert wake_up.ran == before.woken < wake_up.woken
        assert wake_up.due > before.due
    for wake_up in seen:
        steps = (wake_up.due - first) / interval
        assert wake_up.woken >= wake_up.due and steps == pytest.approx(round(steps), abs=1e-6)
    assert seen[3].late >= 0.01 and seen[-1].due >= first + 16.5 * interval
