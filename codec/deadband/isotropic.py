"""The same bound in all directions: a ball around the measured force."""

from dataclasses import dataclass, field
from typing import ClassVar, get_args

from weberlink.codec.deadband.contract import Reference, check_not_negative
from weberlink.geometry.vector import Vector, distance, norm


@dataclass(frozen=True, slots=True)
class ForceDeadband:
    """Weber's law with an absolute threshold: `|f_pred - f| <= max(k |f_ref|, floor)`.

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
    reads_motion: ClassVar[bool] = False

    def __post_init__(self) -> None:
        check_not_negative("weber", self.weber)
        check_not_negative("floor", self.floor)
        object.__setattr__(self, "which", which_reference(self.reference))

    def bound(self, actual: Vector, displayed: Vector, sent: Vector, moved: float) -> float:  # noqa: ARG002
        which = self.which
        reference = actual if which == 0 else displayed if which == 1 else sent
        relative = self.weber * norm(reference)
        return relative if relative > self.floor else self.floor

    error = staticmethod(distance)


def which_reference(reference: str) -> int:
    """The place of a reference among those there are.

    Raises:
        ValueError: if it is none of them.
    """
    known = get_args(Reference)
    if reference not in known:
        raise ValueError(f"reference must be one of {', '.join(known)}, not {reference!r}")
    return known.index(reference)
