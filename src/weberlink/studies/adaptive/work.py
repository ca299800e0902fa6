"""All that is done with one signal, in whatever process: each part of the study makes rows of it."""

from collections.abc import Callable, Iterator
from typing import NamedTuple

from weberlink.codec import Encoder
from weberlink.codec.predictors import ADAPTIVE, HYBRID
from weberlink.codec.smoothing import Smoothing
from weberlink.studies.adaptive.coding import Coded, coded
from weberlink.studies.adaptive.packets import equal_packets
from weberlink.studies.adaptive.rows import Match, Rate, rate
from weberlink.studies.adaptive.signals import NOISE_N, Scope, Source, recordings, scenes
from weberlink.studies.adaptive.variants import (
    ABLATIONS,
    COMPARED,
    FLOOR_N,
    SINGLES,
    TUNINGS,
    WEBER,
    Part,
    altered,
    channel_of,
)
from weberlink.studies.evaluate.clairvoyant import clairvoyant_sends
from weberlink.studies.evaluate.replay import Signal
from weberlink.studies.evaluate.study import NamedTrace
from weberlink.system.scoring.perception import Threshold

RATES, QUIET, ABLATION, TUNING, UNSEEN, LIMITS, EQUAL, SMOOTH = (
    "rates", "noise-free", "ablation", "tuning", "further seeds", "limits", "equal packets", "smooth updates",
)  # fmt: skip
"""Parts of the study."""
SMOOTH_RUNS = 5
_COST = {RATES: 11.0, QUIET: 3.5, ABLATION: 14.0, TUNING: 7.0, UNSEEN: 3.5, LIMITS: 8.0, EQUAL: 5.0, SMOOTH: 12.0}
"""About how long a part takes, in runs of `adaptive`."""


class Task(NamedTuple):
    """Some parts of the study of one signal, which is made once for all of them."""

    source: Source
    parts: tuple[str, ...]
    scope: Scope


class Piece(NamedTuple):
    """One of them."""

    part: str
    source: Source
    scope: Scope


Found = list[Rate] | list[Match]


def tasks(given: list[NamedTrace], scope: Scope) -> list[Task]:
    """All of the work."""
    main = recordings(given, scope) + scenes(scope, NOISE_N)
    first = min((source.seed for source in main if source.key.half == "reported" and source.seed), default=0)
    work = [(source, _parts(source, first, scope)) for source in main]
    work += [(source, (QUIET,)) for source in scenes(scope, 0.0)]
    work += [(source, (UNSEEN,)) for source in scenes(scope, NOISE_N, scope.more_seeds)]
    return [Task(source, parts, scope) for source, parts in work]


def _parts(source: Source, first: int, scope: Scope) -> tuple[str, ...]:
    """What is asked of a signal; most of recordings and of the first seed that is reported on."""
    if source.key.half == "chosen":
        return (RATES, TUNING)
    if source.seed not in (0, first):
        return (RATES, ABLATION, EQUAL)
    return (RATES, ABLATION, EQUAL, SMOOTH, *((LIMITS,) if scope.limits else ()))


def length(task: Task) -> float:
    """A measure of what it costs."""
    return task.source.ticks * sum(_COST[part] for part in task.parts)


def done(task: Task) -> list[Rate | Match]:
    """The rows of one signal."""
    return [row for part in task.parts for row in _PARTS[part](Piece(part, task.source, task.scope))]


def _rates(piece: Piece) -> list[Rate]:
    return [
        _run(piece, variant, Encoder(channel_of(variant, floor=floor)), floor)
        for floor in piece.scope.floors_n
        for variant in COMPARED
    ]


def _few(piece: Piece) -> list[Rate]:
    return [_run(piece, variant, Encoder(channel_of(variant))) for variant in (HYBRID, ADAPTIVE, *SINGLES)]


def _altered(parts: dict[str, Part]) -> Callable[[Piece], list[Rate]]:
    """With each of these; `adaptive` as it is comes from the rates."""
    return lambda piece: [_run(piece, name, altered(part)) for name, part in parts.items()]


def _limits(piece: Piece) -> list[Rate]:
    signal = piece.source.signal()
    families = ("zoh", "linear", HYBRID)
    fewest = clairvoyant_sends(signal.force_n, signal.position_m, channel=channel_of(HYBRID), families=families)
    return [
        rate(piece.part, piece.source.key, family, FLOOR_N, packets, signal.duration_s)
        for family, packets in fewest.items()
        if packets is not None
    ]


def _run(piece: Piece, variant: str, encoder: Encoder, floor: float = FLOOR_N) -> Rate:
    signal = piece.source.signal()
    found = coded(signal, encoder)
    return rate(piece.part, piece.source.key, variant, floor, found.packets, signal.duration_s, found.outside)


def _equal(piece: Piece) -> list[Match]:
    signal = piece.source.signal()
    reference = _at(signal, HYBRID, WEBER)
    weber, found = equal_packets(reference.packets, lambda weber: _at(signal, ADAPTIVE, weber), WEBER / 2.0)
    return [_match(piece, HYBRID, WEBER, reference), _match(piece, ADAPTIVE, weber, found)]


def _smooth(piece: Piece) -> list[Match]:
    return list(_smoothed(piece))


def _smoothed(piece: Piece) -> Iterator[Match]:
    signal = piece.source.signal()
    target, first = _at(signal, HYBRID, WEBER).packets, WEBER / 2.0
    for ticks, share in piece.scope.smoothings:
        smoothing = Smoothing(ticks, share)

        def run(weber: float, smoothing: Smoothing = smoothing) -> Coded:
            return _at(signal, ADAPTIVE, weber, smoothing)

        # The one before is near.
        first, found = equal_packets(target, run, first, SMOOTH_RUNS)
        yield _match(piece, smoothed_name(ticks, share), first, found)


def smoothed_name(ticks: int, share: float) -> str:
    """Of `adaptive` with a ramp of so many ticks that may use this share of the deadband."""
    return f"{ADAPTIVE}, ramp {ticks} ticks, {share:g}"


def _at(signal: Signal, variant: str, weber: float, smoothing: Smoothing | None = None) -> Coded:
    """With a deadband that shrinks as a whole."""
    return coded(signal, Encoder(channel_of(variant, weber, FLOOR_N * weber / WEBER, smoothing)))


def _match(piece: Piece, variant: str, weber: float, found: Coded) -> Match:
    key, signal = piece.source.key, piece.source.signal()
    return Match(
        key.name, key.group, key.half, key.kind, variant, weber, found.packets, found.packets / signal.duration_s,
        *found.feel(signal, Threshold(WEBER, FLOOR_N)), outside=found.outside,
    )  # fmt: skip


_PARTS: dict[str, Callable[[Piece], Found]] = {
    RATES: _rates,
    QUIET: _few,
    ABLATION: _altered(ABLATIONS),
    TUNING: _altered(TUNINGS),
    UNSEEN: _few,
    LIMITS: _limits,
    EQUAL: _equal,
    SMOOTH: _smooth,
}
