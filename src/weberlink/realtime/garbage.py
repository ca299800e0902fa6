"""Schedules garbage collection in the slack between two ticks."""

import gc
from time import perf_counter

FULL_EVERY = 100  # one pass in so many looks at all generations; the others are young ones
PATIENCE = 10  # intervals after which a pass is forced: one late tick is better than memory that grows without end
CAUTION = 2.0  # a pass is expected to take up to this many times as long as the one before it
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
    """Runs a pass every `every_ticks` [ticks], when it fits into the slack, or when it has waited for too long."""

    __slots__ = ("_due", "_waited", "full", "young")

    def __init__(self, every_ticks: int) -> None:
        self._due = every_ticks
        self._waited = 0
        self.young = Passes(0)
        self.full = Passes(2)

    def tick(self, slack_s: float) -> None:
        """Call after each tick with the time left until the next deadline [s]."""
        self._waited += 1
        if self._waited < self._due:
            return
        full = (self.young.count + self.full.count + 1) % FULL_EVERY == 0
        passes = self.full if full else self.young
        if slack_s < CAUTION * passes.last_s and self._waited < PATIENCE * self._due:
            return
        began = perf_counter()
        gc.collect(passes.generation)
        passes.last_s = perf_counter() - began
        passes.count += 1
        self._waited = 0
