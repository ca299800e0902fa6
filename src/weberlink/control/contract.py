"""The interface of a control scheme: what it offers to each end of the link."""

from dataclasses import dataclass
from typing import NamedTuple, Protocol, runtime_checkable

from weberlink.geometry.vector import Vector

CREDIT_STEP = 1e-4
"""Energy of one unit of credit [J]. What is handed over is rounded down to it, so rounding never makes energy."""

LEAST_CONTACT = 0.05
"""Force from which on something counts as touched [N]: less is the noise of a sensor, or left over by a deadband."""


class LinkQuality(NamedTuple):
    """The link as it is measured now.

    Args:
        rtt: round trip [s]; None while unknown.
        jitter: by how much few datagrams exceed the least delay [s].
    """

    rtt: float | None
    jitter: float


class WallModel(Protocol):
    """A received model of a contact: an elastic wall at rest, without friction."""

    @property
    def stiffness(self) -> float:
        """Of the wall [N/m]; it stores half the square of its force divided by this [J]."""
        ...

    def at(self, tick: float, position: Vector) -> Vector:
        """The force of the wall [N] at a position [m]; the tick is not read."""
        ...


class Control(Protocol):
    """What both ends of a scheme have in common."""

    @property
    def active(self) -> str:
        """Name of the scheme at work in `weberlink.control.table.SCHEMES`."""
        ...

    @property
    def tank(self) -> float:
        """Energy that this side may still spend [J]."""
        ...

    @property
    def credit(self) -> int:
        """Energy handed to the other side since the session began, in units of `CREDIT_STEP`; never decreases."""
        ...

    def reset(self) -> None:
        """Begin a new session."""
        ...

    def resume(self, peer_credit: int) -> None:
        """Go on after an interruption of the session: drop force, motion, model and energy from before.

        A debt stays, and so does `credit`, which never decreases.

        Args:
            peer_credit: handed over by the other side so far, in units of `CREDIT_STEP`; all of it is given up.
        """
        ...


@runtime_checkable
class Imposable(Protocol):
    """A scheme that chooses among others and can be held to one."""

    def impose(self, scheme: str | None) -> None:
        """Hold the scheme of this name from now on, whatever the delay; None to choose again."""
        ...


class MasterControl(Control, Protocol):
    """The operator's end of a scheme. In a tick: `learn` for each update, `observe`, `render`, then `displayed`."""

    def learn(self, surface: WallModel | None, force: Vector, position: Vector) -> None:
        """Take what an update says.

        Args:
            surface: the model that it carries, where it is one of a contact.
            force: of the newest sample [N].
            position: that the force belongs to [m].
        """
        ...

    def observe(self, position: Vector, elapsed: float, peer_credit: int, quality: LinkQuality) -> None:
        """Book the work of the tick that has passed.

        Args:
            position: of the device [m].
            elapsed: since the last call [s].
            peer_credit: handed over by the other side so far, in units of `CREDIT_STEP`.
            quality: of the link.
        """
        ...

    def render(self, force: Vector) -> Vector:
        """The force to display [N], from the decoded one."""
        ...

    def displayed(self, force: Vector) -> None:
        """Take the force that the device was commanded [N], which is held until the next tick."""
        ...


class SlaveControl(Control, Protocol):
    """The teleoperator's end of a scheme. In a tick: `follow`, then `observe` once the robot has been read."""

    def follow(self, target: Vector, here: Vector, elapsed: float, peer_credit: int, quality: LinkQuality) -> Vector:
        """The position to command [m].

        Args:
            target: decoded position of the operator [m].
            here: last commanded position [m].
            elapsed: since the last call [s].
            peer_credit: handed over by the other side so far, in units of `CREDIT_STEP`.
            quality: of the link.
        """
        ...

    def observe(self, position: Vector, force: Vector) -> None:
        """Book the work of this tick.

        Args:
            position: as commanded [m].
            force: of the environment on the robot [N].
        """
        ...


@dataclass(frozen=True)
class SchemeParameters:
    """Parameters of both ends of a scheme.

    Args:
        tick_period: of both sides [s].
        force_range: largest force that the robot reports [N].
        level: energy that each tank is kept at [J].
        damping: most of the drag that fills an empty tank [N s/m].
        catch_up_speed: how fast the robot makes up for a distance to the operator, on top of the operator's own
            motion [m/s].
    """

    tick_period: float
    force_range: float
    level: float
    damping: float
    catch_up_speed: float
