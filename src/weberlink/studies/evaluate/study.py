"""The study of `weberlink study evaluate`: every trace with every predictor, Weber factor and deadband, one row each.

A task is one trace at one Weber factor and one deadband with all predictors: they share the trace as plain numbers,
the perception threshold and most of the work of the clairvoyant bound.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

import numpy as np

from weberlink.codec import Channel, force_channel
from weberlink.codec.deadband import DEADBANDS, ISOTROPIC, DeadbandSetup
from weberlink.codec.predictors import HYBRID
from weberlink.codec.rate import UpdateRate
from weberlink.studies.evaluate.clairvoyant import clairvoyant_sends
from weberlink.studies.evaluate.replay import Signal, replay, signal_of
from weberlink.studies.evaluate.traces import FILES, NamedTrace
from weberlink.studies.paper.claims import PREDICTORS
from weberlink.system.scoring.perception import WEBER_FRACTION, QualityStatistics, Threshold, in_units, longest_run, rms

DEFAULT_PERIOD_S = 1e-3


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
    clairvoyant_packets: int | None = None
    """Lower bound for any encoder of this predictor, even one that knows the future; None if not computed."""
    widened_fraction: float | None = None
    """Share of ticks in which the bounded rate of updates widened the deadband; None without one."""
    widened_max_n: float | None = None
    """Largest deadband then."""

    @property
    def excess(self) -> float | None:
        """Packets over the lower bound; None where that is 0 or unknown."""
        return self.packets / self.clairvoyant_packets if self.clairvoyant_packets else None

    @property
    def clairvoyant_packets_per_s(self) -> float | None:
        if self.clairvoyant_packets is None:
            return None
        return self.clairvoyant_packets * self.packets_per_s / self.packets if self.packets else 0.0

    def as_json(self) -> dict[str, Any]:
        values = asdict(self) | {"excess": self.excess}
        return {key: value for key, value in values.items() if value is not None}


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
        max_updates_per_s: largest rate of updates; None for no limit. With one, no lower bound is computed: it is that
            of a deadband that is not widened.
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

    def tasks(self, traces: Iterable[NamedTrace]) -> list["EvaluationTask"]:
        """All tasks: traces outermost, then deadbands, then Weber factors."""
        return [
            (trace, StudyPoint(self, weber, deadband))
            for trace in traces
            for deadband in self.deadbands
            for weber in self.webers
        ]

    def rows(self, trace: NamedTrace) -> list[EvaluationRow]:
        """All rows of one trace, computed here."""
        return self.ordered({index: rows_of(task) for index, task in enumerate(self.tasks([trace]))})

    def ordered(self, results: Mapping[int, Sequence[EvaluationRow]]) -> list[EvaluationRow]:
        """All rows: traces outermost, then deadbands, then predictors, then Weber factors.

        Args:
            results: the rows by the index of their task; some may be missing.
        """
        webers = len(self.webers)
        return [
            results[first + weber][predictor]
            for first in sorted({index - index % webers for index in results})
            for predictor in range(len(self.predictors))
            for weber in range(webers)
            if first + weber in results
        ]


class StudyPoint(NamedTuple):
    """A study at one of its Weber factors and deadbands."""

    study: EvaluationStudy
    weber: float
    deadband: str


EvaluationTask = tuple[NamedTrace, StudyPoint]


def rows_of(task: EvaluationTask) -> list[EvaluationRow]:
    """The rows of one task, one for each predictor."""
    (name, trace, source), (study, weber, deadband) = task
    signal = signal_of(trace)
    fewest: Mapping[str, int | None] = {}
    if study.max_updates_per_s is None:
        hybrid = study.channel(HYBRID, weber, deadband, signal.period_s)
        fewest = clairvoyant_sends(trace.force_n, trace.position_m, channel=hybrid, families=study.predictors)
    return [
        evaluate(
            name, signal, study.channel(predictor, weber, deadband, signal.period_s), Threshold(study.jnd),
            predictor=predictor, weber=weber, deadband=deadband, source=source,
            clairvoyant_packets=fewest.get(predictor),
        )
        for predictor in study.predictors
    ]  # fmt: skip


def coded_samples(task: EvaluationTask) -> float:
    """The number of coded samples of a task, as a measure of its run time."""
    (_, trace, _), (study, *_) = task
    return float(len(trace.time_s) * len(study.predictors))


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
    clairvoyant_packets: int | None = None,
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
        clairvoyant_packets=clairvoyant_packets,
        widened_fraction=None if channel.rate is None else float(run.widened.mean()),
        widened_max_n=float(run.bound_n[run.widened].max()) if run.widened.any() else None,
    )
