"""Parts of the study: the rows that each of them makes of one signal, in any process."""

from collections.abc import Callable, Iterator
from typing import NamedTuple

from weberlink.codec import Channel, Encoder
from weberlink.codec.predictors import ADAPTIVE, HYBRID
from weberlink.codec.smoothing import Smoothing
from weberlink.studies.adaptive.coding import CodedSignal, coded, equal_packets
from weberlink.studies.adaptive.comparison import MatchRow, RateRow
from weberlink.studies.adaptive.signals import NOISE_N, AdaptiveScope, SignalKey, SignalSource, recordings, scenes
from weberlink.studies.adaptive.variants import (
    ABLATIONS,
    COMPARED,
    FLOOR_N,
    SINGLES,
    TUNINGS,
    WEBER,
    Alteration,
    altered,
    altered_channel,
    channel_of,
)
from weberlink.studies.evaluate.clairvoyant import clairvoyant_sends
from weberlink.studies.evaluate.replay import Signal
from weberlink.studies.evaluate.traces import NamedTrace
from weberlink.system.scoring.perception import Threshold

RATES, QUIET, ABLATION, TUNING, UNSEEN, LIMITS, EQUAL, SMOOTH = (
    "rates", "noise-free", "ablation", "tuning", "further seeds", "limits", "equal packets", "smooth updates",
)  # fmt: skip
"""Names of the parts."""
SMOOTH_RUNS = 5
_COST = {RATES: 11.0, QUIET: 3.5, ABLATION: 14.0, TUNING: 7.0, UNSEEN: 3.5, LIMITS: 8.0, EQUAL: 5.0, SMOOTH: 12.0}
"""Approximate run time of a part, in runs of `adaptive`."""


class SignalTask(NamedTuple):
    """Parts of the study that share one signal."""

    source: SignalSource
    parts: tuple[str, ...]
    scope: AdaptiveScope


class Piece(NamedTuple):
    """One part of the study on one signal."""

    part: str
    key: SignalKey
    signal: Signal
    scope: AdaptiveScope


Rows = list[RateRow] | list[MatchRow]


def tasks(given: list[NamedTrace], scope: AdaptiveScope) -> list[SignalTask]:
    """All of the work."""
    main = recordings(given, scope) + scenes(scope, NOISE_N)
    first = min((source.seed for source in main if source.key.half == "reported" and source.seed), default=0)
    work = [(source, _parts(source, first, scope)) for source in main]
    work += [(source, (QUIET,)) for source in scenes(scope, 0.0)]
    work += [(source, (UNSEEN,)) for source in scenes(scope, NOISE_N, scope.more_seeds)]
    return [SignalTask(source, parts, scope) for source, parts in work]


def _parts(source: SignalSource, first: int, scope: AdaptiveScope) -> tuple[str, ...]:
    """The parts for a signal; recordings and the first reported seed have the most."""
    if source.key.half == "chosen":
        return (RATES, TUNING)
    if source.seed not in (0, first):
        return (RATES, ABLATION, EQUAL)
    return (RATES, ABLATION, EQUAL, SMOOTH, *((LIMITS,) if scope.limits else ()))


def length(task: SignalTask) -> float:
    """Approximate run time, in ticks of `adaptive`."""
    return task.source.ticks * sum(_COST[part] for part in task.parts)


def done(task: SignalTask) -> list[RateRow | MatchRow]:
    """The rows of one signal."""
    signal = task.source.signal()
    return [row for part in task.parts for row in _PARTS[part](Piece(part, task.source.key, signal, task.scope))]


def smoothed_name(ticks: int, share: float) -> str:
    """Name of `adaptive` with a ramp of `ticks` that may use `share` of the deadband."""
    return f"{ADAPTIVE}, ramp {ticks} ticks, {share:g}"


def _rates(piece: Piece) -> list[RateRow]:
    return [
        _run(piece, variant, channel_of(variant, floor=floor), floor)
        for floor in piece.scope.floors_n
        for variant in COMPARED
    ]


def _few(piece: Piece) -> list[RateRow]:
    return [_run(piece, variant, channel_of(variant)) for variant in (HYBRID, ADAPTIVE, *SINGLES)]


def _altered(alterations: dict[str, Alteration]) -> Callable[[Piece], list[RateRow]]:
    return lambda piece: [
        _run(piece, name, altered_channel(each), encoder=altered(each)) for name, each in alterations.items()
    ]


def _limits(piece: Piece) -> list[RateRow]:
    signal = piece.signal
    families = ("zoh", "linear", HYBRID)
    fewest = clairvoyant_sends(signal.force_n, signal.position_m, channel=channel_of(HYBRID), families=families)
    return [_rate(piece, family, FLOOR_N, packets, 0) for family, packets in fewest.items() if packets is not None]


def _run(
    piece: Piece, variant: str, channel: Channel, floor: float = FLOOR_N, encoder: Encoder | None = None
) -> RateRow:
    found = coded(piece.signal, channel, encoder)
    return _rate(piece, variant, floor, found.packets, found.outside)


def _rate(piece: Piece, variant: str, floor: float, packets: int, outside: int) -> RateRow:
    return RateRow(piece.part, *piece.key, variant, floor, packets, packets / piece.signal.duration_s, outside)


def _equal(piece: Piece) -> list[MatchRow]:
    reference = _at(piece.signal, HYBRID, WEBER)
    weber, found = equal_packets(reference.packets, lambda weber: _at(piece.signal, ADAPTIVE, weber), WEBER / 2.0)
    return [_match(piece, HYBRID, WEBER, reference), _match(piece, ADAPTIVE, weber, found)]


def _smooth(piece: Piece) -> list[MatchRow]:
    return list(_smoothed(piece))


def _smoothed(piece: Piece) -> Iterator[MatchRow]:
    target, weber = _at(piece.signal, HYBRID, WEBER).packets, WEBER / 2.0
    for ticks, share in piece.scope.smoothings:
        smoothing = Smoothing(ticks, share)

        def run(weber: float, smoothing: Smoothing = smoothing) -> CodedSignal:
            return _at(piece.signal, ADAPTIVE, weber, smoothing)

        # The factor of the ramp before is a good start.
        weber, found = equal_packets(target, run, weber, SMOOTH_RUNS)
        yield _match(piece, smoothed_name(ticks, share), weber, found)


def _at(signal: Signal, variant: str, weber: float, smoothing: Smoothing | None = None) -> CodedSignal:
    """Code with a Weber factor; the floor shrinks in proportion."""
    return coded(signal, channel_of(variant, weber, FLOOR_N * weber / WEBER, smoothing))


def _match(piece: Piece, variant: str, weber: float, found: CodedSignal) -> MatchRow:
    key, signal = piece.key, piece.signal
    return MatchRow(
        key.name, key.group, key.half, key.kind, variant, weber, found.packets, found.packets / signal.duration_s,
        *found.felt(signal, Threshold()), outside=found.outside,
    )  # fmt: skip


_PARTS: dict[str, Callable[[Piece], Rows]] = {
    RATES: _rates,
    QUIET: _few,
    ABLATION: _altered(ABLATIONS),
    TUNING: _altered(TUNINGS),
    UNSEEN: _few,
    LIMITS: _limits,
    EQUAL: _equal,
    SMOOTH: _smooth,
}
