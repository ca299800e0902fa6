"""The latest samples of a signal at the sender's full rate."""

from weberlink.geometry.vector import Vector

KEPT = 128
"""At least so many samples are there once so many came."""


class History:
    """The newest sample is the last of each list.

    Attributes:
        values: as measured, within the range of the wire [N or m].
        places: position of each [m].
    """

    __slots__ = ("_tick", "places", "values")

    def __init__(self) -> None:
        self.values: list[Vector] = []
        self.places: list[Vector] = []
        self._tick = 0

    def __len__(self) -> int:
        return len(self.values)

    def add(self, tick: int, value: Vector, place: Vector) -> bool:
        """Note the sample of a tick; returns whether it goes on where the one before ended.

        A gap ends the record: an estimate takes the samples to be a tick apart.
        """
        follows = tick == self._tick + 1 and bool(self.values)
        if not follows:
            self.values, self.places = [], []
        elif len(self.values) >= 2 * KEPT:
            del self.values[:KEPT], self.places[:KEPT]
        self._tick = tick
        self.values.append(value)
        self.places.append(place)
        return follows
