"""Where this code departs from the paper, or chose one reading of it, and what each other reading would send.

A reading is a force channel in which one thing is read differently. Its packets are counted over those of the code's
own channel on the same signal, in closed loop, at the Weber factor at which the paper compares rates.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from math import inf
from typing import Any, NamedTuple

from weberlink.codec import Channel
from weberlink.codec.deadband import ForceDeadband, Reference
from weberlink.codec.predictors import HYBRID, FitLimits, Predictor
from weberlink.codec.predictors.contract import same_contact
from weberlink.codec.predictors.plane import Plane, PlanePredictor
from weberlink.codec.predictors.sphere import Sphere, SpherePredictor
from weberlink.codec.replay import code
from weberlink.codec.sample import Sample
from weberlink.geometry.vector import dot, norm, unit
from weberlink.studies.curves import Band
from weberlink.studies.evaluate.replay import signal_of
from weberlink.studies.evaluate.study import EvaluationStudy
from weberlink.studies.evaluate.traces import NamedTrace
from weberlink.studies.paper.claims import WEBER, ratio_band

ANY_FIT = FitLimits(stiffness=(1e-6, 1e12), radius=(1e-9, 1e9), least_angle_sine=1e-12, misfit=inf)
"""Accepts every fit with a positive stiffness."""


class _TwoHeights(PlanePredictor):
    """A plane from two heights n.p_i and two magnitudes of force, however the older ones are read."""

    def older(self, normal: tuple[float, float, float], previous: Sample) -> tuple[float, float]:
        """Height without offset [m] and magnitude of force [N] of the older sample."""
        raise NotImplementedError

    def fit(self, newest: Sample, previous: Sample | None, limits: FitLimits) -> Plane | None:
        if previous is None or not same_contact(newest, previous):
            return None
        normal, force = unit(newest.value), norm(newest.value)
        height, other = self.older(normal, previous)
        if force == other:
            return None
        compliance = (height - dot(normal, newest.position)) / (force - other)
        if not limits.accepts_compliance(compliance):
            return None
        return Plane(normal, -dot(normal, newest.position) - force * compliance, 1.0 / compliance)


class _AlongNormal(_TwoHeights):
    def older(self, normal: tuple[float, float, float], previous: Sample) -> tuple[float, float]:
        return dot(normal, previous.position), dot(normal, previous.value)


class _OwnNormals(_TwoHeights):
    def older(self, normal: tuple[float, float, float], previous: Sample) -> tuple[float, float]:  # noqa: ARG002
        return dot(unit(previous.value), previous.position), norm(previous.value)


class _ConvexSphere(SpherePredictor):
    def fit(self, newest: Sample, previous: Sample | None, limits: FitLimits) -> Sphere | None:
        sphere = super().fit(newest, previous, limits)
        return sphere if sphere is not None and sphere.radius > 0.0 else None


@dataclass(frozen=True)
class _ReadChannel(Channel):
    """A channel of one predictor that is in no table."""

    reading: Predictor | None = None

    @property
    def predictors(self) -> tuple[Predictor, ...]:
        assert self.reading is not None
        return (self.reading,)


class PaperReading(NamedTuple):
    """Another reading of a part of the paper, or the paper's own where the code departs from it.

    Args:
        part: of the paper.
        here: what the code does.
        other: what else it could do.
        base: name of the predictor whose channel is changed.
        predictor: in the place of that one; None to keep it.
        reference: which force the deadband scales.
        floor: factor on the floor of the deadband.
        fit_limits: which fits are accepted; None for those of the code.
    """

    part: str
    here: str
    other: str
    base: str
    predictor: Predictor | None = None
    reference: Reference = "actual"
    floor: float = 1.0
    fit_limits: FitLimits | None = None

    def channel(self, study: EvaluationStudy) -> Channel:
        """The channel of the study with this one thing read differently."""
        channel = study.channel(self.base, WEBER)
        channel = replace(
            channel,
            deadband=ForceDeadband(WEBER, self.floor * study.floor, self.reference),
            fit_limits=self.fit_limits or channel.fit_limits,
        )
        if self.predictor is None:
            return channel
        return _ReadChannel(**_values(channel), reading=self.predictor)


_PLANE = "normal n_1 = f_1/\\|f_1\\| and n_1.p_i + d + \\|f_i\\|/s = 0 for the two newest samples"
_SPHERE = "one least-squares fit; r < 0 is a concave wall"
_FITS = "a fit outside the ranges of `FitLimits` is not used: hold"
_REFERENCE = "k scales the measured force; floor 0.02 N"
READINGS = (
    PaperReading("plane", _PLANE, "n_1.f_2 for \\|f_2\\|", "plane", predictor=_AlongNormal()),
    PaperReading("plane", _PLANE, "literal: each sample with its own normal n_i", "plane", predictor=_OwnNormals()),
    PaperReading("plane", _FITS, "every fit with s > 0", "plane", fit_limits=ANY_FIT),
    PaperReading("sphere", _SPHERE, "convex walls only", "sphere", predictor=_ConvexSphere()),
    PaperReading("sphere", _FITS, "every fit with s > 0", "sphere", fit_limits=ANY_FIT),
    PaperReading("deadband", _REFERENCE, "k scales the displayed force", HYBRID, reference="displayed"),
    PaperReading("deadband", _REFERENCE, "k scales the force last sent", HYBRID, reference="sent"),
    PaperReading("deadband", _REFERENCE, "no floor, as in the paper", HYBRID, floor=0.0),
)


class ReadingResult(NamedTuple):
    """Packets of a reading over those of the code.

    Args:
        reading: the reading.
        ratios: by signal; signals without a packet of either are left out.
        band: their geometric mean and its 95 % interval; None without any.
    """

    reading: PaperReading
    ratios: Mapping[str, float]
    band: Band | None

    def as_json(self) -> dict[str, Any]:
        band = None if self.band is None else self.band._asdict()
        return {
            "part": self.reading.part, "here": self.reading.here, "other": self.reading.other,
            "predictor": self.reading.base, "packets_over_here": band, "ratios": dict(self.ratios),
        }  # fmt: skip


ReadingTask = tuple[EvaluationStudy, NamedTrace]


def packets_of(task: ReadingTask) -> list[tuple[int, int]]:
    """Packets of every reading, and of the code beside it, on one signal."""
    study, named = task
    samples = signal_of(named.trace).samples
    here = {base: _packets(study.channel(base, WEBER), samples) for base in {reading.base for reading in READINGS}}
    return [(_packets(reading.channel(study), samples), here[reading.base]) for reading in READINGS]


def results(names: Sequence[str], packets: Iterable[Sequence[tuple[int, int]]]) -> list[ReadingResult]:
    """The results over signals.

    Args:
        names: of the signals.
        packets: of each of them, from `packets_of`.
    """
    found = []
    for reading, *pairs in zip(READINGS, *packets, strict=True):
        ratios = {name: other / here for name, (other, here) in zip(names, pairs, strict=True) if other and here}
        found.append(ReadingResult(reading, ratios, ratio_band(ratios)))
    return found


def _packets(channel: Channel, samples: Sequence[Any]) -> int:
    return sum(tick.update is not None for tick in code(channel, samples))


def _values(channel: Channel) -> dict[str, Any]:
    return {field.name: getattr(channel, field.name) for field in fields(channel)}
