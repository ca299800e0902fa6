"""The interface of a control scheme: one class for each end of the link."""

from dataclasses import dataclass
from typing import NamedTuple, Protocol, runtime_checkable

from weberlink.geometry.vector import Vector

CREDIT_STEP = 1e-4
"""Energy of one unit of credit [J]. Energy handed over is rounded down to it, so rounding never creates energy."""

LEAST_CONTACT = 0.05
"""Smallest force that counts as contact [N]; less is sensor noise or a remainder within a deadband."""


class LinkQuality(NamedTuple):
    """The measured state of the link.

    Args:
        rtt: round-trip time [s]; None while unknown.
        jitter: delay above the smallest one that only few datagrams exceed [s].
    """

    rtt: float | None
    jitter: float


class WallModel(Protocol):
    """A received model of a contact: an elastic wall at rest, without friction."""

    @property
    def stiffness(self) -> float:
        """Stiffness s [N/m]; at a force f the wall stores f^2 / (2 s) [J]."""
        ...

    def at(self, tick: float, position: Vector) -> Vector:
        """The force of the wall [N] at a position [m]; the tick is not read."""
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
class Imposable(Protocol):
    """A scheme that chooses among others and can be held to one."""

    def impose(self, scheme: str | None) -> None:
        """Use the scheme of this name from now on, at any delay; None to choose by delay again."""
        ...


class MasterControl(Control, Protocol):
    """The operator's end of a scheme.

    Calls in a tick: `learn` for each update, `observe`, `command`, `render`, `displayed`.
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
            position: commanded position of that sample [m].
        """
        ...

    def observe(self, position: Vector, elapsed: float, tick: float, peer_credit: int, quality: LinkQuality) -> None:
        """Book the work of the last tick.

        Args:
            position: position of the device [m].
            elapsed: time since the last call [s].
            tick: the present time on the tick clock of the other side, at which its models are evaluated.
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
    """

    tick_period: float
    force_range: float
    level: float
    damping: float
    catch_up_speed: float
    coupling: float
