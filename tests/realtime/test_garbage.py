"""When garbage is collected."""

import weakref
from math import inf

import pytest

from weberlink.realtime.garbage import FULL, FULL_EVERY, PATIENCE, YOUNG, GarbageSchedule, freeze_garbage, thaw_garbage


@pytest.fixture(autouse=True)
def frozen(refrozen):
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
    assert schedule.counts[YOUNG] == 3
    assert schedule.last_s[YOUNG] > 0.0


def test_without_slack_a_pass_is_forced_in_the_end():
    schedule = GarbageSchedule(5)
    counts = []
    for _ in range(2 * 5 * PATIENCE):
        schedule.tick(-1.0)
        counts.append(schedule.counts[YOUNG])
    assert (counts[5 * PATIENCE - 2], counts[-1]) == (0, 2), "it waits for slack"


def test_every_so_many_passes_one_is_full():
    schedule = GarbageSchedule(1)
    survivor = Cycle()
    schedule.tick(inf)
    schedule.tick(inf)  # the survivor grows older than a young pass looks
    dead = weakref.ref(survivor)
    del survivor
    for _ in range(FULL_EVERY - 3):
        schedule.tick(inf)
    assert dead() is not None
    schedule.tick(inf)
    assert dead() is None
    assert schedule.counts == {YOUNG: FULL_EVERY - 1, FULL: 1}
