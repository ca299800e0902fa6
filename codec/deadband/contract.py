"""What a deadband is: a bound on the error that stays unsent, and the measure in which that error is compared with it.

A shape is a file beside this one. The decoder knows none of it: what is sent says all that it needs.
"""

from typing import ClassVar, Literal, Protocol

from weberlink.geometry.vector import Vector

Reference = Literal["actual", "displayed", "sent"]


class Deadband(Protocol):
    """One bound on a vector. A sample is sent when `error` is more than `bound`."""

    reads_motion: ClassVar[bool]
    """Whether `bound` reads `moved`; it is computed for those only, and 0 for the others."""

    def bound(self, actual: Vector, displayed: Vector, sent: Vector, moved: float) -> float:
        """Largest error that stays unsent at this tick.

        Args:
            actual: the measured value.
            displayed: what the decoder holds without an update.
            sent: the value last transmitted.
            moved: way of the position since the tick before [m].

        Returns:
            In the unit of the values, >= 0.
        """
        ...

    def error(self, displayed: Vector, actual: Vector) -> float:
        """How wrong a displayed value is, in the unit of the values, >= 0; 0 where nothing is wrong.

        A distance, or what a shape has instead: it need not be symmetric, and may be 0 between different values.
        """
        ...


def check_not_negative(name: str, value: float) -> None:
    if not 0.0 <= value < float("inf"):
        raise ValueError(f"{name} must be >= 0 and finite, not {value!r}")
