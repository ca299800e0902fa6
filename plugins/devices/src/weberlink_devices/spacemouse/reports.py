"""HID reports of 3Dconnexion's six-axis devices: numbered, little-endian, each of them sent while it has news.

Report 1 has the translation, in newer devices followed by the rotation; else report 2 has the rotation. Report 3 has
the buttons, a bit each. An output report 4 switches the light. Sources: docs/devices/spacemouse.md.
"""

from struct import Struct
from typing import NamedTuple

TRANSLATION, ROTATION, BUTTONS, LIGHT = 1, 2, 3, 4
"""Numbers of the reports."""
FULL_COUNTS = 350
"""Count of a full deflection, as published for all models."""
MOST_BUTTONS = 32

_THREE, _SIX = Struct("<3h"), Struct("<6h")
Counts = tuple[int, int, int]


class PuckState(NamedTuple):
    """State of the puck and the buttons. Counts are along and about: right, toward the operator, down."""

    translation: Counts = (0, 0, 0)
    rotation: Counts = (0, 0, 0)
    buttons: int = 0

    def updated(self, report: bytes) -> "PuckState":
        """The state after a report, its number in front; unknown reports (such as the battery) change nothing."""
        number, content = report[0], report[1:]
        if number == TRANSLATION and len(content) >= _SIX.size:
            x, y, z, a, b, c = _SIX.unpack_from(content)
            return self._replace(translation=(x, y, z), rotation=(a, b, c))
        if number == TRANSLATION and len(content) >= _THREE.size:
            return self._replace(translation=_THREE.unpack_from(content))
        if number == ROTATION and len(content) >= _THREE.size:
            return self._replace(rotation=_THREE.unpack_from(content))
        if number == BUTTONS:
            return self._replace(buttons=int.from_bytes(content[: MOST_BUTTONS // 8], "little"))
        return self

    def reports(self, *, joint: bool, button_bytes: int) -> tuple[bytes, ...]:
        """The reports that say this state; translation and rotation in one if `joint`."""
        a, b, c = self.rotation
        buttons = bytes([BUTTONS]) + self.buttons.to_bytes(button_bytes, "little")
        if joint:
            return bytes([TRANSLATION]) + _SIX.pack(*self.translation, a, b, c), buttons
        translation = bytes([TRANSLATION]) + _THREE.pack(*self.translation)
        return translation, bytes([ROTATION]) + _THREE.pack(a, b, c), buttons
