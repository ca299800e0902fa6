"""What is sensed of an arm, as an outgoing channel: its joints, or its gripper."""

from collections.abc import Callable
from math import inf
from typing import Literal

from weberlink.arms.contract import ArmReading, ArmSpec
from weberlink.geometry.joints import Joints, is_finite
from weberlink.geometry.vector import ZERO, Vector


class AxesSensor:
    """The angles or torques of the axes `first` to before `last` of an arm with `axes`, gripper included, as a channel.

    `value` is the newest usable measurement [rad | N m], of which `shown` gives what may be sent, None for all. Its
    port sets `most`, the largest share of each deadband that may stay unsent.
    """

    def __init__(self, quantity: Literal["angles", "torques"], first: int, last: int, axes: int) -> None:
        self._takes_angles = quantity == "angles"
        self._first, self._last, self._axes = first, last, axes
        self.value: Joints = (0.0,) * (last - first)
        self.shown: Callable[[Joints], Joints] | None = None
        self.most = inf

    def complaint(self, reading: ArmReading) -> str | None:
        """Why a reading cannot be used: of all axes, since neither end acts on some without the others."""
        for name, values in (("angles", reading.angles), ("torques", reading.torques)):
            if len(values) != self._axes:
                return f"reports {len(values)} {name} for {self._axes} axes"
            if not is_finite(values):
                return f"reports the {name} {values}"
        return None

    def take(self, reading: ArmReading) -> None:
        self.value = self.part(reading.angles if self._takes_angles else reading.torques)

    def part(self, values: Joints) -> Joints:
        """The entries of its axes, of a vector of all axes."""
        return values[self._first : self._last]

    def sample(self) -> tuple[Joints, Vector, float]:
        return self.value if self.shown is None else self.shown(self.value), ZERO, self.most


def sensors_of(spec: ArmSpec, quantity: Literal["angles", "torques"]) -> list[AxesSensor]:
    """The sensor of the joints and, where there is one, that of the gripper."""
    joints, axes = len(spec.joints), spec.axes
    made = [AxesSensor(quantity, 0, joints, axes)]
    return [*made, AxesSensor(quantity, joints, axes, axes)] if spec.gripper else made
