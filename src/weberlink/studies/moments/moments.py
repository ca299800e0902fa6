"""One signal through the codec tick by tick: displayed forces, sends, models in use, and a window worth drawing."""

from collections.abc import Iterable
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from weberlink.codec import Channel
from weberlink.codec.predictors import ADAPTIVE, HYBRID, Model
from weberlink.codec.predictors.model import ModelKind
from weberlink.codec.replay import code
from weberlink.codec.sample import Sample
from weberlink.master.trace import Trace
from weberlink.studies.evaluate.replay import signal_of
from weberlink.studies.moments.surfaces import FittedSurface
from weberlink.update import PreviousSample

CONTACT_SHARE = 0.05
"""Of the largest force of the signal; smaller forces do not count as contact."""
CONTACT_TIME = 0.75
FEWEST_SENDS = 3

Array = NDArray[np.float64]


class ModelFit(NamedTuple):
    """A model, in use from the tick of `newest` up to, not including, `until`."""

    predictor: str
    model: Model
    newest: Sample
    previous: Sample | None
    """The other sample of the fit; None where the update carried none."""
    until: int

    @property
    def ticks(self) -> int:
        return self.until - self.newest.tick

    @property
    def surface(self) -> FittedSurface | None:
        """None for a model without a contact surface."""
        surface = self.model.surface()
        return None if surface is None else FittedSurface(surface.record())


class TickWindow(NamedTuple):
    """Ticks first <= tick < until."""

    first: int
    until: int


class CodedTrace:
    """A trace coded by a fresh encoder and decoder on a lossless link, sample by sample as in a daemon; n ticks.

    Attributes:
        displayed_n: decoded force, after the update of the tick if there was one, shape (n, 3).
        predicted_n: decoded force, before any update of the tick, shape (n, 3).
        bound_n: radius of the deadband about the measured force, shape (n,).
        sent: whether an update was sent, shape (n,).
        selected: index in the bank of the predictor in use, after the update of the tick, shape (n,).
    """

    def __init__(self, trace: Trace, channel: Channel) -> None:
        self.trace, self.channel = trace, channel
        self._ticks = list(code(channel, signal_of(trace).samples))
        self.displayed_n: Array = np.array([tick.displayed for tick in self._ticks])
        self.predicted_n: Array = np.array([tick.predicted for tick in self._ticks])
        self.bound_n: Array = np.array([tick.bound for tick in self._ticks])
        self.sent = np.array([tick.update is not None for tick in self._ticks])
        self.selected = np.array([tick.selected for tick in self._ticks])

    @property
    def bank(self) -> tuple[str, ...]:
        return self.channel.bank

    @property
    def predictor(self) -> str:
        return self.bank[0] if len(self.bank) == 1 else ADAPTIVE if self.channel.adaptive else HYBRID

    @cached_property
    def fits(self) -> list[ModelFit]:
        """All models in order of time."""
        found: list[ModelFit] = []
        for tick in self._ticks:
            if tick.update is None:
                continue
            assert tick.model is not None
            update, payload, grid = tick.update, tick.update.payload, self.channel.grid
            previous = None
            if isinstance(payload, PreviousSample):
                previous = grid.sample(update.tick - payload.gap, payload.levels)
            if found:
                found[-1] = found[-1]._replace(until=update.tick)
            newest = grid.sample(update.tick, update.newest)
            found.append(ModelFit(self.bank[update.selector], tick.model, newest, previous, len(self._ticks)))
        return found

    def fit_at(self, tick: int) -> ModelFit:
        """The model in use at a tick, after the update of that tick if there was one.

        Raises:
            ValueError: nothing was sent before, or the trace has no such tick.
        """
        if not 0 <= tick < len(self._ticks):
            raise ValueError(f"tick {tick}: expected 0 to {len(self._ticks) - 1}")
        for fit in self.fits:
            if fit.newest.tick <= tick < fit.until:
                return fit
        raise ValueError(f"tick {tick}: no model yet; nothing had been sent by then")


def with_surface(candidates: Iterable[ModelFit], kind: ModelKind | None = None) -> list[ModelFit]:
    """The fits that describe a plane or sphere, or only those of one of the two kinds."""
    found = ((fit, fit.surface) for fit in candidates)
    return [fit for fit, surface in found if surface is not None and kind in (None, surface.kind)]


def longest(candidates: Iterable[ModelFit], kind: ModelKind | None = None) -> ModelFit | None:
    """The plane or sphere that was in use longest, the first of equals; None without any.

    A model that predicts for long without a send describes the surface well.
    """
    return max(with_surface(candidates, kind), key=lambda fit: fit.ticks, default=None)


def interesting_window(coded: CodedTrace, seconds: float) -> TickWindow:
    """The window in which |force| varies most; the earliest of equals.

    Only windows count that are in contact (|force| above `CONTACT_SHARE` of the largest of the signal) for at least
    `CONTACT_TIME` of their ticks and have at least `FEWEST_SENDS` sends. If there is none, those with most sends count.

    Args:
        coded: a run.
        seconds: length, more than 0; the whole run if that is shorter.

    Raises:
        ValueError: the length is not positive.
    """
    if not seconds > 0.0:
        raise ValueError(f"seconds: expected more than 0, got {seconds!r}")
    count = len(coded.trace.time_s)
    length = min(count, max(1, round(seconds / float(np.median(np.diff(coded.trace.time_s))))))
    force = np.linalg.norm(coded.trace.force_n, axis=1)
    windows = np.lib.stride_tricks.sliding_window_view(force, length)
    contact = _sums(force > CONTACT_SHARE * force.max(), length)
    sends = _sums(coded.sent, length)
    allowed = (contact >= CONTACT_TIME * length) & (sends >= FEWEST_SENDS)
    if not allowed.any():
        allowed = sends == sends.max()
    spread = np.where(allowed, windows.max(axis=1) - windows.min(axis=1), -1.0)
    first = int(np.argmax(spread))
    return TickWindow(first, first + length)


def _sums(flags: NDArray[np.bool_], length: int) -> NDArray[np.int64]:
    """The number of set flags in each window of a length."""
    before = np.concatenate(([0], np.cumsum(flags, dtype=np.int64)))
    return before[length:] - before[:-length]
