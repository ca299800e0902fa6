"""The cases of `weberlink study evaluate`: every trace with every deadband, predictor and Weber factor, a row each."""

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

import numpy as np

from weberlink.codec import Channel, force_channel
from weberlink.codec.deadband import DEADBANDS, ISOTROPIC, DeadbandSetup
from weberlink.codec.rate import UpdateRate
from weberlink.studies.evaluate.replay import Signal, replay, signal_of
from weberlink.studies.evaluate.traces import FILES, NamedTrace
from weberlink.studies.paper.claims import PREDICTORS
from weberlink.system.scoring.perception import WEBER_FRACTION, QualityStatistics, Threshold, in_units, longest_run, rms

DEFAULT_PERIOD_S = 1e-3
SAMPLE_S = 1e-5
"""Rough run time of a coded sample."""


@dataclass(frozen=True)
class EvaluationRow:
    """The figures of one trace with one predictor, Weber factor and deadband."""

    trace: str
    predictor: str
    weber: float
    samples: int
    duration_s: float
    packets: int
    packets_per_s: float
    reduction: float
    """Against one packet per sample."""
    bytes_per_s: float
    """UDP payload of the updates, as on a link secured by a pre-shared key."""
    error_rms_n: float
    error_max_n: float
    error_max_deadbands: float
    """Largest error in units of its bound, in the deadband's own measure."""
    violation_fraction: float
    """Share of ticks outside the deadband of this row; 0 if the codec works."""
    violation_longest_s: float
    error_rms_jnd: float
    """This and the next eight: measures of `QualityStatistics`, with the same JND for all rows."""
    error_max_jnd: float
    noticeable_fraction: float
    noticeable_longest_s: float
    log_error_rms_jnd: float
    log_error_max_jnd: float
    jump_median_jnd: float | None
    """None without a jump, likewise the next two."""
    jump_p99_jnd: float | None
    jump_max_jnd: float | None
    tick_us: float
    """Median run time of encode plus decode."""
    selected: dict[str, int] | None = None
    """Sends per predictor; hybrid only."""
    deadband: str = ISOTROPIC
    source: str = FILES
    """Of the trace: a source of shipped recordings, or `FILES`."""
    widened_fraction: float | None = None
    """Share of ticks in which the bounded rate of updates widened the deadband; None without one."""
    widened_max_n: float | None = None
    """Largest deadband then."""

    def as_json(self) -> dict[str, Any]:
        return {key: value for key, value in asdict(self).items() if value is not None}


@dataclass(frozen=True)
class EvaluationStudy:
    """What varies for every trace, and what is the same for all.

    Args:
        predictors: names, "hybrid" among them; each once.
        webers: Weber factors; each once.
        floor: absolute threshold of the deadband [N].
        force_step: wire step [N].
        position_step: wire step [m].
        saturates: whether the int16 range applies.
        jnd: just noticeable difference of a person, as a share of the force; its absolute threshold is the default.
        deadbands: names of shapes, each once; their other parameters have the default values.
        lookahead_ms: how far the encoder looks ahead [ms], in whole samples; errors are those of the delayed signal.
        max_updates_per_s: largest rate of updates; None for no limit.
    """

    predictors: Sequence[str] = PREDICTORS
    webers: Sequence[float] = (0.10,)
    floor: float = 0.02
    force_step: float = 1e-3
    position_step: float = 1e-5
    saturates: bool = True
    jnd: float = WEBER_FRACTION
    deadbands: Sequence[str] = (ISOTROPIC,)
    lookahead_ms: float = 0.0
    max_updates_per_s: float | None = None

    def channel(
        self, predictor: str, weber: float, deadband: str | None = None, period_s: float = DEFAULT_PERIOD_S
    ) -> Channel:
        """A force channel for a signal of this period, with the first deadband unless another is named."""
        shape, most = DEADBANDS[deadband or self.deadbands[0]], self.max_updates_per_s
        rate = None if most is None else UpdateRate.limited_to(most, period_s)
        return force_channel(
            predictor=predictor,
            deadband=shape.configured(DeadbandSetup(weber, self.floor, "actual", period_s, shape.defaults())),
            force_step=self.force_step,
            position_step=self.position_step,
            saturates=self.saturates,
            rate=rate,
            tick_period=period_s,
            lookahead=round(1e-3 * self.lookahead_ms / period_s),
        )

    def cases(self, traces: Iterable[NamedTrace]) -> list["EvaluationCase"]:
        """All cases: traces outermost, then deadbands, then predictors, then Weber factors."""
        return [
            EvaluationCase(trace, self, predictor, weber, deadband)
            for trace in traces
            for deadband in self.deadbands
            for predictor in self.predictors
            for weber in self.webers
        ]

    def rows(self, trace: NamedTrace) -> list[EvaluationRow]:
        """All rows of one trace, computed here."""
        return [row for case in self.cases([trace]) for row in rows_of(case)]


class EvaluationCase(NamedTuple):
    """One row to compute."""

    trace: NamedTrace
    study: EvaluationStudy
    predictor: str
    weber: float
    deadband: str


def rows_of(case: EvaluationCase) -> list[EvaluationRow]:
    """The row of a case."""
    (name, trace, source), study, predictor, weber, deadband = case
    signal = signal_of(trace)
    channel = study.channel(predictor, weber, deadband, signal.period_s)
    row = evaluate(
        name, signal, channel, Threshold(study.jnd), predictor=predictor, weber=weber, deadband=deadband, source=source
    )
    return [row]


def seconds(case: EvaluationCase) -> float:
    """Estimated run time of a case [s]."""
    return SAMPLE_S * len(case.trace.trace.time_s)


def evaluate(
    name: str,
    signal: Signal,
    channel: Channel,
    threshold: Threshold,
    *,
    predictor: str,
    weber: float,
    deadband: str = ISOTROPIC,
    source: str = FILES,
) -> EvaluationRow:
    """Code a signal with a fresh encoder and decoder.

    Args:
        name: of the trace.
        signal: force and position.
        channel: a force channel. The keyword arguments are copied to the row.
        threshold: a JND of the person.
    """
    run = replay(signal, channel)
    samples, packets, duration = len(run.error_n), len(run.updates), signal.duration_s
    sends = np.bincount(run.selected, minlength=len(channel.bank)).tolist()
    outside = run.deviation_n > run.bound_n
    quality = QualityStatistics(signal.period_s, threshold)
    quality.add(run.error_n, run.displayed_n, np.linalg.norm(signal.force_n, axis=1))
    quality.add_jumps(run.jump_n, run.before_n)
    return EvaluationRow(
        trace=name,
        predictor=predictor,
        weber=weber,
        samples=samples,
        duration_s=duration,
        packets=packets,
        packets_per_s=packets / duration,
        reduction=1.0 - packets / samples,
        bytes_per_s=run.payload_bytes(channel) / duration,
        error_rms_n=rms(run.error_n),
        error_max_n=float(run.error_n.max()),
        error_max_deadbands=float(in_units(run.deviation_n, run.bound_n).max(initial=0.0)),
        violation_fraction=float(outside.mean()),
        violation_longest_s=longest_run(outside) * signal.period_s,
        **quality.summary(),  # type: ignore[arg-type]
        tick_us=run.tick_us,
        selected=dict(zip(channel.bank, sends, strict=True)) if len(channel.bank) > 1 else None,
        deadband=deadband,
        source=source,
        widened_fraction=None if channel.rate is None else float(run.widened.mean()),
        widened_max_n=float(run.bound_n[run.widened].max()) if run.widened.any() else None,
    )
