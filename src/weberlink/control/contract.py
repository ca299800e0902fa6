"""The interface of a control scheme: one class for each end of the link."""

from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

from weberlink.geometry.joints import Joints
from weberlink.geometry.vector import Vector

CREDIT_STEP = 1e-4
"""Energy of one unit of credit [J]. Energy handed over is rounded down to it, so rounding never creates energy."""

LEAST_CONTACT = 0.05
"""Smallest force that counts as contact [N]; less is sensor noise or a remainder within a deadband."""

UNREACHED_S = 0.03
"""Time for which a robot that follows may lag behind a contact that the operator feels already [s]."""

FREE_FORCE = 1.0
"""Largest force on the hand that may last without a contact [N]: the drag of a scheme is no larger."""


class LinkQuality(Protocol):
    """The measured state of the link now, for a scheme to read in the call that it is given to; an endpoint is one."""

    @property
    def rtt(self) -> float | None:
        """Round-trip time [s]; None while unknown."""

    @property
    def jitter(self) -> float:
        """Delay above the smallest one that only few datagrams exceed [s]."""


class WallModel(Protocol):
    """A received model of a contact: an elastic surface that may have friction and may move."""

    @property
    def stiffness(self) -> float:
        """Stiffness s [N/m]; at a force f the surface stores f^2 / (2 s) [J]."""
        ...

    @property
    def memory(self) -> Any:
        """The god-object of friction at the newest sample, for `advance`; None without friction."""
        ...

    def at(self, tick: float, position: Vector) -> Vector:
        """The force without friction [N], at a tick of the other side and a position [m]."""
        ...

    def advance(self, tick: float, position: Vector, memory: Any) -> tuple[Vector, Any]:
        """The force with friction [N], and the new memory. Not called if `memory` is None."""
        ...

    def displacement(self, tick: float) -> Vector:
        """How far the surface has moved since its newest sample [m]."""
        ...


class Control(Protocol):
    """The part of the interface that both ends share."""

    @property
    def active(self) -> str:
        """Name of the active scheme, a key of `weberlink.control.table.SCHEMES`."""
        ...

    @property
    def tank(self) -> float:
        """Energy that this side may still spend [J]; negative for a debt."""
        ...

    @property
    def credit(self) -> int:
        """Energy handed to the other side since the session began, in units of `CREDIT_STEP`; never decreases."""
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


@runtime_checkable
class Switchable(Protocol):
    """A scheme that consists of others, of which both ends use the same one."""

    def use(self, scheme: str) -> None:
        """Use the scheme of this name from now on."""
        ...


@runtime_checkable
class Choosing(Switchable, Protocol):
    """The operator's end of such a scheme, which chooses for both."""

    @property
    def wanted(self) -> str | None:
        """Name of the scheme that both ends should change to; None for no change."""
        ...

    def fall_back(self) -> None:
        """Call for the scheme that is safe at any delay: the link fell silent."""
        ...


class MasterControl(Control, Protocol):
    """The operator's end of a scheme.

    Calls in a tick: `learn` for each update, `observe`, `command`, `grip` if the grip changes, `render`, `displayed`,
    `refute` if that lasts without a contact.
    """

    @property
    def stiffness(self) -> float:
        """Stiffness of the contact by the newest model, or that of the robot's coupling if there is none [N/m]."""
        ...

    def grip(self, stored: float, share: float) -> None:
        """Take in that the operator takes the handle or lets it go, maybe within a contact.

        Called before `render` from a release on until the next grip is settled: the force has faded in, and the
        stiffness of a contact is known.

        Args:
            stored: energy that the contact stores at the force of this tick [J].
            share: of that force which is displayed now, 0..1.
        """
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


class JointMaster(Control, Protocol):
    """The leader's end of a scheme for joints; angles and torques of all axes.

    Calls in a tick: `observe`, `command`, `render`, `displayed`.
    """

    def observe(self, position: Joints, elapsed: float, tick: float, peer_credit: int, quality: LinkQuality) -> None:
        """Book the work of the last tick; as of `MasterControl`, for the angles of the leader [rad]."""
        ...

    def command(self, position: Joints) -> Joints:
        """The angles to send [rad] for these angles of the leader [rad]."""
        ...

    def render(self, torque: Joints) -> Joints:
        """The torques to display [N m], given the decoded ones [N m]."""
        ...

    def displayed(self, torque: Joints) -> None:
        """Take in the commanded torques of the leader [N m], which are held until the next tick."""
        ...


class JointSlave(Control, Protocol):
    """The follower's end of a scheme for joints. Calls in a tick: `follow`, then `observe` once the arm was read."""

    def follow(self, target: Joints, here: Joints, elapsed: float, peer_credit: int, quality: LinkQuality) -> Joints:
        """The angles to command [rad]; as of `SlaveControl`.

        Args:
            target: decoded angles of the leader [rad].
            here: last commanded angles [rad].
            elapsed: time since the last call [s].
            peer_credit: credit of the other side so far, in units of `CREDIT_STEP`.
            quality: state of the link.
        """
        ...

    def observe(self, position: Joints, torque: Joints) -> None:
        """Book the work of this tick: commanded angles [rad], torques of the environment on the follower [N m]."""
        ...


@dataclass(frozen=True)
class SchemeParameters:
    """Parameters of both ends of a scheme.

    Args:
        tick_period: tick period of both sides [s].
        force_range: largest force that the robot reports [N].
        level: energy at which a tank counts as full [J].
        damping: damping of the drag that fills an empty tank [N s/m]; less the fuller the tank is.
        catch_up_speed: speed at which the robot reduces its distance to the operator, added to the operator's own
            motion [m/s].
        coupling: stiffness of the robot towards its command [N/m].
        free_force: largest force without a contact [N]; that of a drag, too.
    """

    tick_period: float
    force_range: float
    level: float
    damping: float
    catch_up_speed: float
    coupling: float
    free_force: float = FREE_FORCE
