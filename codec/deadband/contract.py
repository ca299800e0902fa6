"""The interface of a deadband: a bound on the error that stays unsent, and the measure of that error."""

from abc import ABCMeta, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from math import inf
from typing import Any, ClassVar, Literal, NamedTuple, Self, get_args

from weberlink.compiled import mypyc_attr
from weberlink.geometry.vector import Vector

Reference = Literal["actual", "displayed", "sent"]

Measure = Callable[[Vector, Vector], float]
"""How a deadband measures the error of the displayed value against the actual one."""
Measures = Callable[[float], Measure]
"""The measure at a Weber factor, which may change in a session."""


@dataclass(frozen=True)
class NoOptions:
    """Of a deadband without options of its own."""


class DeadbandSetup(NamedTuple):
    """The settings of a deadband in a configuration file.

    Args:
        weber: Weber factor k, >= 0.
        floor: absolute threshold in the unit of the values, >= 0.
        reference: the value that k scales.
        tick_period: time between ticks [s].
        options: the deadband's `Options`.
    """

    weber: float
    floor: float
    reference: Reference
    tick_period: float
    options: Any


@mypyc_attr(allow_interpreted_subclasses=True)
class Deadband(metaclass=ABCMeta):
    """A sample is sent when `error` exceeds `bound`. Only the encoder uses it.

    Attributes:
        name: its name in configuration files and options.
        summary: one sentence for the JSON schema.
        Options: a dataclass of its own options in the configuration file: numbers with a default, and the range of
            each as `annotated_types` say it.
        reads_motion: whether `bound` reads `moved`; for the others it is not computed, and 0.
        is_ball: whether `error` is the Euclidean distance. Only then may an update be smoothed.
        needs_actual: whether the Weber factor can refer to the measured value only.
        needs_floor: whether the floor must be above 0.
    """

    __slots__ = ()

    name: ClassVar[str]
    summary: ClassVar[str]
    Options: ClassVar[type[Any]] = NoOptions
    reads_motion: ClassVar[bool] = False
    is_ball: ClassVar[bool] = True
    needs_actual: ClassVar[bool] = False
    needs_floor: ClassVar[bool] = False

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
