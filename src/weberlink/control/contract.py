"""The interface of a control scheme: one class for each end of the link."""

from dataclasses import dataclass
from typing import Protocol

from weberlink.geometry.joints import Joints
from weberlink.geometry.vector import Vector

CREDIT_STEP = 1e-4
"""Energy of one unit of credit [J]. Energy handed over is rounded down to it, so rounding never creates energy."""

LEAST_CONTACT = 0.05
"""Smallest force that counts as contact [N]; less is sensor noise or a remainder within a deadband."""

UNREACHED_S = 0.03
"""Time for which a robot that follows may lag behind a contact that the operator feels already [s]."""

FREE_FORCE = 1.0
"""Largest force on the hand that may last without a contact [N]."""


class LinkQuality(Protocol):
    """The measured state of the link now, for a scheme to read in the call that it is given to; an endpoint is one."""

    @property
    def rtt(self) -> float | None:
        """Round-trip time [s]; None while unknown."""

    @property
    def jitter(self) -> float:
        """Delay above the smallest one that only few datagrams exceed [s]."""


class WallModel(Protocol):
    """A received model of a contact: an elastic surface."""

    @property
    def stiffness(self) -> float:
        """Stiffness s [N/m]."""
        ...

    def at(self, tick: float, position: Vector) -> Vector:
        """The force without friction [N], at a tick of the other side and a position [m]."""
        ...


class Control(Protocol):
    """The part of the interface that both ends share."""

    @property
    def energy(self) -> float:
        """What this end may still give [J]; negative for a debt, 0 where it keeps no account."""
        ...

    @property
    def credit(self) -> int:
        """Energy that this end tells the other one of since the session began, in units of `CREDIT_STEP`; never
        decreases."""
        ...

    def reset(self) -> None:
        """Begin a new session."""
        ...

    def resume(self, peer_credit: int) -> None:
        """Continue after an interruption of the session: drop force, motion, model and energy from before.

        A debt and `credit` are kept.

        Args:
            peer_credit: credit of the other side so far, in units of `CREDIT_STEP`; all of it is given up.
        """
        ...


class MasterControl(Control, Protocol):
    """The operator's end of a scheme.

    Calls in a tick: `learn` for each update, `observe`, `command`, `render`, `displayed`; and `refute` if that lasts
    without a contact.
    """

    @property
    def stiffness(self) -> float:
        """Stiffness of the contact by the newest model, or that of the robot's coupling if there is none [N/m]."""
        ...

    def learn(self, surface: WallModel | None, force: Vector, position: Vector) -> None:
        """Take in an update.

        Args:
            surface: the contact model that it carries; None if it carries none.
            force: force of its newest sample [N].
            position: commanded position of that sample [m]; NaN if neither its predictor nor, by its entry in
                `weberlink.control.table`, the scheme reads it.
        """
        ...

    def refute(self) -> None:
        """Let go of what is displayed by a model: it lasts, and the robot's end states no contact. A complete update
        was asked for."""
        ...

    def observe(self, position: Vector, elapsed: float, tick: float, peer_credit: int, quality: LinkQuality) -> None:
        """Book the work of the last tick.

        Args:
            position: position of the device [m].
            elapsed: time since the last call [s].
            tick: the tick of the other side from which an update can have arrived by now.
            peer_credit: credit of the other side so far, in units of `CREDIT_STEP`.
            quality: state of the link.
        """
        ...

    def command(self, position: Vector) -> Vector:
        """The position [m] to send to the robot for this position of the device [m]."""
        ...

    def render(self, force: Vector) -> Vector:
        """The force to display [N], given the decoded one [N]."""
        ...

    def displayed(self, force: Vector) -> None:
        """Take in the commanded force of the device [N], which is held until the next tick."""
        ...


class SlaveControl(Control, Protocol):
    """The teleoperator's end of a scheme. Calls in a tick: `follow`, then `observe` once the robot was read."""

    def follow(self, target: Vector, here: Vector, elapsed: float, peer_credit: int, quality: LinkQuality) -> Vector:
        """The position to command [m].

        Args:
            target: decoded position of the operator [m].
            here: last commanded position [m].
            elapsed: time since the last call [s].
            peer_credit: credit of the other side so far, in units of `CREDIT_STEP`.
            quality: state of the link.
        """
        ...

    def observe(self, position: Vector, force: Vector) -> None:
        """Book the work of this tick.

        Args:
            position: commanded position [m].
            force: force of the environment on the robot [N].
        """
        ...


class AxesMaster(Control, Protocol):
    """The operator's end of a scheme for axes that turn: the joints of an arm, or the three of a handle.

    Calls in a tick: `observe`, `render`, `displayed`.
    """

    def observe(self, position: Joints, elapsed: float) -> None:
        """Book the work of the last tick.

        Args:
            position: angles of all axes [rad]; only their changes count.
            elapsed: time since the last call [s].
        """
        ...

    def render(self, torque: Joints) -> Joints:
        """The torques to display [N m], given the decoded ones [N m]."""
        ...

    def displayed(self, torque: Joints) -> None:
        """Take in the commanded torques [N m], which are held until the next tick."""
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
