"""Schedules garbage collection in the slack between two ticks."""

import gc
from time import perf_counter

YOUNG, FULL = 0, 2  # oldest generation that a pass looks at
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


class GarbageSchedule:
    """Runs a pass every `every_ticks` [ticks], when it fits into the slack, or when it has waited for too long.

    Attributes:
        counts, last_s: passes so far over the generations up to `YOUNG` and `FULL`, and how long the last one took [s].
    """

    __slots__ = ("_due", "_waited", "counts", "last_s")

    def __init__(self, every_ticks: int) -> None:
        self._due, self._waited = every_ticks, 0
        self.counts = {YOUNG: 0, FULL: 0}
        self.last_s = dict.fromkeys(self.counts, FIRST_GUESS_S)

    def tick(self, slack_s: float) -> None:
        """Call after each tick with the time left until the next deadline [s]."""
        self._waited += 1
        if self._waited < self._due:
            return
        generation = YOUNG if (sum(self.counts.values()) + 1) % FULL_EVERY else FULL
        if slack_s < CAUTION * self.last_s[generation] and self._waited < PATIENCE * self._due:
            return
        began = perf_counter()
        gc.collect(generation)
        self.last_s[generation] = perf_counter() - began
        self.counts[generation] += 1
        self._waited = 0
