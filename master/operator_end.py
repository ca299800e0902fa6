"""What the ports of the operator's end share, of a haptic device or of a leader arm: the button and the gate."""

from typing import TYPE_CHECKING, Any, Final

from weberlink.master.devices.contract import Device
from weberlink.master.safety import ForceGate

if TYPE_CHECKING:
    from weberlink.arms.contract import LeaderArm


class OperatorEnd:
    """The part of a `weberlink.session.port.Port` that does not depend on what is displayed.

    Args:
        source: the device or arm, not yet open.
        gate: fades all that is displayed in and out.
        button: only while it is held, the robot follows and force is displayed; None for always.

    Attributes:
        buttons: that are pressed, a bit each.
    """

    kind: Final = "device"
    leads: Final = True
    tripped: Final = False

    def __init__(self, source: "Device | LeaderArm", gate: ForceGate, button: int | None) -> None:
        self._source = source
        self.name: str = source.spec.name
        self.gate = gate
        self.buttons = 0
        self.enabled = button is None
        self.ended = False
        self.unfounded = False
        self.slew_ticks = 0
        """Ticks in which a slew limit held force or torque back."""
        self.clipped = False
        """Whether a limiter changed what was displayed in this tick."""
        self._button = button

    @property
    def trouble(self) -> str | None:
        return getattr(self._source, "trouble", None)

    @property
    def at_rest(self) -> bool:
        return self.gate.gain == 0.0

    def open(self, now: float) -> None:
        self._source.open(now)

    def close(self) -> None:
        self._source.close()

    def latest(self, now: float) -> Any:
        reading = self._source.latest(now)
        self.ended = reading.ended
        return reading

    def accept(self, reading: Any) -> bool:
        self.buttons = buttons = reading.buttons
        if self._button is not None:
            self.enabled = bool(buttons >> self._button & 1)
        return False

    def settle(self, now: float) -> None: ...

    def reset(self) -> None:
        self.gate.close()
        self._forget()

    def restart(self) -> None:
        self.gate.close()
        self._forget()

    def _forget(self) -> None:
        """Drop what was heard of contacts."""
        self.unfounded = False

    def release(self, *, retreat: bool) -> None: ...
