"""Smooth updates: a ramp within the deadband replaces part of the jump that an update makes.

When an update arrives, the displayed value jumps by the error of the old model, at least one just noticeable
difference. Smoothing holds part of the jump back and removes it in equal steps. The encoder's mirror does the same, so
the law of the encoder still holds. The held part lags by the length of the ramp at most; the rest does not lag.
"""

from dataclasses import dataclass

from weberlink.geometry.vector import Vector, norm, scale


@dataclass(frozen=True, slots=True)
class Smoothing:
    """Length and size of the ramp.

    Args:
        ticks: length of the ramp, >= 1.
        share: largest ramp as a share of the deadband, 0 to 0.9; the rest is for the error of the new model meanwhile.

    Raises:
        ValueError: for a number out of range.
    """

    ticks: int
    share: float = 0.4

    def __post_init__(self) -> None:
        if self.ticks < 1:
            raise ValueError(f"ticks must be at least 1, not {self.ticks!r}")
        if not 0.0 <= self.share <= 0.9:
            raise ValueError(f"share must be 0 to 0.9, not {self.share!r}")

    def kept(self, jump: Vector, bound: float) -> Vector:
        """The part of a jump that is held back: the same direction, at most `share` of the deadband.

        Args:
            jump: from the new sample to the value displayed before [N].
            bound: the deadband at the new sample [N].
        """
        longest, length = self.share * bound, norm(jump)
        return jump if length <= longest else scale(jump, longest / length)

    def remaining(self, since: float) -> float:
        """The share of the held part, 0 to 1, that is left `since` ticks after the sample."""
        return min(1.0, max(0.0, 1.0 - since / self.ticks))
