"""When a prediction is wrong by more than a person could feel: the bound that decides whether a sample is sent."""

from collections.abc import Callable
from typing import Literal, Protocol

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


class ForceDeadband:
    """Weber's law with an absolute threshold: `max(k |f_ref|, floor)`.

    The law fails below about 1 N, and with `k` alone a sensor at rest sends its noise at every tick: the floor is the
    absolute detection threshold. A floor of 0 is the paper's decision function.
    """

    __slots__ = ("_floor", "_reference", "_weber")

    def __init__(self, weber: float, floor: float = 0.0, reference: Reference = "actual") -> None:
        """Make the deadband.

        Args:
            weber: Weber factor k, >= 0; the paper studies 0.025 to 0.30.
            floor: absolute threshold [N], >= 0.
            reference: which force k scales: the measured one (the paper), the displayed or the last one sent.

        Raises:
            ValueError: for a negative or non-finite number or an unknown reference.
        """
        _check_not_negative("weber", weber)
        _check_not_negative("floor", floor)
        self._weber = weber
        self._floor = floor
        if reference not in _REFERENCES:
            raise ValueError(f"reference must be one of {', '.join(_REFERENCES)}, not {reference!r}")
        self._reference = _REFERENCES[reference]

    def bound(self, actual: Vector, displayed: Vector, sent: Vector, last: Vector) -> float:  # noqa: ARG002
        relative = self._weber * norm(self._reference(actual, displayed, sent))
        return relative if relative > self._floor else self._floor


class PositionDeadband:
    """A bound in metres plus a Weber bound on velocity: `bound + k |v| T`, T one tick.

    `|v| T` is the way moved since the tick before, so the velocity needs no filter and adds no lag: a hand in fast
    motion is allowed the displacement that a velocity error of k |v| makes in one tick.
    """

    __slots__ = ("_bound", "_weber")

    def __init__(self, weber: float, bound: float) -> None:
        """Make the deadband.

        Args:
            weber: Weber factor of velocity, >= 0.
            bound: position bound at rest [m], >= 0.

        Raises:
            ValueError: for a negative or non-finite number.
        """
        _check_not_negative("weber", weber)
        _check_not_negative("bound", bound)
        self._weber = weber
        self._bound = bound

    def bound(self, actual: Vector, displayed: Vector, sent: Vector, last: Vector) -> float:  # noqa: ARG002
        return self._bound + self._weber * distance(actual, last)


_REFERENCES: dict[str, Callable[[Vector, Vector, Vector], Vector]] = {
    "actual": lambda actual, _displayed, _sent: actual,
    "displayed": lambda _actual, displayed, _sent: displayed,
    "sent": lambda _actual, _displayed, sent: sent,
}


def _check_not_negative(name: str, value: float) -> None:
    if not 0.0 <= value < float("inf"):
        raise ValueError(f"{name} must be >= 0 and finite, not {value!r}")
