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
    """What bounds the energy out of the hand (`weberlink.control.account`), in the frame of what is displayed."""

    allowance: float  # energy that the hand may get beyond what it gave [J]
    refill: float  # power with which the allowance returns [W]
    damping: float  # that every hand has at least [N s/m]
    rise: float  # of the force that the hand has not pressed in itself [N/s]


@dataclass(frozen=True)
class SchemeParameters:
    """Parameters of both ends of a scheme."""

    tick_period: float  # of both sides [s]
    coupling: float  # stiffness of the robot towards its command [N/m]
    account: AccountParameters  # of the force on the hand
    delay: float = 0.0  # what look-ahead and play-out of both directions add to the round trip [s]
    longest: float = 1.0  # longest round trip, with that delay [s]
