"""Traces, predictors and Weber factors: what is varied, what is held, and how the whole is cut into tasks.

A task is one trace at one Weber factor and one shape of the deadband with all predictors: short enough for any number
of workers, and large enough that what the predictors share (the trace as plain numbers, a person's threshold, most of
the clairvoyant's work) is made once. Where a task runs is not known here; its rows do not depend on it, but for the
measured run time.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from weberlink.codec import Channel, force_channel
from weberlink.codec.deadband import DEADBANDS, ISOTROPIC
from weberlink.codec.predictors import HYBRID
from weberlink.master.trace import Trace
from weberlink.studies.evaluate.clairvoyant import clairvoyant_sends
from weberlink.studies.evaluate.engine import Engine
from weberlink.studies.evaluate.replay import signal_of
from weberlink.studies.evaluate.row import Row, code
from weberlink.system.scoring.perception import Threshold

DEFAULT_PERIOD_S = 1e-3


class Recording(NamedTuple):
    """A trace and the name that its rows bear."""

    name: str
    trace: Trace


@dataclass(frozen=True)
class Study:
    """What is varied over every trace, and what is held.

    Args:
        predictors: names, "hybrid" among them; each once.
        webers: Weber factors; each once.
        floor: absolute threshold, of the deadband and of a person [N].
        force_step: wire step [N].
        position_step: wire step [m].
        saturates: whether the int16 range applies.
        jnd: a person's just noticeable difference, as a share of the force.
        engine: what codes; the rows are the same.
        deadbands: names of shapes, each once; of each the parameters that are its own are the default ones.
    """

    predictors: Sequence[str] = ("zoh", "linear", "plane", "sphere", "hybrid")
    webers: Sequence[float] = (0.10,)
    floor: float = 0.02
    force_step: float = 1e-3
    position_step: float = 1e-5
    saturates: bool = True
    jnd: float = 0.10
    engine: Engine = "python"
    deadbands: Sequence[str] = (ISOTROPIC,)

    def channel(
        self, predictor: str, weber: float, deadband: str | None = None, period_s: float = DEFAULT_PERIOD_S
    ) -> Channel:
        """Of the first shape unless another is named, for a signal of this period."""
        shape = DEADBANDS[deadband or self.deadbands[0]]
        defaults = {name: option.default for name, option in shape.options.items()}
        return force_channel(
            predictor=predictor,
            deadband=shape.configured(weber, self.floor, "actual", period_s, defaults),
            force_step=self.force_step,
            position_step=self.position_step,
            saturates=self.saturates,
        )

    def tasks(self, recordings: Iterable[Recording]) -> list["Task"]:
        """All of the work; the recording, which several tasks share, comes first."""
        return [
            (recording, Cut(self, weber, deadband))
            for recording in recordings
            for deadband in self.deadbands
            for weber in self.webers
        ]

    def rows(self, recording: Recording) -> Iterator[Row]:
        """All rows of one trace, predictors outermost, made here and now."""
        tasks = self.tasks([recording])
        return iter(self.ordered(dict(enumerate(map(rows_of, tasks)))))

    def ordered(self, results: Mapping[int, Sequence[Row]]) -> list[Row]:
        """All rows, traces outermost, then shapes, then predictors, then Weber factors.

        Args:
            results: the rows of each task by its place among `tasks`, in any order.
        """
        cuts = len(self.webers)
        return [
            results[first + cut][predictor]
            for first in range(0, len(results), cuts)
            for predictor in range(len(self.predictors))
            for cut in range(cuts)
        ]


class Cut(NamedTuple):
    """A study at one of its Weber factors, with one of its shapes."""

    study: Study
    weber: float
    deadband: str


Task = tuple[Recording, Cut]


def rows_of(task: Task) -> list[Row]:
    """One trace at one Weber factor: a row for each predictor."""
    (name, trace), (study, weber, deadband) = task
    signal = signal_of(trace)
    threshold_n = Threshold(study.jnd, study.floor).of(trace.force_n)
    fewest = _clairvoyant(trace, study, study.channel(HYBRID, weber, deadband, signal.period_s))
    return [
        code(
            name, signal, predictor, weber, study.channel(predictor, weber, deadband, signal.period_s), threshold_n,
            fewest.get(predictor), study.engine, deadband,
        )
        for predictor in study.predictors
    ]  # fmt: skip


def length(task: Task) -> float:
    """Of a task, in coded samples, as a measure of its cost."""
    (_, trace), (study, *_) = task
    return float(len(trace.time_s) * len(study.predictors))


def _clairvoyant(trace: Trace, study: Study, channel: Channel) -> dict[str, int | None]:
    """The fewest sends of each predictor's family, worked out together since they share work."""
    return clairvoyant_sends(trace.force_n, trace.position_m, channel=channel, families=study.predictors)
