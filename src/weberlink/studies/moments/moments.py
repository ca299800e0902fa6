"""One signal through the codec, tick by tick: what was displayed, when it was sent, and which model said so.

Owns the run behind a drawing of forces over time or of a fitted model, and the choice of a moment worth drawing. The
encoder and decoder are the daemons' own. It knows neither scenes nor figures.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from weberlink.codec import Channel, Decoder, Encoder
from weberlink.codec.predictors import ADAPTIVE, HYBRID, Model
from weberlink.codec.sample import Sample
from weberlink.geometry.vector import ZERO, Vector
from weberlink.master.trace import Trace
from weberlink.update import PreviousSample, Update

CONTACT_SHARE = 0.05
"""Of the largest force of the signal; less is not called contact here."""
CONTACT_TIME = 0.75
FEWEST_SENDS = 3

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Coded:
    """A signal and what the other end made of it on a lossless link; n ticks.

    Args:
        bank: names of the predictors, in the order that `selected` counts.
        time_s: shape (n,).
        force_n: measured, shape (n, 3).
        displayed_n: decoded, after the update of the tick if there was one, shape (n, 3).
        predicted_n: decoded, before any update of the tick, shape (n, 3).
        position_m: shape (n, 3).
        bound_n: radius of the deadband about the measured force, shape (n,).
        sent: whether an update went out, shape (n,).
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


class Fit(NamedTuple):
    """A model, and the ticks during which it was in force: from the send of `newest` up to, not including, `until`."""

    predictor: str
    model: Model
    newest: Sample
    previous: Sample | None
    """What else the model was fitted to; None where the update carried no second sample."""
    until: int

    @property
    def ticks(self) -> int:
        return self.until - self.newest.tick


class Window(NamedTuple):
    """Ticks first <= tick < until."""

    first: int
    until: int


class _Tick(NamedTuple):
    update: Update | None
    predicted: Vector
    displayed: Vector
    bound: float
    selected: int
    model: Model | None


def follow(trace: Trace, channel: Channel) -> Coded:
    """Run a trace through a fresh encoder and decoder of `channel`, sample by sample as a daemon would."""
    ticks = list(_run(trace, channel))
    return Coded(
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


def fits(trace: Trace, channel: Channel) -> list[Fit]:
    """Every model of a run, in order of time."""
    sent = [(tick.update, tick.model) for tick in _run(trace, channel) if tick.update is not None]
    begins = [update.tick for update, _ in sent] + [len(trace.time_s)]
    return [_fit(channel, update, model, until) for (update, model), until in zip(sent, begins[1:], strict=True)]


def model_at(trace: Trace, channel: Channel, tick: int) -> Fit:
    """The model in force at a tick, after the update of that tick if there was one.

    Raises:
        ValueError: if nothing had been sent by then, or the trace has no such tick.
    """
    count = len(trace.time_s)
    if not 0 <= tick < count:
        raise ValueError(f"tick {tick}: expected 0 to {count - 1}")
    for fit in fits(trace, channel):
        if fit.newest.tick <= tick < fit.until:
            return fit
    raise ValueError(f"tick {tick}: no model yet; nothing had been sent by then")


def longest(candidates: Sequence[Fit], kind: type[Model]) -> Fit | None:
    """The model of a kind, such as `Plane`, that was in force longest; the first of equals, None without any.

    What holds for long without a send describes the surface well: a rule that needs no knowledge of the scene.
    """
    return max((fit for fit in candidates if isinstance(fit.model, kind)), key=lambda fit: fit.ticks, default=None)


def interesting_window(coded: Coded, seconds: float) -> Window:
    """Where contact and sends can be seen: of all windows of that length, the one in which |force| varies most.

    Only windows count that are in contact (|force| above `CONTACT_SHARE` of the largest of the signal) for at least
    `CONTACT_TIME` of their ticks and have at least `FEWEST_SENDS` sends. Where there is none, the windows with the
    most sends. The earliest of equals.

    Args:
        coded: a run.
        seconds: length, more than 0; the whole run where it is shorter.

    Raises:
        ValueError: for a length that is none.
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
    return Window(first, first + length)


def _run(trace: Trace, channel: Channel) -> Iterator[_Tick]:
    encoder, decoder = Encoder(channel), Decoder(channel)
    forces: list[list[float]] = trace.force_n.tolist()
    positions: list[list[float]] = trace.position_m.tolist()
    for tick, (f, p) in enumerate(zip(forces, positions, strict=True)):
        position: Vector = (p[0], p[1], p[2])
        predicted = decoder.value(tick, position) or ZERO
        update = encoder.encode(tick, (f[0], f[1], f[2]), position)
        if update is not None:
            decoder.apply(update)
        selected, model, *_ = decoder.state
        yield _Tick(update, predicted, decoder.value(tick, position) or ZERO, encoder.bound, selected, model)


def _fit(channel: Channel, update: Update, model: Model | None, until: int) -> Fit:
    assert model is not None
    payload, grid = update.payload, channel.grid
    previous = grid.sample(update.tick - payload.gap, payload.levels) if isinstance(payload, PreviousSample) else None
    return Fit(channel.bank[update.selector], model, grid.sample(update.tick, update.newest), previous, until)


def _sums(flags: NDArray[np.bool_], length: int) -> NDArray[np.int64]:
    """How many are set in each window of a length."""
    before = np.concatenate(([0], np.cumsum(flags, dtype=np.int64)))
    return before[length:] - before[:-length]
