"""Smooth updates: what a new model changes at once is given back over some ticks, within the deadband.

When an update arrives, the value jumps by what the old model was wrong, a just noticeable difference at least. Part of
the jump is kept and taken off in equal steps: a ramp. The encoder's mirror does the same, so its law holds with the
ramp and not in spite of it. The lag is the length of the ramp, and what of the jump exceeds the deadband does not lag
at all.
"""

from dataclasses import dataclass

from weberlink.geometry.vector import Vector, norm, scale


@dataclass(frozen=True, slots=True)
class Smoothing:
    """How a change of model is spread.

    Args:
        ticks: length of the ramp, >= 1.
        share: of the deadband that the ramp may use, 0 to 0.9: the rest is for the error that the new model makes
            meanwhile.

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
        """The part of a jump that is given back later.

        Args:
            jump: from the new sample to the value displayed before.
            bound: the deadband at the new sample.
        """
        longest, length = self.share * bound, norm(jump)
        return jump if length <= longest else scale(jump, longest / length)

    def remaining(self, since: float) -> float:
        """Share of it that is still there so many ticks after the sample, 0 to 1."""
        return min(1.0, max(0.0, 1.0 - since / self.ticks))
