"""How a sender chooses the predictor of an update among those of a bank: the table of choices, and their interface.

To add one, write a file in this folder and a line here, or an entry point of the group `weberlink.choices`.
"""

from abc import ABCMeta, abstractmethod
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

from weberlink.codec.deadband import Deadband
from weberlink.codec.predictors import Predictor
from weberlink.codec.predictors.model import Model
from weberlink.codec.sample import Sample
from weberlink.compiled import mypyc_attr
from weberlink.geometry.vector import Vector
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


def _check(name: str, entry: Any) -> None:
    if not (isinstance(entry, type) and issubclass(entry, Choice) and entry.name == name):
        raise ValueError(f"choice {name!r}: its entry point must name a subclass of Choice called {name!r}")
    check_overrides(f"choice {name}", entry, Choice, "bank", "reset", "choose")


HYBRID = "hybrid"
CHOICES: Registry[type[Choice]] = Registry(
    "choice", {HYBRID: "weberlink.codec.hybrid:Hybrid"}, "weberlink.choices", _check
)
"""By name: what a configuration file may name in the place of a predictor."""
