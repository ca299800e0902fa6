"""The emulated gamepad: events of the kernel's input layer for what has changed, and its state for those who ask.

umockdev does not know the requests of force feedback, so it has none. The values that a program may ask for stay those
of rest.
"""

from typing import ClassVar

from weberlink_devices.gamepad.device import KEYS
from weberlink_devices.gamepad.identity import EV_ABS, EV_KEY, EV_SYN, AxisRange, InputIdentity, event
from weberlink_devices.thumb import DeflectionEmulator, ThumbOptions

VENDOR, PRODUCT = 0x045E, 0x028E
STICK = AxisRange(-32768, 32767)
TRIGGER = AxisRange(0, 255)
ABS_X, ABS_Y, ABS_Z, ABS_RX, ABS_RY, ABS_RZ = range(6)
PERIOD_S = 0.008


class GamepadEmulator(DeflectionEmulator):
    """See `weberlink.hardware.emulator`. The left stick moves in the plane, the right one up and down."""

    Options = ThumbOptions
    transport: ClassVar[str] = "evdev"

    def __init__(self, options: ThumbOptions) -> None:
        super().__init__(options, len(KEYS))
        sticks = dict.fromkeys((ABS_X, ABS_Y, ABS_RX, ABS_RY), STICK)
        axes = {**sticks, ABS_Z: TRIGGER, ABS_RZ: TRIGGER}
        self.identity = InputIdentity(VENDOR, PRODUCT, "Emulated Gamepad", KEYS, axes, options.serial_number)
        self._due = 0.0
        self._said: dict[tuple[int, int], int] = {}

    def receive(self, data: bytes, now: float) -> None:  # noqa: ARG002 - nothing that it would have to obey
        self.messages += 1

    def replies(self, now: float) -> list[bytes]:
        if now < self._due:
            return []
        self._due = now + PERIOD_S
        state = self._state()
        changed = [(key, value) for key, value in state.items() if self._said.get(key, 0) != value]
        self._said = state
        if not changed:
            return []
        self.sent += 1
        events = [event(kind, code, value, now) for (kind, code), value in changed]
        return [b"".join((*events, event(EV_SYN, 0, 0, now)))]

    def next_timer(self) -> float | None:
        return self._due

    def _state(self) -> dict[tuple[int, int], int]:
        x, y, z = (round(STICK.most * share) for share in self.deflection)
        keys = {(EV_KEY, code): self.buttons >> bit & 1 for bit, code in enumerate(KEYS)}
        return {(EV_ABS, ABS_Y): x, (EV_ABS, ABS_X): y, (EV_ABS, ABS_RY): -z, **keys}
