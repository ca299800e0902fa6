"""One signal through the codec tick by tick: displayed forces, sends, models in use, and a window worth drawing."""

from collections.abc import Iterable
from dataclasses import dataclass
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


@dataclass(frozen=True)
class CodedTrace:
    """A signal and what the decoder displayed of it on a lossless link; n ticks.

    Args:
        bank: names of the predictors, in the order of selectors.
        time_s: shape (n,).
        force_n: measured, shape (n, 3).
        displayed_n: decoded, after the update of the tick if there was one, shape (n, 3).
        predicted_n: decoded, before any update of the tick, shape (n, 3).
        position_m: shape (n, 3).
        bound_n: radius of the deadband about the measured force, shape (n,).
        sent: whether an update was sent, shape (n,).
        selected: index in `bank` of the predictor in use, after the update of the tick, shape (n,).
    """

    bank: tuple[str, ...]
    time_s: Array
    force_n: Array
    displayed_n: Array
    predicted_n: Array
    position_m: Array
    bound_n: Array
    sent: NDArray[np.bool_]
    selected: NDArray[np.int64]
    adaptive: bool = False

    @property
    def predictor(self) -> str:
        return self.bank[0] if len(self.bank) == 1 else ADAPTIVE if self.adaptive else HYBRID

    @property
    def packets(self) -> int:
        return int(self.sent.sum())


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


def follow(trace: Trace, channel: Channel) -> CodedTrace:
    """Run a trace through a fresh encoder and decoder of `channel`, sample by sample as in a daemon."""
    ticks = list(code(channel, signal_of(trace).samples))
    return CodedTrace(
        bank=channel.bank,
        time_s=trace.time_s,
        force_n=trace.force_n,
        displayed_n=np.array([tick.displayed for tick in ticks]),
        predicted_n=np.array([tick.predicted for tick in ticks]),
        position_m=trace.position_m,
        bound_n=np.array([tick.bound for tick in ticks]),
        sent=np.array([tick.update is not None for tick in ticks]),
        selected=np.array([tick.selected for tick in ticks]),
        adaptive=channel.adaptive,
    )


def fits(trace: Trace, channel: Channel) -> list[ModelFit]:
    """All models of a run, in order of time."""
    found: list[ModelFit] = []
    for tick in code(channel, signal_of(trace).samples):
        update = tick.update
        if update is None:
            continue
        if found:
            found[-1] = found[-1]._replace(until=update.tick)
        assert tick.model is not None
        payload, grid = update.payload, channel.grid
        previous = None
        if isinstance(payload, PreviousSample):
            previous = grid.sample(update.tick - payload.gap, payload.levels)
        newest = grid.sample(update.tick, update.newest)
        found.append(ModelFit(channel.bank[update.selector], tick.model, newest, previous, len(trace.time_s)))
    return found


def model_at(trace: Trace, channel: Channel, tick: int) -> ModelFit:
    """The model in use at a tick, after the update of that tick if there was one.

    Raises:
        ValueError: nothing was sent before, or the trace has no such tick.
    """
    count = len(trace.time_s)
    if not 0 <= tick < count:
        raise ValueError(f"tick {tick}: expected 0 to {count - 1}")
    for fit in fits(trace, channel):
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
    count = len(coded.time_s)
    length = min(count, max(1, round(seconds / float(np.median(np.diff(coded.time_s))))))
    force = np.linalg.norm(coded.force_n, axis=1)
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
