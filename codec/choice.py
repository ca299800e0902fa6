"""How a sender chooses the predictor of an update among those of a bank: the table of choices, and their interface.

To add one, write it here with an entry in `CHOICES`, or an entry point of the group `weberlink.choices`.
"""

from abc import ABCMeta, abstractmethod
from collections.abc import Callable, Sequence
from math import inf
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

from weberlink.codec.deadband import Deadband
from weberlink.codec.predictors import FittedPredictor, Model, Predictor
from weberlink.codec.sample import Sample
from weberlink.compiled import mypyc_attr
from weberlink.geometry.vector import Vector, distance
from weberlink.registry import Registry, check_overrides

if TYPE_CHECKING:
    from weberlink.codec.channel import Channel


class Ahead(NamedTuple):
    """The samples that follow the one to code, tick by tick, up to the first gap; empty without look-ahead.

    `bounds` are their deadbands, where the Weber factor refers to the measured value; otherwise near them.
    """

    values: tuple[Vector, ...] = ()
    places: tuple[Vector, ...] = ()
    bounds: tuple[float, ...] = ()

    def lasts(self, model: Model, tick: int, measure: Callable[[Vector, Vector], float]) -> int:
        """For how many of these ticks a new model of the sample of `tick` stays within the deadband."""
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
HYBRID = "hybrid"


class DueSample(NamedTuple):
    """A sample that is to be sent; of an arm, that of its first part."""

    newest: Sample  # quantized
    earlier: Sample | None  # sent before; None if there is none, or if it is too old to travel
    actual: Vector  # the measured value [N or m]
    place: Vector  # where models are evaluated [m]
    bound: float  # the deadband in force, in the unit of its error
    ahead: Ahead  # what follows, as far as it is known
    selected: int  # index in the bank of the predictor in use at the other end
    model: Model | None  # in use there


@mypyc_attr(allow_interpreted_subclasses=True)
class Choice(metaclass=ABCMeta):
    """The predictor of each update of one channel, and its model, at the sending end.

    Attributes:
        deadband: the one in force, which a live change replaces.
    """

    name: ClassVar[str]  # in configuration files, in the place of a predictor
    follows: ClassVar[bool] = False  # whether it takes in all samples: `learn` and `follow` are called

    def __init__(self, channel: "Channel") -> None:
        self.deadband: Deadband = channel.deadband

    @classmethod
    @abstractmethod
    def bank(cls, signal: str) -> tuple[str, ...]:
        """The predictors that it chooses among by default, of equally good ones the first.

        Args:
            signal: as of `weberlink.codec.predictors.suits`.
        """

    @classmethod
    def takes(cls, predictor: Predictor) -> bool:
        """Whether a predictor may be in its bank; for an estimated one it must make the models."""
        return not predictor.estimated

    @abstractmethod
    def reset(self) -> None:
        """Forget the signal."""

    def learn(self, tick: int, actual: Vector, place: Vector, bound: float) -> None:  # noqa: B027 - if it follows
        """Take in a sample whose decision is due later, with look-ahead."""

    def follow(self, tick: int, actual: Vector, place: Vector, bound: float, ahead: Ahead) -> None:  # noqa: B027 - as above
        """Take in a sample, finite and within the range of the wire, whose decision is due now.

        Args:
            tick: of the sample.
            actual: the measured value [N or m].
            place: where models are evaluated [m].
            bound: the deadband in force.
            ahead: the samples that follow.
        """

    @abstractmethod
    def choose(self, selectors: Sequence[int], due: DueSample) -> tuple[int, Model | None]:
        """One of the selectors, and the model to send.

        The model is read of an estimated predictor only, where None holds the sample. That of a fitted one is fitted by
        both ends.
        """


class Hybrid(Choice):
    """The paper's: the predictor whose value *before* the update is closest; after it, all pass through the sample.

    The smallest w_i = |f_pred,i - f| / |f| is chosen, and used until the next send. The common divisor |f| is left out.
    With look-ahead it chooses among the predictors whose new models last longest in the known signal.
    """

    name: ClassVar[str] = HYBRID

    def __init__(self, channel: "Channel") -> None:
        super().__init__(channel)
        self._channel = channel
        # All of the bank: `Channel` sees to it.
        self._predictors = [each for each in channel.predictors if isinstance(each, FittedPredictor)]
        self.reset()

    @classmethod
    def bank(cls, signal: str) -> tuple[str, ...]:
        return ("zoh", "linear", "plane", "sphere") if signal == "force" else ("zoh", "linear")

    def reset(self) -> None:
        self._newest: Sample | None = None  # that was sent
        self._previous: Sample | None = None  # sent before that

    def choose(self, selectors: Sequence[int], due: DueSample) -> tuple[int, Model | None]:
        newest, previous = self._newest, self._previous
        self._newest, self._previous = due.newest, newest if due.earlier is not None else None
        if newest is None or len(selectors) == 1:
            return selectors[0], None
        channel, predictors, tick = self._channel, self._predictors, due.newest.tick
        limits = channel.fit_limits
        if due.ahead.values:
            new = [predictors[selector].model(due.newest, due.earlier, limits) for selector in selectors]
            lasts = [due.ahead.lasts(model, tick, self.deadband.error) for model in new]
            selectors = [selector for selector, ticks in zip(selectors, lasts, strict=True) if ticks == max(lasts)]
        best, smallest = selectors[0], inf
        for selector in selectors:
            # Of the predictor in use, the model is that of the other end.
            model = due.model if selector == due.selected else None
            if model is None:
                model = predictors[selector].model(newest, previous, limits)
            error = distance(channel.displayable(model.at(tick, due.place), newest), due.actual)
            if error < smallest:
                best, smallest = selector, error
        return best, None


def _check(name: str, entry: Any) -> None:
    if not (isinstance(entry, type) and issubclass(entry, Choice) and entry.name == name):
        raise ValueError(f"choice {name!r}: its entry point must name a subclass of Choice called {name!r}")
    check_overrides(f"choice {name}", entry, Choice, "bank", "reset", "choose")


CHOICES: Registry[type[Choice]] = Registry("choice", {HYBRID: Hybrid}, "weberlink.choices", _check)
"""By name: what a configuration file may name in the place of a predictor."""
