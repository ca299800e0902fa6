"""The interface between the side loop and a port: how one end of the link senses and actuates."""

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

from weberlink.control.contract import Control
from weberlink.geometry.vector import Vector


class Sensor(Protocol):
    """Reads one outgoing channel off a reading of the device or the robot."""

    value: Vector
    """The newest usable measurement."""

    def complaint(self, reading: Any) -> str | None:
        """Why a reading cannot be used; None if it can."""

    def take(self, reading: Any) -> None:
        """Keep a reading without complaint."""

    def sample(self) -> tuple[Vector, Vector]:
        """What is encoded now: the value, and the position that it belongs to (zero on a forward channel)."""


class Port(Protocol):
    """One end of the link: a haptic device under an operator's hand, or a robot.

    The side loop calls `open` once, then in each tick what its order asks for, and `close` at the end. No method
    between them blocks.
    """

    @property
    def kind(self) -> str:
        """ "device" or "robot", for messages."""

    @property
    def name(self) -> str:
        """Of the device or robot, for messages."""

    @property
    def leads(self) -> bool:
        """Whether this is the operator's end.

        It senses and sends before it actuates, and its force fades before it leaves a session. The other end actuates
        first, and leaves at once.
        """

    @property
    def fault(self) -> type[Exception]:
        """What `latest` raises when the device or robot cannot go on."""

    @property
    def control(self) -> Control:
        """This end of the control scheme."""

    @property
    def columns(self) -> Mapping[str, str]:
        """Expressions for the telemetry of this end; see `weberlink.telemetry.record.compile_row`."""

    @property
    def trouble(self) -> str | None:
        """Why no new reading comes, if the driver knows."""

    @property
    def enabled(self) -> bool:
        """Whether the operator lets this end lead, by the button of `master.engage`."""

    @property
    def ended(self) -> bool:
        """Whether a script or a recording is over."""

    @property
    def tripped(self) -> bool:
        """Whether too strong a contact keeps the robot from following."""

    @property
    def at_rest(self) -> bool:
        """Whether the session can be left without a jump."""

    def open(self, now: float) -> None:
        """Open the device or robot.

        Raises:
            RuntimeError: it cannot be opened.
        """

    def close(self) -> None: ...

    def latest(self, now: float) -> Any:
        """The newest reading, measured at its attribute `at`; raises `fault`."""

    def accept(self, reading: Any) -> bool:
        """Keep what the sensors do not, of a new reading without complaint; returns whether its contact force trips."""

    def settle(self, now: float) -> None:
        """This process stalled, or did so a few ticks ago: hand and robot may be elsewhere."""

    def reset(self) -> None:
        """Nothing that was received holds any more: a new session began, or the peer returned."""

    def restart(self) -> None:
        """Fade in from zero: sending or displaying begins again, or the device is lost."""

    def release(self, *, retreat: bool) -> None:
        """The peer no longer leads: hold, or retreat from a contact if configured."""

    def account(self, elapsed: float, *, encodes: bool) -> int:
        """Book the work of this tick [s]; returns the energy credit to tell the peer."""

    def actuate(
        self, values: Sequence[Vector | None], now: float, elapsed: float, step: float, *, engaged: bool
    ) -> None:
        """Command the device or robot.

        Args:
            values: one per incoming channel, None where nothing was decoded.
            now: [s].
            elapsed: since the last tick [s]; 0 after a stall.
            step: the same, bounded: by how much ramps and speed limits may go on [s].
            engaged: whether the values may be acted on.
        """

    def halt(self, now: float) -> None:
        """Zero force, or hold, at once; no tick follows."""
