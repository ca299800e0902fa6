"""One signal at one tick rate through the codec: `adaptive`, the hybrid and every single predictor of the paper."""

from dataclasses import dataclass
from time import process_time

from weberlink.codec.predictors import ADAPTIVE, HYBRID, HYBRID_BANK
from weberlink.studies.adaptive.signals import Kind, SignalTask
from weberlink.studies.evaluate.replay import replay
from weberlink.studies.evaluate.study import EvaluationStudy
from weberlink.system.scoring.perception import Threshold, in_units, rms

WEBER, FLOOR_N = 0.10, 0.02
SINGLES = HYBRID_BANK
COMPARED = (ADAPTIVE, HYBRID, *SINGLES)
STUDY = EvaluationStudy(COMPARED, (WEBER,), FLOOR_N)


@dataclass(frozen=True)
class RateRow:
    """How often one predictor sent one signal at one tick rate."""

    signal: str
    group: str
    source: str
    kind: Kind
    rate_hz: int
    predictor: str
    duration_s: float
    packets: int
    bytes: int
    """UDP payload."""
    error_rms_jnd: float
    """In JND."""
    outside: int
    """Ticks outside their deadband; must be 0."""
    tick_us: float
    """Median run time of encode plus decode."""
    processor_s: float
    """Processor time of the whole run."""


def rows_of(task: SignalTask) -> list[RateRow]:
    """A row for each of `COMPARED`."""
    one = task.signal
    signal = one.at(task.rate_hz, task.longest_s)
    threshold = Threshold().of(signal.force_n)
    rows = []
    for predictor in COMPARED:
        began = process_time()
        channel = STUDY.channel(predictor, WEBER, period_s=signal.period_s)
        run = replay(signal, channel)
        rows.append(
            RateRow(
                one.name, one.group, one.source, one.kind, task.rate_hz, predictor, signal.duration_s,
                len(run.updates), run.payload_bytes(channel), rms(in_units(run.error_n, threshold)),
                int((run.deviation_n > run.bound_n).sum()), run.tick_us, process_time() - began,
            )
        )  # fmt: skip
    return rows


def length(task: SignalTask) -> float:
    """Approximate run time, in ticks."""
    return min(task.longest_s, 12.0) * task.rate_hz
