"""The emulated SpaceMouse: numbered reports while the puck is deflected, one with zeros as it is let go, then nothing.

Assumed, not published: it repeats a deflection that does not change, as the pace of published recordings suggests.
"""

from typing import ClassVar, Literal

from pydantic import Field

from weberlink.geometry.vector import ZERO, Vector
from weberlink_devices.spacemouse.reports import FULL_COUNTS, PuckState
from weberlink_devices.thumb import DeflectionEmulator, ThumbOptions
from weberlink_devices.umockdev import HidIdentity

Product = Literal["spacenavigator", "compact", "wireless"]
PRODUCTS: dict[Product, tuple[int, int, str, bool]] = {
    "spacenavigator": (0x046D, 0xC626, "SpaceNavigator", False),
    "compact": (0x256F, 0xC635, "SpaceMouse Compact", False),
    "wireless": (0x256F, 0xC62E, "SpaceMouse Wireless", True),
}
"""USB identity, name, and whether one report has all six axes."""
BUTTONS = 2
LIGHT_BYTES = 1


class SpaceMouseEmulatorOptions(ThumbOptions):
    """Options of the emulated `spacemouse`."""

    product: Product = Field(default="spacenavigator", description="which of the family")
    report_s: float = Field(default=0.008, ge=0.001, le=1.0, description="pause between two reports of a deflection")
    turn: Vector = Field(default=ZERO, description="deflection of the turning, in shares of the full one")


class SpaceMouseEmulator(DeflectionEmulator):
    """See `weberlink.hardware.emulator`."""

    Options = SpaceMouseEmulatorOptions
    transport: ClassVar[str] = "hid"

    def __init__(self, options: SpaceMouseEmulatorOptions) -> None:
        super().__init__(options, BUTTONS)
        vendor, product, name, self._joint = PRODUCTS[options.product]
        self.identity = HidIdentity(
            vendor, product, name, descriptor(joint=self._joint), LIGHT_BYTES, options.serial_number, "3Dconnexion"
        )
        self.light = False
        self._period = options.report_s
        self._turn = options.turn
        self._due = 0.0
        self._said = PuckState()

    def receive(self, data: bytes, now: float) -> None:  # noqa: ARG002
        """The light; the number of the report is not part of `data`."""
        self.messages += 1
        self.light = data == b"\x01"

    def replies(self, now: float) -> list[bytes]:
        if now < self._due:
            return []
        self._due = now + self._period
        state = self._state()
        reports = state.reports(joint=self._joint, button_bytes=1)
        motion, buttons = reports[:-1], reports[-1]
        deflected = any((*state.translation, *state.rotation))
        was_deflected = any((*self._said.translation, *self._said.rotation))
        leaving = list(motion) if deflected or was_deflected else []
        if state.buttons != self._said.buttons:
            leaving.append(buttons)
        self._said = state
        self.sent += len(leaving)
        return leaving

    def next_timer(self) -> float | None:
        return self._due

    def _state(self) -> PuckState:
        return PuckState(counts(self.deflection), counts(self._turn), self.buttons)


def counts(deflection: Vector) -> tuple[int, int, int]:
    """Counts (right, toward the operator, down) of shares (toward the operator, right, up)."""
    x, y, z = deflection
    return round(FULL_COUNTS * y), round(FULL_COUNTS * x), round(-FULL_COUNTS * z)


def descriptor(*, joint: bool) -> bytes:
    """Report descriptor: a multi-axis controller with translation, rotation, two buttons and a light."""
    begin = bytes.fromhex("0501 0908 a101")
    axes = "16a2fe 265e01 7510"  # -350 to 350, 16 bits
    first, second = "0930 0931 0932", "0933 0934 0935"
    if joint:
        motion = bytes.fromhex(f"a100 8501 {axes} 9506 {first} {second} 8102 c0")
    else:
        motion = bytes.fromhex(f"a100 8501 {axes} 9503 {first} 8102 c0 a100 8502 {axes} 9503 {second} 8102 c0")
    buttons = bytes.fromhex("a102 8503 0509 1901 2902 1500 2501 7501 9502 8102 9506 8103 c0")
    light = bytes.fromhex("a102 8504 0508 094b 1500 2501 7501 9501 9102 9507 9103 c0")
    return begin + motion + buttons + light + b"\xc0"
