"""The interface of a deadband: a bound on the error that stays unsent, and the measure of that error."""

from abc import ABCMeta, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from math import inf
from typing import Any, ClassVar, Literal, NamedTuple, Self, get_args

from weberlink.compiled import mypyc_attr
from weberlink.geometry.vector import Vector

Reference = Literal["actual", "displayed", "sent"]

Measure = Callable[[Vector, Vector], float]  # Error of the displayed value against the actual one
Measures = Callable[[float], Measure]  # The measure at a Weber factor, which may change in a session


@dataclass(frozen=True)
class NoOptions:
    """Of a deadband without options of its own."""


class DeadbandSetup(NamedTuple):
    """The settings of a deadband in a configuration file."""

    weber: float  # Weber factor k, >= 0
    floor: float  # absolute threshold in the unit of the values, >= 0
    reference: Reference  # the value that k scales
    tick_period: float  # time between ticks [s]
    options: Any  # the deadband's `Options`


@mypyc_attr(allow_interpreted_subclasses=True)
class Deadband(metaclass=ABCMeta):
    """A sample is sent when `error` exceeds `bound`. Only the encoder uses it."""

    __slots__ = ()

    name: ClassVar[str]  # in configuration files and options
    summary: ClassVar[str]  # one sentence for the JSON schema
    # A dataclass of its options in the configuration file: numbers with a default and a range of `annotated_types`.
    Options: ClassVar[type[Any]] = NoOptions
    reads_motion: ClassVar[bool] = False  # whether `bound` reads `moved`; for the others it is not computed, and 0
    is_ball: ClassVar[bool] = True  # whether `error` is the Euclidean distance: only then may an update be smoothed
    needs_actual: ClassVar[bool] = False  # whether the Weber factor can refer to the measured value only
    needs_floor: ClassVar[bool] = False  # whether the floor must be above 0

    @classmethod
    def configured(cls, setup: DeadbandSetup) -> Self:
        """Build the deadband from a configuration file; every deadband of the registry overrides this."""
        raise NotImplementedError

    @abstractmethod
    def bound(self, actual: Vector, displayed: Vector, sent: Vector, moved: float) -> float:
        """The largest error that stays unsent at this tick.

        Args:
            actual: the measured value.
            displayed: the decoder's value without an update.
            sent: the last value sent.
            moved: distance that the position moved since the tick before [m], >= 0.

        Returns:
            In the unit of the values, >= 0.
        """

    @abstractmethod
    def error(self, displayed: Vector, actual: Vector, /) -> float:
        """The error of a displayed value, in the unit of the values, >= 0.

        Need not be symmetric, and may be 0 for different values.
        """

    def describe(self) -> str:
        """Name and options in words."""
        return self.name


def check_not_negative(name: str, value: float) -> None:
    if not 0.0 <= value < inf:
        raise ValueError(f"{name} must be >= 0 and finite, not {value!r}")


def check_reference(reference: str) -> None:
    if reference not in get_args(Reference):
        raise ValueError(f"reference must be one of {', '.join(get_args(Reference))}, not {reference!r}")
