"""The interface of a predictor: how a model is made from samples, and how it travels in an update."""

from abc import ABC
from collections.abc import Callable, Sequence
from typing import Any, ClassVar, NamedTuple, Protocol

from weberlink.codec.parameters import pack, unpack
from weberlink.codec.predictors.model import FitLimits, Hold, Model
from weberlink.codec.sample import Sample, SampleGrid
from weberlink.geometry.vector import ZERO, Vector
from weberlink.update import ModelParameters, Payload, PreviousSample

KEPT = 128
"""Samples that a history holds at least, once so many came."""


class History:
    """The latest samples of a signal at the sender's full rate, the newest last: `values`, and `places` [m]."""

    def __init__(self) -> None:
        self.values: list[Vector] = []
        self.places: list[Vector] = []
        self._tick = 0

    def __len__(self) -> int:
        return len(self.values)

    def add(self, tick: int, value: Vector, place: Vector) -> bool:
        """Append a sample; returns whether it follows the one before. A gap in the ticks clears the history."""
        follows = tick == self._tick + 1 and bool(self.values)
        if not follows:
            self.values, self.places = [], []
        elif len(self.values) >= 2 * KEPT:
            del self.values[:KEPT], self.places[:KEPT]
        self._tick = tick
        self.values.append(value)
        self.places.append(place)
        return follows


class EncodeContext(NamedTuple):
    """What the sender knows when it makes a model to send.

    Args:
        newest: the sample to send, as the wire carries it.
        earlier: the sample sent before; None if there was none, or it is too old.
        bound: the deadband at the newest sample, in the unit of the values.
        history: the samples as measured, up to this one.
    """

    newest: Sample
    earlier: Sample | None
    bound: float
    history: History


class Candidate(Protocol):
    """One way to make a model for a predictor; a predictor may have several."""

    def model(self, context: EncodeContext) -> Model | None:
        """The model to send, finite; None to hold the sample."""


class Candidates(NamedTuple):
    """The candidates of one predictor for one signal, the simplest first.

    Args:
        each: the candidates.
        follow: called after every sample with the history and whether the sample follows the one before; or None.
    """

    each: Sequence[Candidate]
    follow: Callable[[History, bool], None] | None = None


class Predictor(ABC):
    """A predictor. There are two kinds.

    Fitted predictors override `fit` and `needs_previous`: both ends fit the same model to the samples that were sent.
    Estimated predictors set `estimated` and override `candidates`, `widths`, `levels` and `build`: the sender estimates
    the model from all of its samples and sends its parameters.

    Attributes:
        name: in configuration files, reports and telemetry.
        geometric: whether its model reads the position: not for a position channel.
        describes_contact: whether its model is a contact surface: for forces only.
        estimated: whether its parameters are sent.
        doubt: factor on the number of its sends when `adaptive` compares predictors: models that fit noise must be
            clearly better than simpler ones.
    """

    __slots__ = ()

    name: ClassVar[str]
    geometric: ClassVar[bool] = False
    describes_contact: ClassVar[bool] = False
    estimated: ClassVar[bool] = False
    doubt: ClassVar[float] = 1.0

    def fit(self, newest: Sample, previous: Sample | None, limits: FitLimits) -> Model | None:  # noqa: ARG002
        """The model of the two newest samples sent, or None where none can be trusted; never raises."""
        return None

    def needs_previous(self, newest: Sample, previous: Sample) -> bool:  # noqa: ARG002
        """Whether the fit reads the sample before, so that an update must carry it."""
        return False

    def candidates(self, limits: FitLimits, least_force: float) -> Candidates:  # noqa: ARG002
        """The ways to make its model from all samples; `least_force` is the smallest that counts as contact [N]."""
        return Candidates([FittedCandidate(self, limits)])

    def widths(self, grid: SampleGrid) -> tuple[int, ...]:
        """Bits of each parameter field; at most `parameter_bits(grid.size)` together."""
        raise NotImplementedError

    def levels(self, model: Any, newest: Sample, grid: SampleGrid) -> list[int]:
        """The fields of a finite model of a newest sample."""
        raise NotImplementedError

    def build(self, fields: Sequence[int], newest: Sample, grid: SampleGrid, limits: FitLimits) -> Model | None:
        """The model of fields that may hold any bits; None where it cannot be trusted."""
        raise NotImplementedError

    def model(self, newest: Sample, previous: Sample | None, limits: FitLimits) -> Model:
        """The fit, or the newest sample held where there is none."""
        return self.fit(newest, previous, limits) or Hold(newest.value)

    def encode(
        self,
        model: Model | None,
        newest: Sample,
        earlier: Sample | None,
        earlier_levels: tuple[int, ...],
        grid: SampleGrid,
    ) -> Payload:
        """What the update of a sample must carry.

        Args:
            model: made by a candidate of an estimated predictor; None to hold the sample.
            newest: the sample to send.
            earlier: the sample sent before; None if it may not be used.
            earlier_levels: its wire levels.
            grid: of the channel.
        """
        if self.estimated:
            return None if model is None else self.packed(model, newest, grid)
        if earlier is not None and self.needs_previous(newest, earlier):
            return PreviousSample(newest.tick - earlier.tick, earlier_levels)
        return None

    def decode(self, payload: Payload, newest: Sample, grid: SampleGrid, limits: FitLimits) -> Model:
        """The model of an update.

        Raises:
            ValueError: if the payload does not fit the predictor or the channel.
        """
        if isinstance(payload, ModelParameters):
            if not self.estimated:
                raise ValueError(f"update of {self.name} carries model parameters, expected a previous sample")
            fields = unpack(payload.bits, self.widths(grid))
            return self.build(fields, newest, grid, limits) or Hold(newest.value)
        if payload is None:
            return self.model(newest, None, limits)
        if self.estimated:
            raise ValueError(f"update of {self.name} carries a previous sample, expected model parameters")
        if len(payload.levels) != grid.size:
            raise ValueError(
                f"update carries {len(payload.levels)} levels of the previous sample, expected {grid.size}"
            )
        return self.model(newest, grid.sample(newest.tick - payload.gap, payload.levels), limits)

    def packed(self, model: Model, newest: Sample, grid: SampleGrid) -> ModelParameters:
        return ModelParameters(pack(self.levels(model, newest, grid), self.widths(grid)))


class FittedCandidate:
    """The model that both ends fit to the two newest samples sent."""

    def __init__(self, predictor: Predictor, limits: FitLimits) -> None:
        self._predictor = predictor
        self._limits = limits

    def model(self, context: EncodeContext) -> Model | None:
        return self._predictor.fit(context.newest, context.earlier, self._limits)


def same_contact(newest: Sample, previous: Sample) -> bool:
    """Whether both samples touch: a contact starts at the first sample with a force after one without."""
    return ZERO not in (newest.value, previous.value)
