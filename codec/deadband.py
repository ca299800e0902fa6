"""When a prediction is wrong by more than a person could feel: the bound that decides whether a sample is sent."""

from dataclasses import dataclass, field
from typing import Literal, Protocol, get_args

from codec.vector import Vector, distance, norm

Reference = Literal["actual", "displayed", "sent"]


class Deadband(Protocol):
    """One isotropic bound on a vector."""

    def bound(self, actual: Vector, displayed: Vector, sent: Vector, last: Vector) -> float:
        """Largest error that stays unsent at this tick.

        Args:
            actual: the measured value.
            displayed: what the decoder holds without an update.
            sent: the value last transmitted.
            last: the measured value of the tick before.

        Returns:
            The radius of the deadband, in the unit of the values, >= 0.
        """
        ...


@dataclass(frozen=True, slots=True)
class ForceDeadband:
    """Weber's law with an absolute threshold: `max(k |f_ref|, floor)`.

    The law fails below about 1 N, and with `k` alone a sensor at rest sends its noise at every tick: the floor is the
    absolute detection threshold. A floor of 0 is the paper's decision function.

    Args:
        weber: Weber factor k, >= 0; the paper studies 0.025 to 0.30.
        floor: absolute threshold [N], >= 0.
        reference: which force k scales: the measured one (the paper), the displayed or the last one sent.

    Raises:
        ValueError: for a negative or non-finite number or an unknown reference.
    """

    weber: float
    floor: float = 0.0
    reference: Reference = "actual"
    which: int = field(init=False, repr=False, compare=False)
    """Of `reference` among those there are: quicker to compare than its name."""

    def __post_init__(self) -> None:
        _check_not_negative("weber", self.weber)
        _check_not_negative("floor", self.floor)
        if self.reference not in get_args(Reference):
            raise ValueError(f"reference must be one of {', '.join(get_args(Reference))}, not {self.reference!r}")
        object.__setattr__(self, "which", get_args(Reference).index(self.reference))

    def bound(self, actual: Vector, displayed: Vector, sent: Vector, last: Vector) -> float:  # noqa: ARG002
        which = self.which
        reference = actual if which == 0 else displayed if which == 1 else sent
        relative = self.weber * norm(reference)
        return relative if relative > self.floor else self.floor


@dataclass(frozen=True, slots=True)
class PositionDeadband:
    """A bound in metres plus a Weber bound on velocity: `bound + k |v| T`, T one tick.

    `|v| T` is the way moved since the tick before, so the velocity needs no filter and adds no lag: a hand in fast
    motion is allowed the displacement that a velocity error of k |v| makes in one tick.

    Args:
        weber: Weber factor of velocity, >= 0.
        least: position bound at rest [m], >= 0.

    Raises:
        ValueError: for a negative or non-finite number.
    """

    weber: float
    least: float

    def __post_init__(self) -> None:
        _check_not_negative("weber", self.weber)
        _check_not_negative("bound", self.least)

    def bound(self, actual: Vector, displayed: Vector, sent: Vector, last: Vector) -> float:  # noqa: ARG002
        return self.least + self.weber * distance(actual, last)


def _check_not_negative(name: str, value: float) -> None:
    if not 0.0 <= value < float("inf"):
        raise ValueError(f"{name} must be >= 0 and finite, not {value!r}")
