"""The model of no model: the newest sample, until the next one. What cannot be fitted is held."""

from typing import NamedTuple

from weberlink.geometry.vector import Vector


class Hold(NamedTuple):
    value: Vector

    def at(self, tick: float, position: Vector) -> Vector:  # noqa: ARG002
        return self.value

    def wall(self) -> None:
        return None
