"""The interface of a deadband: a bound on the error that stays unsent, and the measure of that error."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import ClassVar, Literal, NamedTuple, Self, get_args

from weberlink.geometry.vector import Vector

Reference = Literal["actual", "displayed", "sent"]


class Option(NamedTuple):
    """A number of a deadband's own in the configuration file.

    Args:
        default: where the file does not give it.
        text: what it means, with its unit.
        least: smallest value allowed; None for no limit. Likewise `above`, which is excluded, and `most`.
    """

    default: float
    text: str
    least: float | None = None
    above: float | None = None
    most: float | None = None


class DeadbandSetup(NamedTuple):
    """What a configuration file says of a deadband.

    Args:
        weber: Weber factor k, >= 0.
        floor: absolute threshold in the unit of the values, >= 0.
        reference: which value k scales.
        tick_period: time between ticks [s].
        options: a number for each of the deadband's own `options`.
    """

    weber: float
    floor: float
    reference: Reference
    tick_period: float
    options: Mapping[str, float]


class Deadband(ABC):
    """A bound on a vector. A sample is sent when `error` is more than `bound`. The decoder needs none of it.

    Attributes:
        name: in configuration files and options; `summary` says what it is, for the JSON schema.
        options: its own options in the configuration file.
        reads_motion: whether `bound` reads `moved`; it is computed for those only, and 0 for the others.
        is_ball: whether `error` is the Euclidean distance. Only then an update may be smoothed.
        needs_actual: whether the Weber factor can only refer to the measured value.
        needs_floor: whether the floor must be above 0.
    """

    __slots__ = ()

    name: ClassVar[str]
    summary: ClassVar[str]
    options: ClassVar[Mapping[str, Option]] = {}
    reads_motion: ClassVar[bool] = False
    is_ball: ClassVar[bool] = True
    needs_actual: ClassVar[bool] = False
    needs_floor: ClassVar[bool] = False

    @classmethod
    def configured(cls, setup: DeadbandSetup) -> Self:
        """The deadband of a configuration file; needed for those in the registry."""
        raise NotImplementedError

    @classmethod
    def defaults(cls) -> dict[str, float]:
        """The options where the file does not give them."""
        return {name: option.default for name, option in cls.options.items()}

    @abstractmethod
    def bound(self, actual: Vector, displayed: Vector, sent: Vector, moved: float) -> float:
        """Largest error that stays unsent at this tick.

        Args:
            actual: the measured value.
            displayed: what the decoder holds without an update.
            sent: the value last transmitted.
            moved: distance that the position moved since the tick before [m].

        Returns:
            In the unit of the values, >= 0.
        """

    @abstractmethod
    def error(self, displayed: Vector, actual: Vector, /) -> float:
        """How wrong a displayed value is, in the unit of the values, >= 0; 0 where nothing is wrong.

        Need not be symmetric, and may be 0 between different values.
        """

    def describe(self) -> str:
        """Name and options for a person."""
        return self.name


def check_not_negative(name: str, value: float) -> None:
    if not 0.0 <= value < float("inf"):
        raise ValueError(f"{name} must be >= 0 and finite, not {value!r}")


def check_reference(reference: str) -> None:
    if reference not in get_args(Reference):
        raise ValueError(f"reference must be one of {', '.join(get_args(Reference))}, not {reference!r}")
