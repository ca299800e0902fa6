"""Schedules garbage collection in the slack between two ticks."""

import gc
from time import perf_counter

CAUTION = 2.0
"""A pass is expected to take up to this many times as long as the one before it."""
FIRST_GUESS_S = 1e-4


def freeze_garbage() -> None:
    """Collect once, exempt everything that lives now from later passes, and turn automatic collection off."""
    gc.collect()
    gc.freeze()
    gc.disable()


def thaw_garbage() -> None:
    """Undo `freeze_garbage`."""
    gc.unfreeze()
    gc.enable()


class Passes:
    """Count of the passes over one generation, and how long the last one took [s]."""

    __slots__ = ("count", "generation", "last_s")

    def __init__(self, generation: int) -> None:
        self.generation, self.count, self.last_s = generation, 0, FIRST_GUESS_S


class GarbageSchedule:
    """Runs a pass when one is due and fits into the slack.

    A pass that never fits runs anyway after `patience` intervals: one late tick is better than memory that grows until
    the process dies.

    Args:
        every_ticks: interval between passes [ticks], >= 1.
        full_every: one pass in so many is a full one, >= 1; the others are young ones.
        patience: intervals after which a pass is forced, >= 1.

    Raises:
        ValueError: naming the argument.
    """

    __slots__ = ("_due", "_full_every", "_overdue", "_waited", "full", "young")

    def __init__(self, every_ticks: int, *, full_every: int = 100, patience: int = 10) -> None:
        for name, value in (("every_ticks", every_ticks), ("full_every", full_every), ("patience", patience)):
            if value < 1:
                raise ValueError(f"{name} must be at least 1, got {value}")
        self._due = every_ticks
        self._overdue = every_ticks * patience
        self._full_every = full_every
        self._waited = 0
        self.young = Passes(0)
        self.full = Passes(2)

    def tick(self, slack_s: float) -> None:
        """Call after each tick with the time left until the next deadline [s]."""
        self._waited += 1
        if self._waited < self._due:
            return
        full = (self.young.count + self.full.count + 1) % self._full_every == 0
        passes = self.full if full else self.young
        if slack_s < CAUTION * passes.last_s and self._waited < self._overdue:
            return
        began = perf_counter()
        gc.collect(passes.generation)
        passes.last_s = perf_counter() - began
        passes.count += 1
        self._waited = 0
