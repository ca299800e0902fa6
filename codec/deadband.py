"""Deadbands: the prediction error at which a sample is sent. docs/deadbands.md helps to choose one.

To add one for forces, write it here with an entry in `DEADBANDS`, or an entry point of the group `weberlink.deadbands`.
"""

from abc import ABCMeta, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from math import inf
from typing import Any, ClassVar, Final, Literal, NamedTuple, Self, get_args

from weberlink.compiled import mypyc_attr
from weberlink.geometry.vector import Vector, distance, norm
from weberlink.registry import Registry, check_overrides

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
    options: Any  # has the fields of the deadband's `Options`


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

    def error(self, displayed: Vector, actual: Vector, /) -> float:
        """The error of a displayed value, in the unit of the values, >= 0; of a ball, their distance.

        That of another shape need not be symmetric, and may be 0 for different values.
        """
        return distance(displayed, actual)

    def describe(self) -> str:
        """Name and options in words."""
        return self.name


def check_not_negative(name: str, value: float) -> None:
    if not 0.0 <= value < inf:
        raise ValueError(f"{name} must be >= 0 and finite, not {value!r}")


def check_reference(reference: str) -> None:
    if reference not in get_args(Reference):
        raise ValueError(f"reference must be one of {', '.join(get_args(Reference))}, not {reference!r}")


class ForceDeadband(Deadband):
    """Weber's law with an absolute threshold: `|f_pred - f| <= max(k |f_ref|, floor)`.

    The floor is the absolute detection threshold: Weber's law fails for small forces, and with `k` alone a sensor at
    rest sends its noise at every tick. A floor of 0 is the paper's decision function.

    Args:
        weber: Weber factor k, >= 0; the paper studies 0.025 to 0.30.
        floor: absolute threshold [N], >= 0.
        reference: the force that k scales: the measured one (the paper), the displayed one or the last one sent.

    Raises:
        ValueError: for a negative or non-finite number or an unknown reference.
    """

    __slots__ = ("floor", "reference", "weber")

    name: ClassVar[str] = "isotropic"
    summary: ClassVar[str] = "The same bound in all directions."

    def __init__(self, weber: float, floor: float = 0.0, reference: Reference = "actual") -> None:
        check_not_negative("weber", weber)
        check_not_negative("floor", floor)
        check_reference(reference)
        self.weber: Final = weber
        self.floor: Final = floor
        self.reference: Final[Reference] = reference

    @classmethod
    def configured(cls, setup: DeadbandSetup) -> Self:
        return cls(setup.weber, setup.floor, setup.reference)

    def bound(self, actual: Vector, displayed: Vector, sent: Vector, moved: float) -> float:  # noqa: ARG002
        name = self.reference
        reference = actual if name == "actual" else displayed if name == "displayed" else sent
        scaled, floor = self.weber * norm(reference), self.floor
        return scaled if scaled > floor else floor


class PositionDeadband(Deadband):
    """A bound in metres plus a Weber bound on velocity: `least + k |v| T`, T the tick period.

    `k |v| T` is the displacement that a velocity error of `k |v|` makes in one tick. `|v| T` is the distance moved
    since the tick before: no filter, no lag.

    Args:
        weber: Weber factor k of velocity, >= 0.
        least: position bound at rest [m], >= 0.

    Raises:
        ValueError: for a negative or non-finite number.
    """

    __slots__ = ("least", "weber")

    name: ClassVar[str] = "position"
    reads_motion: ClassVar[bool] = True

    def __init__(self, weber: float, least: float) -> None:
        check_not_negative("weber", weber)
        check_not_negative("bound", least)
        self.weber: Final = weber
        self.least: Final = least

    def bound(self, actual: Vector, displayed: Vector, sent: Vector, moved: float) -> float:  # noqa: ARG002
        return self.least + self.weber * moved


class PerAxisDeadband(Deadband):
    """Weber's law on each axis, for joints, whose thresholds differ: `|d_i - a_i| <= max(k |a_i|, floor_i)` for all i.

    d is displayed, a measured. The error is the largest of the ratios, so it has no unit, and the bound is 1.

    Args:
        weber: Weber factor k of the value on its own axis, >= 0.
        floors: absolute thresholds in the unit of the values, > 0; infinite for an axis that is not coded.
        resolution: largest error of the wire on an axis, >= 0. A smaller error than this counts as none.

    Raises:
        ValueError: for a number out of its range.
    """

    __slots__ = ("floors", "resolution", "weber")

    name: ClassVar[str] = "per_axis"
    is_ball: ClassVar[bool] = False

    def __init__(self, weber: float, floors: Vector, resolution: float = 0.0) -> None:
        check_not_negative("weber", weber)
        check_not_negative("resolution", resolution)
        for floor in floors:
            if not floor > 0.0:
                raise ValueError(f"the threshold of an axis must be above 0, not {floor!r}")
        self.weber: Final = weber
        self.floors: Final = floors
        self.resolution: Final = resolution

    def bound(self, actual: Vector, displayed: Vector, sent: Vector, moved: float) -> float:  # noqa: ARG002
        return 1.0

    def error(self, displayed: Vector, actual: Vector, /) -> float:
        weber, resolution, floors = self.weber, self.resolution, self.floors
        largest = 0.0
        for index in (0, 1, 2):
            value, floor = actual[index], floors[index]
            apart = abs(displayed[index] - value)
            if apart > resolution:
                largest = max(largest, apart / max(floor, weber * abs(value)))
        return largest


def _check(name: str, entry: Any) -> None:
    if not (isinstance(entry, type) and issubclass(entry, Deadband) and entry.name == name):
        raise ValueError(f"deadband {name!r}: its entry point must name a subclass of Deadband called {name!r}")
    needed = ("configured", "bound") if entry.is_ball else ("configured", "bound", "error")
    check_overrides(f"deadband {name}", entry, Deadband, *needed)


ISOTROPIC = "isotropic"
DEADBANDS: Registry[type[Deadband]] = Registry("deadband", {ISOTROPIC: ForceDeadband}, "weberlink.deadbands", _check)
"""The deadbands of a force, by name."""
