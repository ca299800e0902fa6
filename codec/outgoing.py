"""A signal that an end senses and encodes: what the sensors of both ends have in common."""

from typing import Any

from weberlink.codec.coder import Encoder
from weberlink.compiled import mypyc_attr
from weberlink.geometry.vector import Vector
from weberlink.update import Update


@mypyc_attr(allow_interpreted_subclasses=True)
class OutgoingChannel:
    """A sensor and the encoder of what it senses. A tick of the side calls `complaint`, `take` for a new reading that
    has none, and `sample`; then it encodes.

    Attributes:
        value: the newest usable measurement: a vector, or the joints of an arm.
        sampled: what was to be encoded in this tick.
        update: that was made in this tick.
    """

    def __init__(self, encoder: Encoder, value: Any) -> None:
        self.encoder = encoder
        self.value = self.sampled = value
        self.update: Update | None = None

    def complaint(self, reading: Any) -> str | None:
        """Why a reading of the device or robot cannot be used; None if it can."""
        raise NotImplementedError

    def take(self, reading: Any) -> None:
        """Keep a reading that has no complaint."""
        raise NotImplementedError

    def sample(self, tick: int) -> tuple[Vector, float]:
        """Keep what is to be encoded in a tick as `sampled`; returns its commanded position [m], zero on a forward
        channel, and the largest error that may stay unsent even if the deadband is wider (inf for no such limit)."""
        raise NotImplementedError
