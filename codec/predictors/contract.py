"""The interface of a predictor: how it makes a model from samples, and how the model travels in an update."""

from abc import ABCMeta, abstractmethod
from typing import Any, ClassVar

from weberlink.codec.predictors.model import FitLimits, Hold, Model
from weberlink.codec.sample import Sample, SampleGrid
from weberlink.compiled import mypyc_attr
from weberlink.update import ModelParameters, Payload, PreviousSample


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
    def decode(
        self, payload: Payload, newest: Sample, grid: SampleGrid, limits: FitLimits, previous: Sample | None = None
    ) -> Model:
        """The model of an update; it holds the newest sample if none can be trusted.

        Args:
            payload: what the update carries beside the newest sample.
            newest: that sample.
            grid: of the channel.
            limits: the range of accepted contacts.
            previous: the previous sample of the payload, where it is known already.

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

    def decode(
        self, payload: Payload, newest: Sample, grid: SampleGrid, limits: FitLimits, previous: Sample | None = None
    ) -> Model:
        size = grid.size if self.geometric else grid.value.size
        if payload is None:
            previous = None
        elif isinstance(payload, ModelParameters):
            raise ValueError(f"update of {self.name} carries model parameters, expected a previous sample")
        elif len(payload.levels) != size:
            raise ValueError(f"update carries {len(payload.levels)} levels of the previous sample, expected {size}")
        elif previous is None:
            previous = grid.sample(newest.tick - payload.gap, payload.levels)
        return self.model(newest, previous, limits)


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

    def decode(
        self,
        payload: Payload,
        newest: Sample,
        grid: SampleGrid,
        limits: FitLimits,
        previous: Sample | None = None,  # noqa: ARG002
    ) -> Model:
        if isinstance(payload, PreviousSample):
            raise ValueError(f"update of {self.name} carries a previous sample, expected model parameters")  # noqa: TRY004 - of a peer
        model = None if payload is None else self.unpacked(payload.data, newest, grid, limits)
        return model or Hold(newest.value)
