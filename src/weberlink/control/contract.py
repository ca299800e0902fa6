"""What the ends of a control scheme are given: constants, parameters, and the model of a contact."""

from dataclasses import dataclass
from typing import Protocol

from weberlink.geometry.vector import Vector

CREDIT_STEP = 1e-4
"""Energy of one unit of credit [J]. Energy handed over is rounded down to it, so rounding never creates energy."""

LEAST_CONTACT = 0.05
"""Smallest force that counts as contact [N]; less is sensor noise or a remainder within a deadband."""

UNREACHED_S = 0.03
"""Time for which a robot that follows may lag behind a contact that the operator feels already [s]."""

FREE_FORCE = 1.0
"""Largest force on the hand that may last without a contact [N]."""


class WallModel(Protocol):
    """A received model of a contact: an elastic surface."""

    @property
    def stiffness(self) -> float:
        """Stiffness s [N/m]."""
        ...

    def at(self, tick: float, position: Vector) -> Vector:
        """The force without friction [N], at a tick of the other side and a position [m]."""
        ...


@dataclass(frozen=True)
class AccountParameters:
    """What bounds the energy out of the hand (`weberlink.control.account`), in the frame of what is displayed.

    Args:
        allowance: energy that the hand may get beyond what it gave [J].
        refill: power with which the allowance returns [W].
        damping: that every hand has at least [N s/m].
        rise: of the force that the hand has not pressed in itself [N/s].
    """

    allowance: float
    refill: float
    damping: float
    rise: float


@dataclass(frozen=True)
class SchemeParameters:
    """Parameters of both ends of a scheme.

    Args:
        tick_period: tick period of both sides [s].
        coupling: stiffness of the robot towards its command [N/m].
        account: of the force on the hand.
        delay: what look-ahead and play-out of both directions add to the round trip [s].
        longest: longest round trip, with that delay [s].
    """

    tick_period: float
    coupling: float
    account: AccountParameters
    delay: float = 0.0
    longest: float = 1.0
