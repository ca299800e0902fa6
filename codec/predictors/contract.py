"""The interface of a predictor: how it makes a model from samples, and how the model travels in an update."""

from abc import ABCMeta
from collections.abc import Callable, Sequence
from typing import Any, ClassVar, NamedTuple, Protocol, TypeVar

from weberlink.codec.parameters import pack, unpack
from weberlink.codec.predictors.model import FitLimits, Hold, Model
from weberlink.codec.sample import Sample, SampleGrid
from weberlink.compiled import mypyc_attr
from weberlink.geometry.vector import ZERO, Vector, add, scale, subtract
from weberlink.update import ModelParameters, Payload, PreviousSample

KEPT_S = 0.128
"""Time that a full history covers at least [s]."""
LONGEST_GAP_S = 0.016
"""Longest gap in the samples that is filled, by straight lines [s]; a longer one ends the history."""


class History:
    """The latest samples of a signal at the sender's full rate, the newest last.

    Args:
        period: time between ticks [s].

    Attributes:
        values: of the samples.
        places: their positions [m].
        bound: deadband of the newest one.
        follows: whether the newest one came one tick after the one before.
    """

    def __init__(self, period: float) -> None:
        self.values: list[Vector] = []
        self.places: list[Vector] = []
        self.bound = 0.0
        self.follows = False
        self._tick = 0
        self._kept = max(2, round(KEPT_S / period))
        self._longest_gap = round(LONGEST_GAP_S / period)

    def __len__(self) -> int:
        return len(self.values)

    def missing(self, tick: int, value: Vector, place: Vector) -> list[tuple[int, Vector, Vector]]:
        """What to add before a sample, to fill a short gap in the ticks: tick, value and position of each sample."""
        gap = tick - self._tick
        if not (self.values and 1 < gap <= self._longest_gap):
            return []
        values, places = self.values[-1], self.places[-1]
        shares = [step / gap for step in range(1, gap)]
        filled = [(_between(values, value, share), _between(places, place, share)) for share in shares]
        return [(self._tick + step, *each) for step, each in enumerate(filled, 1)]

    def add(self, tick: int, value: Vector, place: Vector, bound: float) -> None:
        """Append a sample. A gap in the ticks clears the history."""
        self.follows = tick == self._tick + 1 and bool(self.values)
        if not self.follows:
            self.values, self.places = [], []
        elif len(self.values) >= 2 * self._kept:
            del self.values[: self._kept], self.places[: self._kept]
        self._tick, self.bound = tick, bound
        self.values.append(value)
        self.places.append(place)


class Estimator(Protocol):
    """Learns from every sample of one signal. Several candidates may read it."""

    def follow(self, history: History) -> None:
        """Take in the newest sample."""


Kind = TypeVar("Kind", bound=Estimator)


class Signal:
    """What a predictor may know of a signal before it begins.

    Attributes:
        grid: the grid of the channel.
        limits: the range in which a fitted contact is accepted.
        least_contact: smallest force that counts as contact [N].
        estimators: those that `estimator` has made.
    """

    def __init__(self, grid: SampleGrid, limits: FitLimits, least_contact: float) -> None:
        self.grid = grid
        self.limits = limits
        self.least_contact = least_contact
        self.estimators: dict[Callable[[Signal], Any], Any] = {}

    @property
    def has_positions(self) -> bool:
        """Whether each value has a position that the receiver knows too."""
        return self.grid.position is not None

    def estimator(self, kind: Callable[["Signal"], Kind]) -> Kind:
        """The estimator of a kind for this signal, the same for all who ask."""
        if kind not in self.estimators:
            self.estimators[kind] = kind(self)
        found: Kind = self.estimators[kind]
        return found


class Ahead(NamedTuple):
    """The samples that follow the one to code, tick by tick, up to the first gap; empty without look-ahead.

    Args:
        values: within the range of the wire.
        places: where models are evaluated [m].
        bounds: the deadband of each, where its Weber factor refers to the measured value; otherwise near it.
    """

    values: tuple[Vector, ...] = ()
    places: tuple[Vector, ...] = ()
    bounds: tuple[float, ...] = ()

    def lasts(self, model: Model, tick: int, measure: Callable[[Vector, Vector], float]) -> int:
        """For how many of these ticks a new model of the sample of a tick stays within the deadband.

        Args:
            model: as it is sent.
            tick: of the sample to code.
            measure: the error of a displayed value, as a deadband measures it.
        """
        memory = model.memory
        for index, (value, place, bound) in enumerate(zip(*self, strict=True)):
            if memory is None:
                predicted = model.at(tick + 1 + index, place)
            else:
                predicted, memory = model.advance(tick + 1 + index, place, memory)
            if not measure(predicted, value) <= bound:
                return index
        return len(self.values)


NOTHING = Ahead()


class EncodeContext(NamedTuple):
    """What the sender knows when it makes a model to send.

    Args:
        newest: the sample to send, quantized.
        earlier: the sample sent before; None if there is none, or if it is too old.
        bound: the deadband at the newest sample, in the unit of the values.
        history: the measured samples, the newest included and last.
        ahead: the samples that follow it, as far as they are known; none without look-ahead. Estimators have taken
            them in.
    """

    newest: Sample
    earlier: Sample | None
    bound: float
    history: History
    ahead: Ahead = NOTHING


class Candidate(Protocol):
    """One method of a predictor to make a model; a predictor may have several."""

    def model(self, context: EncodeContext) -> Model | None:
        """Make the model to send, with finite parameters; None to hold the sample."""


@mypyc_attr(allow_interpreted_subclasses=True)
class Predictor(metaclass=ABCMeta):
    """A predictor. There are two kinds.

    Fitted predictors override `fit` and `needs_previous`: both ends fit the same model to the samples that were sent.
    Estimated predictors set `estimated` and override `candidates`: the sender estimates the model from all of its
    samples and sends the parameters. Those with the same fields in every model override `widths`, `levels` and `build`;
    others override `packed` and `unpacked`.

    Attributes:
        name: its name in configuration files, reports and telemetry.
        geometric: whether its model reads the position, so that its updates must carry it; then it is not for a
            position channel.
        describes_contact: whether its model is a contact surface; then it is for forces only.
        estimated: whether its parameters are sent.
        looks_ahead: whether its candidates read the samples that are known ahead.
        doubt: factor >= 1 on its number of sends when `adaptive` compares predictors, so that a model that may fit
            noise must be clearly better than a simpler one.
    """

    __slots__ = ()

    name: ClassVar[str]
    geometric: ClassVar[bool] = False
    describes_contact: ClassVar[bool] = False
    estimated: ClassVar[bool] = False
    looks_ahead: ClassVar[bool] = False
    doubt: ClassVar[float] = 1.0

    def fit(self, newest: Sample, previous: Sample | None, limits: FitLimits) -> Model | None:  # noqa: ARG002
        """Fit the two newest samples sent; None if no model can be trusted. Never raises."""
        return None

    def needs_previous(self, newest: Sample, previous: Sample) -> bool:  # noqa: ARG002
        """Whether the fit reads the previous sample, so that an update must carry it."""
        return False

    def candidates(self, signal: Signal) -> Sequence[Candidate]:
        """The candidates for one signal, the simplest first."""
        return [FittedCandidate(self, signal.limits)]

    def widths(self, grid: SampleGrid) -> tuple[int, ...]:
        """Bits of each parameter field; together at most `MOST_PARAMETER_BYTES`."""
        raise NotImplementedError

    def levels(self, model: Any, newest: Sample, grid: SampleGrid) -> list[int]:
        """The field values of a model with finite parameters."""
        raise NotImplementedError

    def build(self, fields: Sequence[int], newest: Sample, grid: SampleGrid, limits: FitLimits) -> Model | None:
        """The model of field values, which may be any bits; None if it cannot be trusted."""
        raise NotImplementedError

    def groups(self, grid: SampleGrid) -> tuple[int, ...]:
        """Numbers of levels of what the predictor reads of a sample: the value, then (if `geometric`) the position."""
        return grid.groups if self.geometric else grid.groups[:1]

    def model(self, newest: Sample, previous: Sample | None, limits: FitLimits) -> Model:
        """The fitted model; if there is none, the newest sample is held."""
        return self.fit(newest, previous, limits) or Hold(newest.value)

    def encode(
        self,
        model: Model | None,
        newest: Sample,
        earlier: Sample | None,
        earlier_levels: tuple[int, ...],
        grid: SampleGrid,
    ) -> Payload:
        """The payload of an update.

        Args:
            model: the model of an estimated predictor; None to hold the sample. Not read if the predictor is fitted.
            newest: the sample to send.
            earlier: the sample sent before; None if it may not be used.
            earlier_levels: wire levels of that sample, with its position.
            grid: the grid of the channel.
        """
        if self.estimated:
            return None if model is None else self.packed(model, newest, grid)
        if earlier is not None and self.needs_previous(newest, earlier):
            return PreviousSample(newest.tick - earlier.tick, earlier_levels[: sum(self.groups(grid))])
        return None

    def decode(self, payload: Payload, newest: Sample, grid: SampleGrid, limits: FitLimits) -> Model:
        """The model of an update.

        Raises:
            ValueError: if the payload does not fit the predictor or the channel.
        """
        if isinstance(payload, ModelParameters):
            if not self.estimated:
                raise ValueError(f"update of {self.name} carries model parameters, expected a previous sample")
            return self.unpacked(payload.data, newest, grid, limits) or Hold(newest.value)
        if payload is None:
            return self.model(newest, None, limits)
        if self.estimated:
            raise ValueError(f"update of {self.name} carries a previous sample, expected model parameters")
        size = sum(self.groups(grid))
        if len(payload.levels) != size:
            raise ValueError(f"update carries {len(payload.levels)} levels of the previous sample, expected {size}")
        return self.model(newest, grid.sample(newest.tick - payload.gap, payload.levels), limits)

    def packed(self, model: Model, newest: Sample, grid: SampleGrid) -> ModelParameters:
        """The parameters of an estimated model, by default its fields; at most `MOST_PARAMETER_BYTES`."""
        return ModelParameters(pack(self.levels(model, newest, grid), self.widths(grid)))

    def unpacked(self, data: bytes, newest: Sample, grid: SampleGrid, limits: FitLimits) -> Model | None:
        """The model of such parameters, which may be any bytes; None if it cannot be trusted.

        Raises:
            ValueError: if the predictor sends no parameters of this length.
        """
        return self.build(unpack(data, self.widths(grid)), newest, grid, limits)


class FittedCandidate:
    """The candidate of a fitted predictor: the model that both ends fit to the two newest samples sent."""

    def __init__(self, predictor: Predictor, limits: FitLimits) -> None:
        self._predictor = predictor
        self._limits = limits

    def model(self, context: EncodeContext) -> Model | None:
        return self._predictor.fit(context.newest, context.earlier, self._limits)


def _between(start: Vector, end: Vector, share: float) -> Vector:
    return add(start, scale(subtract(end, start), share))


def same_contact(newest: Sample, previous: Sample) -> bool:
    """Whether both samples have a force, and so may belong to one contact."""
    return ZERO not in (newest.value, previous.value)
