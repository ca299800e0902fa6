"""What a sender knows of a signal: all of its samples, estimates that several predictors share, and samples ahead."""

from abc import abstractmethod
from collections.abc import Callable, Sequence
from typing import Any, ClassVar, NamedTuple, Protocol, TypeVar

from weberlink.codec.choice import NOTHING, Ahead
from weberlink.codec.predictors.contract import EstimatedPredictor, FitLimits, Model
from weberlink.codec.sample import Sample, SampleGrid
from weberlink.geometry.vector import Vector, interpolate

KEPT_S = 0.128  # Time that a full history covers at least [s]
LONGEST_GAP_S = 0.016  # Longest gap in the samples that is filled, by straight lines [s]; a longer one ends the history


class History:
    """The latest samples of a signal at the sender's full rate, the newest last, and their positions [m].

    `bound` is the deadband of the newest one; `follows` tells whether it came one tick after the one before.
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
        filled = [(interpolate(values, value, share), interpolate(places, place, share)) for share in shares]
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
    """What a predictor may know of a signal before it begins; less than `least_contact` [N] is no contact."""

    def __init__(self, grid: SampleGrid, limits: FitLimits, least_contact: float) -> None:
        self.grid = grid
        self.limits = limits
        self.least_contact = least_contact
        self.estimators: dict[Callable[[Signal], Any], Any] = {}

    def estimator(self, kind: Callable[["Signal"], Kind]) -> Kind:
        """The estimator of a kind for this signal, the same for all who ask."""
        if kind not in self.estimators:
            self.estimators[kind] = kind(self)
        found: Kind = self.estimators[kind]
        return found


class EncodeContext(NamedTuple):
    """What the sender knows when it makes a model to send."""

    newest: Sample  # the sample to send, quantized
    earlier: Sample | None  # the sample sent before; None if there is none, or if it is too old
    bound: float  # the deadband at the newest sample, in the unit of the values
    history: History  # the measured samples, the newest included and last
    ahead: Ahead = NOTHING  # the samples that follow it, as far as they are known; estimators have taken them in


class Candidate(Protocol):
    """One method of a predictor to make a model; a predictor may have several."""

    def model(self, context: EncodeContext) -> Model | None:
        """Make the model to send, with finite parameters; None to hold the sample."""


class CandidatePredictor(EstimatedPredictor):
    """An estimated predictor whose models `adaptive` makes, also where it is the only one of a channel."""

    choice: ClassVar[str] = "adaptive"
    # Factor >= 1 on its number of sends where predictors are compared: a model that may fit noise must be clearly
    # better than a simpler one.
    doubt: ClassVar[float] = 1.0

    @abstractmethod
    def candidates(self, signal: Signal) -> Sequence[Candidate]:
        """The candidates for one signal, the simplest first."""
