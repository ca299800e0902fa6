"""Whether a handle went where the hand moved it; pure."""

from collections.abc import Mapping
from dataclasses import dataclass

from weberlink.geometry.vector import Vector, norm

Frame = Mapping[str, str]
"""Where the positive direction of each axis leads whoever sits before the device, for example "to the right"."""

FRAME: Frame = {"x": "toward you", "y": "to the right", "z": "up"}
"""Of a device whose driver does not say otherwise."""

LEAST_M = 0.015
"""A shorter way says nothing: a hand that holds still moves by millimetres."""
MAINLY = 0.8
"""Share of the way that one axis must have: within 37 degrees of it."""


@dataclass(frozen=True)
class Sense:
    """What came of a motion along an axis.

    Args:
        asked: the axis along whose positive direction the hand moved.
        axis: along which the position moved.
        way_m: with its sign [m].
    """

    asked: str
    axis: str
    way_m: float

    @property
    def right(self) -> bool:
        return self.axis == self.asked and self.way_m > 0.0

    def in_words(self, frame: Frame) -> str:
        """In one line."""
        what = "right" if self.right else "WRONG AXIS" if self.axis != self.asked else "WRONG DIRECTION"
        return f"  +{self.asked} ({frame[self.asked]}): {self.way_m * 1e3:+.0f} mm along {self.axis}: {what}"


def sense(asked: str, moved: Vector, frame: Frame) -> Sense | str:
    """What a motion says, or why it says nothing.

    Args:
        asked: "x", "y" or "z".
        moved: how the position changed [m].
        frame: for the words.
    """
    way = norm(moved)
    if way < LEAST_M:
        return f"The position changed by {way * 1e3:.0f} mm, which is too little: move it by about 5 cm."
    axis, along = max(zip("xyz", moved, strict=True), key=lambda pair: abs(pair[1]))
    if abs(along) < MAINLY * way:
        x, y, z = (f"{component * 1e3:+.0f}" for component in moved)
        return f"The position changed by ({x}, {y}, {z}) mm, along no one axis: move it straight {frame[asked]}."
    return Sense(asked, axis, along)
