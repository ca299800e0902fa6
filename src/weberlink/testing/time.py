"""Times of ticks for drivers, of a clock that only counts or of the real one, and waiting for what must come."""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from threading import Event, Thread
from time import monotonic, sleep
from typing import TypeVar

import pytest

T = TypeVar("T")

TICK = 0.001
PATIENCE = 180.0  # until a test gives up on what must come [s]; says nothing about how fast the program has to be
PAUSE = 0.01


def virtual_time() -> Callable[[], float]:
    """Times one tick apart [s]."""
    count = iter(range(1_000_000))
    return lambda: 100.0 + next(count) * TICK


def real_time() -> Callable[[], float]:
    """Times of CLOCK_MONOTONIC [s] at least one tick apart; each call waits for its own."""
    due = monotonic()

    def tick() -> float:
        nonlocal due
        due = max(due + TICK, monotonic())
        sleep(max(0.0, due - monotonic()))
        return monotonic()

    return tick


@contextmanager
def ahead_of_other_work() -> Iterator[None]:
    """This thread, and all that it starts meanwhile, goes before ordinary work of a busy machine, where it may."""
    policy, parameters = os.sched_getscheduler(0), os.sched_getparam(0)
    with suppress(PermissionError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
    try:
        yield
    finally:
        os.sched_setscheduler(0, policy, parameters)


@contextmanager
def running_time() -> Iterator[Callable[[], float]]:
    """Gives the time since the beginning [s], of which a stall of this machine counts for `PAUSE`."""
    ran, ended = 0.0, Event()

    def count() -> None:
        nonlocal ran
        while not ended.wait(PAUSE):
            ran += PAUSE

    counting = Thread(target=count, daemon=True)
    counting.start()
    try:
        yield lambda: ran
    finally:
        ended.set()
        counting.join()


def until(condition: Callable[[], T], what: str, *, patience: float = PATIENCE, pause: float = PAUSE) -> T:
    """The first value of the condition that counts as true; the test fails after `patience` [s]."""
    deadline = monotonic() + patience
    while not (value := condition()):
        if monotonic() > deadline:
            pytest.fail(f"waited {patience:g} s for {what}")
        sleep(pause)
    return value
