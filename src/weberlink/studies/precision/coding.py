"""Felt error of the force channel against packets and run time, over predictors and Weber factors.

The felt error is that of an operator whose position is known at once, but who feels an update only `latency_ticks`
after it was sent: the force of the model that had arrived by then, against the force measured in the same tick. Without
latency it is the coding error, which is within the deadband by law.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from statistics import median
from typing import Any

import numpy as np
from numpy.typing import NDArray

from weberlink.codec import Channel, force_channel
from weberlink.codec.predictors import HYBRID, FitLimits
from weberlink.codec.replay import code
from weberlink.master.trace import Trace
from weberlink.studies.evaluate.replay import replay, signal_of
from weberlink.studies.paper.claims import PREDICTORS
from weberlink.studies.precision.measurement import Point, dominates, front
from weberlink.system.scoring.perception import in_units, longest_run, rms

WEBERS = (0.025, 0.05, 0.10, 0.20, 0.30)
RECOMMENDED = (HYBRID, 0.10)
"""The choice of the shipped configurations."""
POOLED = "all"
"""Name of the rows of all traces together."""

MakeChannel = Callable[[str, float], Channel]
"""Makes the channel of a predictor and a Weber factor."""


@dataclass(frozen=True)
class CodingRow:
    """One trace (or all), one predictor, one Weber factor."""

    trace: str
    predictor: str
    weber: float
    samples: int
    duration_s: float
    packets: int
    packets_per_s: float
    reduction: float
    """Relative to one packet per sample."""
    coding_rms_n: float
    """Error without latency."""
    error_rms_n: float
    """Felt error; so are the next four figures."""
    error_max_n: float
    error_rms_deadbands: float
    """In units of the deadband of each tick."""
    violation_fraction: float
    """Share of ticks outside the deadband."""
    violation_longest_ticks: int
    tick_us: float
    """Median run time of encode plus decode."""
    pareto: bool = False
    """Whether it is on the Pareto front of packets and felt error of its trace."""
    pareto_at_weber: bool = False
    """Whether it is on the front of its Weber factor."""


@dataclass(frozen=True)
class ParetoVerdict:
    """The place of the recommended predictor among those of its Weber factor."""

    trace: str
    on_front: bool
    dominated_by: tuple[str, ...]
    """Predictors that are better in packets or felt error and worse in neither."""
    excess: float
    """Share by which both its packets and its felt error would have to shrink to be on the front."""


@dataclass(frozen=True)
class CodingStudy:
    """The rows of all combinations.

    Args:
        rows: traces outermost, then predictors, then Weber factors.
        pooled: the same over all traces together, each weighted by its samples; `tick_us` their median.
        latency_ticks: after which an update is felt.
    """

    rows: tuple[CodingRow, ...]
    pooled: tuple[CodingRow, ...]
    latency_ticks: int

    def verdicts(self, recommended: tuple[str, float] = RECOMMENDED) -> list[ParetoVerdict]:
        """On each trace, and on all together last; empty if the study does not hold the recommended choice."""
        groups = [[row for row in self.rows if row.trace == name] for name in dict.fromkeys(r.trace for r in self.rows)]
        verdicts = (_judge(rows, *recommended) for rows in [*groups, list(self.pooled)])
        return [verdict for verdict in verdicts if verdict is not None]

    def as_json(self) -> dict[str, Any]:
        return {
            "latency_ticks": self.latency_ticks,
            "rows": [asdict(row) for row in self.rows],
            "pooled": [asdict(row) for row in self.pooled],
            "recommended": {
                "predictor": RECOMMENDED[0],
                "weber": RECOMMENDED[1],
                "verdicts": [asdict(verdict) for verdict in self.verdicts()],
            },
        }


def shipped_channel(predictor: str, weber: float) -> Channel:
    """The force channel of the shipped configurations: positions to +-65 mm in 2 um, contacts up to 3000 N/m."""
    return force_channel(
        predictor=predictor,
        weber=weber,
        position_step=2e-6,
        fit_limits=FitLimits(stiffness=(10.0, 3000.0), radius=(1e-3, 10.0)),
    )


def study(
    traces: Mapping[str, Trace],
    predictors: Sequence[str] = PREDICTORS,
    webers: Sequence[float] = WEBERS,
    *,
    make_channel: MakeChannel = shipped_channel,
    latency_ticks: int = 1,
    begin: Callable[[str], None] = lambda _: None,
) -> CodingStudy:
    """Run every combination.

    Args:
        traces: signals by name, at least one.
        predictors: names, "hybrid" among them.
        webers: Weber factors.
        make_channel: the force channel of a predictor and a Weber factor.
        latency_ticks: after which an update is felt, >= 0; 1 is a link without delay, since it is felt a tick later.
        begin: called with the name of each signal before it is coded.

    Raises:
        ValueError: if there is nothing to run, or a trace leaves the range of the wire: its geometry would be cut off.
    """
    if not (traces and predictors and webers):
        raise ValueError("traces, predictors and webers must each name at least one")
    if latency_ticks < 0:
        raise ValueError(f"latency_ticks must be >= 0, not {latency_ticks}")
    rows: list[CodingRow] = []
    for name, trace in traces.items():
        begin(name)
        _check_range(name, trace, make_channel(predictors[0], webers[0]))
        rows += _mark(
            [
                _row(name, trace, predictor, weber, make_channel(predictor, weber), latency_ticks)
                for predictor in predictors
                for weber in webers
            ]
        )
    pooled = [
        _pool([row for row in rows if row.predictor == predictor and row.weber == weber])
        for predictor in predictors
        for weber in webers
    ]
    return CodingStudy(tuple(rows), tuple(_mark(pooled)), latency_ticks)


def felt_errors(trace: Trace, channel: Channel, latency_ticks: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Felt error and deadband of each tick [N], each of shape (n,)."""
    ticks = list(code(channel, signal_of(trace).samples, delay_ticks=latency_ticks))
    return np.array([tick.error for tick in ticks]), np.array([tick.bound for tick in ticks])


def _check_range(name: str, trace: Trace, channel: Channel) -> None:
    quantities = [
        ("position", "m", trace.position_m, channel.position_quantizer),
        ("force", "N", trace.force_n, channel.value_quantizer),
    ]
    for what, unit, values, quantizer in quantities:
        reach = float(np.abs(values).max())
        if quantizer is not None and reach > quantizer.limit:
            raise ValueError(
                f"trace {name}: {what} reaches {reach:g} {unit}, beyond the {quantizer.limit:g} {unit} of the wire"
            )


def _row(name: str, trace: Trace, predictor: str, weber: float, channel: Channel, latency_ticks: int) -> CodingRow:
    coded = replay(signal_of(trace), channel)
    samples, packets, duration = len(coded.error_n), len(coded.updates), len(coded.error_n) * trace.period_s
    errors, bounds = felt_errors(trace, channel, latency_ticks)
    outside = errors > bounds
    return CodingRow(
        trace=name,
        predictor=predictor,
        weber=weber,
        samples=samples,
        duration_s=duration,
        packets=packets,
        packets_per_s=packets / duration,
        reduction=1.0 - packets / samples,
        coding_rms_n=rms(coded.error_n),
        error_rms_n=rms(errors),
        error_max_n=float(errors.max()),
        error_rms_deadbands=rms(in_units(errors, bounds)),
        violation_fraction=float(outside.mean()),
        violation_longest_ticks=longest_run(outside),
        tick_us=coded.tick_us,
    )


def _pool(rows: Sequence[CodingRow]) -> CodingRow:
    """One row of several that differ in their trace."""
    samples, duration = sum(row.samples for row in rows), sum(row.duration_s for row in rows)
    packets = sum(row.packets for row in rows)

    def pooled(values: Iterable[float]) -> float:
        """RMS over all samples of RMS values."""
        square = sum(row.samples * value * value for row, value in zip(rows, values, strict=True)) / samples
        return float(square**0.5)

    return replace(
        rows[0],
        trace=POOLED,
        samples=samples,
        duration_s=duration,
        packets=packets,
        packets_per_s=packets / duration,
        reduction=1.0 - packets / samples,
        coding_rms_n=pooled(row.coding_rms_n for row in rows),
        error_rms_n=pooled(row.error_rms_n for row in rows),
        error_max_n=max(row.error_max_n for row in rows),
        error_rms_deadbands=pooled(row.error_rms_deadbands for row in rows),
        violation_fraction=sum(row.samples * row.violation_fraction for row in rows) / samples,
        violation_longest_ticks=max(row.violation_longest_ticks for row in rows),
        tick_us=median(row.tick_us for row in rows),
    )


def _mark(rows: Sequence[CodingRow]) -> list[CodingRow]:
    """The rows of one trace, with their places relative to the fronts."""
    on_front = front([_point(row) for row in rows])
    return [
        replace(
            row,
            pareto=on,
            pareto_at_weber=not any(dominates(_point(o), _point(row)) for o in rows if o.weber == row.weber),
        )
        for row, on in zip(rows, on_front, strict=True)
    ]


def _point(row: CodingRow) -> Point:
    return row.packets_per_s, row.error_rms_n


def _judge(rows: Sequence[CodingRow], predictor: str, weber: float) -> ParetoVerdict | None:
    alike = [row for row in rows if row.weber == weber]
    chosen = next((row for row in alike if row.predictor == predictor), None)
    if chosen is None:
        return None
    better = [row for row in alike if dominates(_point(row), _point(chosen))]
    excess = max((_excess(_point(chosen), _point(row)) for row in better), default=0.0)
    return ParetoVerdict(chosen.trace, not better, tuple(row.predictor for row in better), excess)


def _excess(point: Point, dominating: Point) -> float:
    return min(1.0 - best / mine if mine > 0.0 else 0.0 for mine, best in zip(point, dominating, strict=True))
