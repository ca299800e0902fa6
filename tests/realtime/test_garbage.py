"""When garbage is collected."""

import weakref
from math import inf

import pytest

from weberlink.realtime.garbage import GarbageSchedule, freeze_garbage, thaw_garbage


@pytest.fixture(autouse=True)
def frozen():
    freeze_garbage()
    yield
    thaw_garbage()


class Cycle:
    def __init__(self):
        self.me = self


def test_a_pass_runs_after_every_so_many_ticks_and_frees_cycles():
    dead = weakref.ref(Cycle())
    schedule = GarbageSchedule(5)
    for _ in range(4):
        schedule.tick(inf)
    assert dead() is not None
    schedule.tick(inf)
    assert dead() is None
    for _ in range(10):
        schedule.tick(inf)
    assert schedule.young.count == 3
    assert schedule.young.last_s > 0.0


def test_without_slack_a_pass_is_forced_in_the_end():
    schedule = GarbageSchedule(5, patience=4)
    counts = []
    for _ in range(40):
        schedule.tick(-1.0)
        counts.append(schedule.young.count)
    assert (counts[18], counts[-1]) == (0, 2), "it waits for slack"


def test_every_so_many_passes_one_is_full():
    schedule = GarbageSchedule(1, full_every=4)
    survivor = Cycle()
    schedule.tick(inf)  # the survivor grows older than a young pass looks
    schedule.tick(inf)
    dead = weakref.ref(survivor)
    del survivor
    schedule.tick(inf)
    schedule.tick(inf)
    assert dead() is None
    assert (schedule.young.count, schedule.full.count) == (3, 1)


@pytest.mark.parametrize("name", ["every_ticks", "full_every", "patience"])
def test_interval_of_zero_is_refused(name):
    with pytest.raises(ValueError, match=name):
        GarbageSchedule(**{"every_ticks": 1, name: 0})
