"""The interface of a predictor: how it makes a model from samples, how the model travels in an update, and the model,
which a decoder evaluates between updates.
"""

from abc import ABCMeta, abstractmethod
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, ClassVar, NamedTuple

from weberlink.codec.sample import UNKNOWN, Sample, SampleGrid
from weberlink.compiled import mypyc_attr
from weberlink.geometry.vector import Vector
from weberlink.update import ModelParameters, Payload, PreviousSample


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


@dataclass(frozen=True, slots=True)
class FitLimits:
    """The range in which a fitted contact is accepted; outside it a predictor holds the newest sample.

    ValueError for an invalid range.
    """

    stiffness: tuple[float, float] = (1.0, 1e6)  # of the contact [N/m], lowest and highest, > 0
    radius: tuple[float, float] = (1e-3, 10.0)  # of a sphere [m], lowest and highest, > 0

    def __post_init__(self) -> None:
        for name, (low, high) in (("stiffness", self.stiffness), ("radius", self.radius)):
            if not 0.0 < low < high:
                raise ValueError(f"{name} must be a rising pair of positive numbers, not [{low!r}, {high!r}]")

    def accepts_compliance(self, compliance: float) -> bool:
        """Whether the stiffness 1 / compliance [N/m] is positive and in range; False for NaN."""
        return compliance > 0.0 and self.stiffness[0] * compliance <= 1.0 <= self.stiffness[1] * compliance

    def accepts_radius(self, radius: float) -> bool:
        """Whether the magnitude of a radius [m] is in range; a concave one is negative."""
        return self.radius[0] <= abs(radius) <= self.radius[1]


@mypyc_attr(allow_interpreted_subclasses=True)
class Predictor(metaclass=ABCMeta):
    """What the two kinds share; a predictor is a `FittedPredictor` or an `EstimatedPredictor`."""

    __slots__ = ()

    name: ClassVar[str]  # in configuration files, reports and telemetry
    geometric: ClassVar[bool] = False  # the model reads the position, which updates carry: not for a position channel
    describes_contact: ClassVar[bool] = False  # the model is a contact surface: for forces only
    estimated: ClassVar[bool] = False  # the parameters are sent: its kind
    choice: ClassVar[str] = "hybrid"  # what makes its updates where it is the only one of a channel, of `CHOICES`
    looks_ahead: ClassVar[bool] = False  # its models are made of the samples that are known ahead too

    def groups(self, grid: SampleGrid) -> tuple[int, ...]:
        """Numbers of levels of what the predictor reads of a sample: the value, then (if `geometric`) the position."""
        return grid.groups if self.geometric else grid.groups[:1]

    @abstractmethod
    def decode(self, payload: Payload, newest: Sample, grid: SampleGrid, limits: FitLimits) -> Model:
        """The model of an update; it holds the newest sample if none can be trusted.

        Args:
            payload: what the update carries beside the newest sample.
            newest: that sample.
            grid: of the channel.
            limits: the range of accepted contacts.

        Raises:
            ValueError: if the payload does not fit the predictor or the channel.
        """


@mypyc_attr(allow_interpreted_subclasses=True)
class FittedPredictor(Predictor):
    """Both ends fit the same model to the two newest samples that were sent."""

    __slots__ = ()

    @abstractmethod
    def fit(self, newest: Sample, previous: Sample | None, limits: FitLimits) -> Model | None:
        """Fit the two newest samples sent; None if no model can be trusted. Never raises."""

    def needs_previous(self, newest: Sample, previous: Sample) -> bool:  # noqa: ARG002
        """Whether the fit reads the previous sample, so that an update must carry it."""
        return False

    def model(self, newest: Sample, previous: Sample | None, limits: FitLimits) -> Model:
        """The fitted model; if there is none, the newest sample is held."""
        return self.fit(newest, previous, limits) or Hold(newest.value)

    def decode(self, payload: Payload, newest: Sample, grid: SampleGrid, limits: FitLimits) -> Model:
        if payload is None:
            return self.model(newest, None, limits)
        if isinstance(payload, ModelParameters):
            raise ValueError(f"update of {self.name} carries model parameters, expected a previous sample")  # noqa: TRY004 - of a peer
        size = grid.size if self.geometric else grid.value.size
        if len(payload.levels) != size:
            raise ValueError(f"update carries {len(payload.levels)} levels of the previous sample, expected {size}")
        return self.model(newest, grid.sample(newest.tick - payload.gap, payload.levels), limits)


@mypyc_attr(allow_interpreted_subclasses=True)
class EstimatedPredictor(Predictor):
    """The sender estimates the model from all of its samples and sends the parameters; its `choice` makes the model."""

    __slots__ = ()

    estimated: ClassVar[bool] = True

    @abstractmethod
    def packed(self, model: Any, newest: Sample, grid: SampleGrid) -> ModelParameters:
        """The parameters of a model that its choice made; at most `MOST_PARAMETER_BYTES`."""

    @abstractmethod
    def unpacked(self, data: bytes, newest: Sample, grid: SampleGrid, limits: FitLimits) -> Model | None:
        """The model of such parameters, which may be any bytes; None if it cannot be trusted.

        Raises:
            ValueError: if the predictor sends no parameters of this length.
        """

    def decode(self, payload: Payload, newest: Sample, grid: SampleGrid, limits: FitLimits) -> Model:
        if isinstance(payload, PreviousSample):
            raise ValueError(f"update of {self.name} carries a previous sample, expected model parameters")  # noqa: TRY004 - of a peer
        model = None if payload is None else self.unpacked(payload.data, newest, grid, limits)
        return model or Hold(newest.value)
