"""Velocity-adaptive: the Weber factor grows with the speed of the hand.

A hand in motion feels changes of force less: Kammerl, Vittorias, Nitsch, Faerber, Steinbach, Hirche, "Perception-based
data reduction for haptic force-feedback signals using velocity-adaptive deadbands", Presence 19(5), 2010.
"""

from dataclasses import dataclass, field
from typing import Annotated, Self

from annotated_types import Interval

from weberlink.codec.deadband import Deadband, DeadbandSetup, Reference, check_not_negative, check_reference
from weberlink.geometry.vector import Vector, norm

SLOPE_S_M = 0.5
MOST_WEBER = 0.25


@dataclass(frozen=True)
class VelocityOptions:
    slope_s_m: Annotated[float, Interval(ge=0, le=100)] = SLOPE_S_M
    """Growth of the Weber factor with speed [s/m]."""
    most_weber: Annotated[float, Interval(ge=0, le=1)] = MOST_WEBER
    """The Weber factor grows no further."""


@dataclass(frozen=True, slots=True)
class VelocityDeadband(Deadband):
    """`|f_pred - f| <= max(k(v) |f_ref|, floor)` with `k(v) = k + slope |v|`, at most `most` (or k, if that is more).

    The speed is that of the position since the tick before, without a filter; `most` bounds the effect of a jump.
    ValueError for a number out of its range or an unknown reference.
    """

    name = "velocity_adaptive"
    summary = "The Weber factor grows with the speed of the hand."
    Options = VelocityOptions
    reads_motion = True

    weber: float  # k at rest, >= 0
    floor: float = 0.0  # absolute threshold [N], >= 0
    reference: Reference = "actual"  # the force that k scales
    slope: float = SLOPE_S_M  # growth of k with speed [s/m], >= 0
    most: float = MOST_WEBER  # limit of that growth, >= 0
    period: float = 1e-3  # time between ticks [s], > 0
    per_metre: float = field(init=False, repr=False, compare=False)  # Growth of k by the distance moved in a tick [1/m]
    highest: float = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        for name in ("weber", "floor", "slope", "most"):
            check_not_negative(name, getattr(self, name))
        if not 0.0 < self.period < float("inf"):
            raise ValueError(f"period must be above 0 and finite, not {self.period!r}")
        check_reference(self.reference)
        object.__setattr__(self, "per_metre", self.slope / self.period)
        object.__setattr__(self, "highest", max(self.weber, self.most))

    @classmethod
    def configured(cls, setup: DeadbandSetup) -> Self:
        return cls(
            setup.weber,
            setup.floor,
            setup.reference,
            setup.options.slope_s_m,
            setup.options.most_weber,
            setup.tick_period,
        )

    def describe(self) -> str:
        return f"velocity-adaptive, k + {self.slope:g} s/m of the speed, at most {self.most:g}"

    def bound(self, actual: Vector, displayed: Vector, sent: Vector, moved: float) -> float:
        name = self.reference
        reference = actual if name == "actual" else displayed if name == "displayed" else sent
        grown = self.weber + self.per_metre * moved
        # The comparison is False for NaN (an infinite distance times a slope of 0), so that gives `highest`.
        return max(self.floor, (grown if grown < self.highest else self.highest) * norm(reference))
