"""One end of the link as the side loop sees it: how it senses and actuates."""

from collections.abc import Callable, Sequence
from typing import Any, ClassVar

from weberlink.compiled import mypyc_attr
from weberlink.control.contract import Control
from weberlink.geometry.joints import Joints


@mypyc_attr(allow_interpreted_subclasses=True)
class Port:
    """One end of the link: a haptic device or an arm under an operator's hand, or a robot.

    The side loop calls `open` once, then the methods of each tick, and `close` at the end. Only `open` and `close` may
    block. In a tick the operator's end senses and sends, then actuates; it leaves a session after its force has faded.
    The other end actuates, then senses and sends; it leaves at once.

    Args:
        source: the device, robot or arm, not yet open.
        controls: this end of the control scheme: of the force and, with six degrees of freedom, of the torque.
        fault: what `open` and `latest` raise if the device or robot cannot continue.
    """

    kind: ClassVar[str] = "robot"  # or "device", for messages
    leads: ClassVar[bool] = False  # whether this is the operator's end

    def __init__(self, source: Any, controls: Sequence[Control], fault: type[Exception]) -> None:
        self._source, self.fault = source, fault
        # Gives the newest reading at a time; its attribute `at` is that of the measurement [s]. Raises `fault`.
        self.latest: Callable[[float], Any] = source.latest
        self.name: str = source.spec.name
        self.controls = controls
        self.enabled = True  # whether the operator enables motion with the button of `master.engage`
        self.angle_range: tuple[Joints, Joints] | None = None  # of an arm [rad]
        self.unfounded = False  # whether a force is asked for that no contact was stated for: it is faded out

    @property
    def tripped(self) -> bool:
        """Whether a contact force above its limit stops the robot from following."""
        return False

    @property
    def trouble(self) -> str | None:
        """Why there is no new reading; None if the driver knows no reason."""
        return getattr(self._source, "trouble", None)

    @property
    def at_rest(self) -> bool:
        """Whether the session can be left without a jump of force or motion."""
        return True

    def open(self, now: float) -> None:
        self._source.open(now)

    def close(self) -> None:
        self._source.close()

    def accept(self, reading: Any) -> bool:
        """Keep the rest of a new reading that has no complaint; returns whether its contact force exceeds the limit."""
        raise NotImplementedError

    def settle(self, now: float) -> None:
        """Handle a stall of this process, now or a few ticks ago: hand and robot may have moved meanwhile."""

    def reset(self) -> None:
        """Forget all that was received: a new session began, or the peer returned."""
        raise NotImplementedError

    def restart(self) -> None:
        """Fade in from zero: sending or displaying begins again, or the device is lost."""

    def release(self, *, retreat: bool) -> None:
        """Stop following the peer: hold, or retreat from a contact if configured."""

    def account(self, elapsed: float, tick: float, *, encodes: bool) -> int:
        """Book the work of a tick of `elapsed` [s], at a `tick` of the peer, in which the channels are encoded or not;
        returns the energy credit to send to the peer."""
        raise NotImplementedError

    def actuate(self, values: Sequence[Any], now: float, elapsed: float, step: float, *, engaged: bool) -> None:
        """Command the device or robot, through the gate of this end.

        Args:
            values: one per incoming channel, a vector or the joints of an arm; None if nothing was decoded.
            now: [s].
            elapsed: time since the last tick [s]; 0 after a stall.
            step: the same, bounded: the time by which ramps and speed limits advance [s].
            engaged: whether the values may be acted on.
        """
        raise NotImplementedError

    def report(self, row: Any, *, is_led: bool) -> None:
        """Fill in what a `weberlink.telemetry.row.Row` has of this end alone. `is_led`: False while a session lives and
        nothing but a button that is not held keeps the operator from leading."""
        raise NotImplementedError

    def halt(self, now: float) -> None:
        """Command zero force, or hold, at once; no tick follows."""
        raise NotImplementedError
