"""What the paper says, as numbers that can be measured again. Knows no measurement."""

from dataclasses import dataclass
from typing import Literal

WEBERS = (0.025, 0.05, 0.10, 0.15, 0.20, 0.30)
"""The Weber factors of the paper."""
WEBER = 0.10
"""The Weber factor at which the paper compares packet rates, and of what counts as good quality here."""


@dataclass(frozen=True)
class Claim:
    """One predictor sends so much less than another.

    Args:
        predictor: that sends less.
        reference: that sends more.
        at: what is held equal: the Weber factor (`WEBER`), or the quality: that of the reference at `WEBER`.
        fewer: share of the reference's packets that is saved.
    """

    predictor: str
    reference: str
    at: Literal["weber", "quality"]
    fewer: float

    @property
    def conditions(self) -> str:
        return f"k = {WEBER:.2f}" if self.at == "weber" else "equal quality"


CLAIMS = (
    Claim("plane", "zoh", "weber", 0.31),
    Claim("sphere", "zoh", "weber", 0.18),
    Claim("hybrid", "zoh", "weber", 0.42),
    Claim("plane", "zoh", "quality", 0.60),
    Claim("sphere", "zoh", "quality", 0.60),
    Claim("plane", "linear", "quality", 0.54),
    Claim("sphere", "linear", "quality", 0.54),
    Claim("hybrid", "plane", "quality", 0.15),
)
"""The paper says 60 and 54 % of "geometry-based" prediction; both of its geometries are looked at."""
