"""Models, which a decoder evaluates between updates, and the contact surface that some of them describe."""

from abc import ABCMeta, abstractmethod
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, NamedTuple

from weberlink.codec.sample import UNKNOWN, Sample
from weberlink.compiled import mypyc_attr
from weberlink.geometry.vector import Vector, distance, norm


class ModelKind(IntEnum):
    """The kind of a model, as telemetry records it."""

    HELD = 0  # No update yet, or a held sample
    LINE = 1  # Extrapolation in time, or in time and position
    PLANE = 2
    SPHERE = 3


class ModelRecord(NamedTuple):
    """A model as telemetry records it; NaN if it describes no surface.

    Another surface counts as the plane or sphere that it is at its newest sample.
    """

    kind: ModelKind
    surface: Vector = UNKNOWN  # unit normal of a plane, or centre of a sphere [m]
    size: float = float("nan")  # d of a plane [m], or radius of a sphere [m], negative if concave
    stiffness: float = float("nan")  # of the contact [N/m]


UNFITTED = ModelRecord(ModelKind.HELD)
EXTRAPOLATION = ModelRecord(ModelKind.LINE)


@mypyc_attr(allow_interpreted_subclasses=True)
class Model(metaclass=ABCMeta):
    """Predicts a value from tick and position. Never changed; equal to a model with the same parameters.

    A model depends on one update only, so that the two ends agree again after any loss. A model with friction also
    depends on the positions since then, by a `memory` that the decoder keeps.
    """

    __slots__ = ()

    @abstractmethod
    def at(self, tick: float, position: Vector) -> Vector:
        """The value at a tick of the sender (fractional between its ticks) and a commanded position [m].

        May be out of range or not finite for extreme inputs; `Channel.displayable` corrects that.
        """

    @property
    def memory(self) -> Any:
        """The initial memory for `advance`; None for a model that depends on tick and position only."""
        return None

    def advance(self, tick: float, position: Vector, memory: Any) -> tuple[Vector, Any]:
        """Predict with a memory; returns the value and the new memory. Not called if `memory` is None."""
        return self.at(tick, position), memory

    def first(self, newest: Sample) -> Vector:
        """The value at the tick of the newest sample.

        By default the sample itself: a stiff model misses it by up to stiffness times half a position step. Only that
        of an estimated predictor may begin elsewhere; outside the deadband, the encoder holds the sample instead.
        """
        return newest.value

    def surface(self) -> Any:
        """The model itself if it is an elastic surface, with its `stiffness` [N/m]; otherwise None.

        At a force f such a surface stores f^2 / (2 stiffness) [J].
        """
        return None

    def record(self) -> ModelRecord:
        """The model as telemetry records it."""
        return EXTRAPOLATION


@dataclass(slots=True)
class Hold(Model):
    """Zero-order hold: the newest sample, until the next one. The fallback if no model can be fitted."""

    value: Vector

    def at(self, tick: float, position: Vector) -> Vector:  # noqa: ARG002
        return self.value

    def record(self) -> ModelRecord:
        return UNFITTED


@dataclass(slots=True)
class Line(Model):
    """A straight line in time."""

    value: Vector
    slope: Vector  # Per tick
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

    ValueError for an invalid range.
    """

    stiffness: tuple[float, float] = (1.0, 1e6)  # of the contact [N/m], lowest and highest, > 0
    radius: tuple[float, float] = (1e-3, 10.0)  # of a sphere [m], lowest and highest, > 0
    # Sine of the angle below which two directions count as parallel, 0 to 1: the forces of a sphere (a wire step of
    # 1 mN turns a force of 1 N by 1e-3) and the columns of its equations.
    least_angle_sine: float = 1e-3
    # Largest error of a fit at its own newest sample, as a share of that force, > 0. If no sphere passes through both
    # samples, the least-squares sphere may push in the wrong direction.
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
        """Whether the stiffness 1 / compliance [N/m] is positive and in range; False for NaN."""
        return compliance > 0.0 and self.stiffness[0] * compliance <= 1.0 <= self.stiffness[1] * compliance

    def accepts_radius(self, radius: float) -> bool:
        """Whether the magnitude of a radius [m] is in range; a concave one is negative."""
        return self.radius[0] <= abs(radius) <= self.radius[1]

    def accepts_fit(self, model: Model, newest: Sample) -> bool:
        """Whether a model passes its own newest sample within `misfit`."""
        return distance(model.at(newest.tick, newest.position), newest.value) <= self.misfit * norm(newest.value)
