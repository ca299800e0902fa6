"""Times of ticks for drivers: of a clock that only counts, or of the real one, waited for."""

from collections.abc import Callable
from time import monotonic, sleep

TICK = 0.001


def virtual_time(start: float = 100.0) -> Callable[[], float]:
    count = iter(range(1_000_000))
    return lambda: start + next(count) * TICK


def real_time() -> Callable[[], float]:
    due = monotonic()

    def tick() -> float:
        nonlocal due
        due = max(due + TICK, monotonic())
        sleep(max(0.0, due - monotonic()))
        return monotonic()

    return tick
