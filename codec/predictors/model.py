"""Models: what a decoder evaluates between updates, and the contact surface that some of them describe."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, NamedTuple, Protocol

from weberlink.codec.sample import Sample
from weberlink.geometry.vector import Vector, distance, norm

_UNKNOWN: Vector = (float("nan"),) * 3


class ModelKind(IntEnum):
    """What a model describes, as telemetry records it."""

    HELD = 0
    """Nothing yet, or a held sample."""
    LINE = 1
    """Extrapolation in time, or in time and position."""
    PLANE = 2
    SPHERE = 3


class ModelRecord(NamedTuple):
    """A model in numbers that telemetry records; NaN where it describes no surface.

    Args:
        kind: a patch of surface counts as the plane or sphere that it was at its newest sample.
        surface: unit normal of a plane, centre of a sphere [m].
        size: d of a plane [m], radius of a sphere [m], negative where it is concave.
        stiffness: [N/m].
    """

    kind: ModelKind
    surface: Vector = _UNKNOWN
    size: float = float("nan")
    stiffness: float = float("nan")


UNFITTED = ModelRecord(ModelKind.HELD)
_EXTRAPOLATION = ModelRecord(ModelKind.LINE)


class ContactSurface(Protocol):
    """An elastic surface at rest: its force [N] depends on the position alone, and pressing it in stores energy."""

    @property
    def stiffness(self) -> float:
        """[N/m]: half the square of the force divided by this is the energy stored."""

    def at(self, tick: float, position: Vector) -> Vector: ...

    def record(self) -> ModelRecord: ...


class Model(ABC):
    """Predicts a value from tick and position; never changed, and equal to another with the same parameters.

    A model is a function of what one update carries, so that the two ends agree again after any loss. What it must
    remember of the positions since then is `memory`, which the decoder keeps.
    """

    __slots__ = ()

    @abstractmethod
    def at(self, tick: float, position: Vector) -> Vector:
        """The value at a tick of the sender, fractional between its ticks, and a commanded position [m].

        May be out of range or not finite for extreme inputs; the channel confines it.
        """

    @property
    def memory(self) -> Any:
        """What `advance` starts from; None for a model that depends on tick and position alone."""
        return None

    def advance(self, tick: float, position: Vector, memory: Any) -> tuple[Vector, Any]:
        """Predict with a memory; returns value and new memory. Not called where `memory` is None."""
        return self.at(tick, position), memory

    def first(self, newest: Sample) -> Vector:
        """The value at the tick of the newest sample.

        By default the sample itself, which a stiff model misses by up to stiffness times half a position step.
        """
        return newest.value

    def surface(self) -> ContactSurface | None:
        """The contact surface at the newest sample, to render, draw or record; None if the model describes none."""
        return None

    def record(self) -> ModelRecord:
        return _EXTRAPOLATION


@dataclass(slots=True)
class Hold(Model):
    """The newest sample, until the next one. What cannot be fitted is held."""

    value: Vector

    def at(self, tick: float, position: Vector) -> Vector:  # noqa: ARG002
        return self.value

    def record(self) -> ModelRecord:
        return UNFITTED


@dataclass(slots=True)
class Line(Model):
    """A straight line in time."""

    value: Vector
    slope: Vector
    """Per tick."""
    tick: int

    def at(self, tick: float, position: Vector) -> Vector:  # noqa: ARG002
        ahead = tick - self.tick
        value, slope = self.value, self.slope
        return (value[0] + slope[0] * ahead, value[1] + slope[1] * ahead, value[2] + slope[2] * ahead)

    def first(self, newest: Sample) -> Vector:  # noqa: ARG002
        return self.value


@dataclass(frozen=True, slots=True)
class FitLimits:
    """The range in which a fitted contact is accepted; outside it a predictor holds the newest sample.

    Args:
        stiffness: contact stiffness [N/m], lowest and highest, > 0.
        radius: radius of a sphere [m], lowest and highest, > 0.
        least_angle_sine: sine of the angle below which two directions count as one, 0 to 1: of the two forces (1 mN
            across 1 N is the noise of the wire), and of the columns of the sphere's equations.
        misfit: largest error of a fit at its own newest sample, as a share of that force, > 0. The least-squares sphere
            of two samples that lie on none may push the wrong way.

    Raises:
        ValueError: for an invalid range.
    """

    stiffness: tuple[float, float] = (1.0, 1e6)
    radius: tuple[float, float] = (1e-3, 10.0)
    least_angle_sine: float = 1e-3
    misfit: float = 0.25

    def __post_init__(self) -> None:
        for name, (low, high) in (("stiffness", self.stiffness), ("radius", self.radius)):
            if not 0.0 < low < high:
                raise ValueError(f"{name} must be a rising pair of positive numbers, not [{low!r}, {high!r}]")
        if not 0.0 <= self.least_angle_sine <= 1.0:
            raise ValueError(f"least_angle_sine must be 0 to 1, not {self.least_angle_sine!r}")
        if not self.misfit > 0.0:
            raise ValueError(f"misfit must be positive, not {self.misfit!r}")

    def accepts_compliance(self, compliance: float) -> bool:
        """Whether c = 1/s is positive with s in range; False for NaN."""
        return compliance > 0.0 and self.stiffness[0] * compliance <= 1.0 <= self.stiffness[1] * compliance

    def accepts_radius(self, radius: float) -> bool:
        return self.radius[0] <= abs(radius) <= self.radius[1]

    def accepts_fit(self, model: Model, newest: Sample) -> bool:
        """Whether a model is near the value of its own newest sample."""
        return distance(model.at(newest.tick, newest.position), newest.value) <= self.misfit * norm(newest.value)
