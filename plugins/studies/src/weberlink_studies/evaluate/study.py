"""The cases of `weberlink study evaluate`: every trace with every deadband, predictor and Weber factor, a row each."""

import gc
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from math import inf
from typing import Any, NamedTuple

import numpy as np

from weberlink.codec import Channel, force_channel, position_channel
from weberlink.codec.deadband import DEADBANDS, ISOTROPIC, DeadbandSetup
from weberlink.codec.rate import UpdateRate
from weberlink.codec.sample import INT16_MAX, Quantizer
from weberlink.config.model import PositionCodecSettings
from weberlink.protocol.psk import PresharedKey
from weberlink.protocol.wire import UpdateLayout
from weberlink_figures.channel import longest_run
from weberlink_figures.felt import WEBER_FRACTION, QualityStatistics, Threshold
from weberlink_studies.evaluate.replay import Signal, replay, signal_of
from weberlink_studies.evaluate.traces import FILES, NamedTrace
from weberlink_studies.frame import Row
from weberlink_studies.paper.claims import PREDICTORS

DEFAULT_PERIOD_S = 1e-3
SAMPLE_S = 1e-5  # rough run time of a coded sample
WEBERS_OF_A_CASE = 6  # few, because a case is what is lost when Ctrl-C comes


@dataclass(frozen=True)
class EvaluationStudy:
    """What varies for every trace, and what is the same for all."""

    predictors: Sequence[str] = PREDICTORS  # names, "hybrid" among them; each once
    webers: Sequence[float] = (0.10,)  # Weber factors; each once
    floor: float = 0.02  # absolute threshold of the deadband [N]
    force_step: float = 1e-3  # wire step [N]
    position_step: float = 1e-5  # wire step [m]
    saturates: bool = True  # whether the int16 range applies
    # just noticeable difference of a person, as a share of the force; its absolute threshold is the default
    jnd: float = WEBER_FRACTION
    # names of shapes, each once; their other parameters have the default values
    deadbands: Sequence[str] = (ISOTROPIC,)
    # how far the encoder looks ahead [ms], in whole samples; errors are those of the delayed signal
    lookahead_ms: float = 0.0
    max_updates_per_s: float | None = None  # largest rate of updates; None for no limit
    position_predictors: Sequence[str] = ()  # names, with the same Weber factors; each once

    def channel(
        self, predictor: str, weber: float, deadband: str | None = None, period_s: float = DEFAULT_PERIOD_S
    ) -> Channel:
        """A force channel for a signal of this period, with the first deadband unless another is named."""
        shape, most = DEADBANDS[deadband or self.deadbands[0]], self.max_updates_per_s
        made = force_channel(
            predictor=predictor,
            deadband=shape.configured(DeadbandSetup(weber, self.floor, "actual", period_s, shape.Options())),
            force_step=self.force_step,
            position_step=self.position_step,
        )
        return self._timed(made, period_s, None if most is None else UpdateRate.limited_to(most, period_s))

    def _timed(self, made: Channel, period_s: float, rate: UpdateRate | None) -> Channel:
        value, position, largest = made.value_quantizer, made.position_quantizer, INT16_MAX if self.saturates else inf
        return replace(
            made,
            value_quantizer=Quantizer(value.step, largest_level=largest),
            position_quantizer=None if position is None else Quantizer(position.step, largest_level=largest),
            rate=rate,
            tick_period=period_s,
            lookahead=round(1e-3 * self.lookahead_ms / period_s),
        )

    def position_channel(self, predictor: str, weber: float, period_s: float = DEFAULT_PERIOD_S) -> Channel:
        """A position channel with the bound of a configuration."""
        settings = PositionCodecSettings.model_validate({"predictor": predictor})
        made = position_channel(
            predictor=predictor,
            bank=settings.bank,
            weber=weber,
            bound=settings.bound_m,
            position_step=self.position_step,
        )
        return self._timed(made, period_s, None)

    def cases(self, traces: Iterable[NamedTrace]) -> list["EvaluationCase"]:
        """All cases: traces outermost, then force (deadbands) and position, then predictors, then Weber factors."""
        ways = [(deadband, "force", predictor) for deadband in self.deadbands for predictor in self.predictors]
        ways += [(ISOTROPIC, "position", predictor) for predictor in self.position_predictors]
        starts = range(0, len(self.webers), WEBERS_OF_A_CASE)
        parts = [self.webers[start : start + WEBERS_OF_A_CASE] for start in starts]
        return [
            EvaluationCase(trace, self, predictor, webers, deadband, channel)
            for trace in traces
            for deadband, channel, predictor in ways
            for webers in parts
        ]

    def rows(self, trace: NamedTrace) -> list[Row]:
        """All rows of one trace, computed here."""
        return [row for case in self.cases([trace]) for row in rows_of(case)]


class EvaluationCase(NamedTuple):
    """Rows of one trace, coded in one way: one for each of some Weber factors."""

    trace: NamedTrace
    study: EvaluationStudy
    predictor: str
    webers: Sequence[float]
    deadband: str
    channel: str = "force"


def rows_of(case: EvaluationCase) -> list[Row]:
    """The rows of a case."""
    (name, trace, source), study, predictor, webers, deadband, kind = case
    signal, period_s = signal_of(trace), trace.period_s
    threshold: Threshold | None = None
    told: dict[str, Any] = {"predictor": predictor, "source": source}
    if kind == "position":
        # About the middle of the range, as in the workspace of a device.
        middle = 0.5 * (signal.position_m.min(axis=0) + signal.position_m.max(axis=0))
        signal = Signal(signal.position_m - middle, signal.position_m, period_s)
        channels = [study.position_channel(predictor, weber, period_s) for weber in webers]
    else:
        threshold, told["deadband"] = Threshold(study.jnd), deadband
        channels = [study.channel(predictor, weber, deadband, period_s) for weber in webers]
    made = zip(webers, channels, strict=True)
    collects = gc.isenabled()
    gc.disable()  # tuples of numbers: a pass over them finds nothing, and there would be a pass every 700 of them
    try:
        return [evaluate(name, signal, channel, threshold, weber=weber, **told) for weber, channel in made]
    finally:
        if collects:
            gc.enable()


def evaluate(
    name: str,
    signal: Signal,
    channel: Channel,
    threshold: Threshold | None,
    *,
    predictor: str,
    weber: float,
    deadband: str | None = None,
    source: str = FILES,
) -> Row:
    """Code a signal with a fresh encoder and decoder. Figures that do not apply are left out of the row.

    `reduction` is against one packet per sample, `bytes_per_s` the UDP payload on a link secured by a pre-shared key,
    `error_max_deadbands` in the deadband's own measure, `violation_*` outside the deadband (none if the codec works),
    `tick_us` the median run time of encode plus decode, and `selected` the sends per predictor of a bank; `widened_*`
    tell where the bounded rate of updates widened the deadband. The rest are measures of `QualityStatistics`, of forces
    alone; the errors of positions are in metres.
    """
    run, layout = replay(signal, channel), UpdateLayout(channel.forms)
    samples, packets, duration = len(run.error_n), len(run.updates), signal.duration_s
    sends = np.bincount(run.selected, minlength=len(channel.bank)).tolist()
    outside, bounded = run.deviation_n > run.bound_n, run.bound_n > 0.0
    unit, measures = "m", {}
    if threshold is not None:
        quality = QualityStatistics(signal.period_s, threshold)
        quality.add(run.error_n, run.displayed_n, np.linalg.norm(signal.force_n, axis=1))
        quality.add_jumps(run.jump_n, run.before_n)
        unit, measures = "n", asdict(quality.figures())
    row = {
        "trace": name,
        "channel": "position" if threshold is None else "force",
        "predictor": predictor,
        "weber": weber,
        "samples": samples,
        "duration_s": duration,
        "packets": packets,
        "packets_per_s": packets / duration,
        "reduction": 1.0 - packets / samples,
        "bytes_per_s": sum(layout.length(update) + PresharedKey.tag_size for update in run.updates) / duration,
        f"error_rms_{unit}": float(np.sqrt(np.mean(np.square(run.error_n)))),
        f"error_max_{unit}": float(run.error_n.max()),
        "error_max_deadbands": float((run.deviation_n[bounded] / run.bound_n[bounded]).max(initial=0.0)),
        "violation_fraction": float(outside.mean()),
        "violation_longest_s": longest_run(outside) * signal.period_s,
        **measures,
        "tick_us": run.tick_us,
        "selected": dict(zip(channel.bank, sends, strict=True)) if len(channel.bank) > 1 else None,
        "deadband": deadband,
        "source": source,
        "widened_fraction": None if channel.rate is None else float(run.widened.mean()),
        f"widened_max_{unit}": float(run.bound_n[run.widened].max()) if run.widened.any() else None,
    }
    return {name: figure for name, figure in row.items() if figure is not None}
