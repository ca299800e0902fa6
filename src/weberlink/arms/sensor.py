"""What is sensed of an arm, as an outgoing channel: its joints, or its gripper."""

from collections.abc import Callable, Sequence
from math import inf
from operator import attrgetter
from typing import Any, Literal

from weberlink.arms.contract import ArmReading, ArmSpec
from weberlink.codec import Channel, Encoder
from weberlink.codec.outgoing import OutgoingChannel
from weberlink.geometry.joints import Joints, is_finite
from weberlink.geometry.vector import ZERO, Vector

Quantity = Literal["angles", "torques"]


class PressedAxes:
    """How much of the deadbands `bounds` [rad] of some angles may stay unsent while the follower presses on something.

    There, an error e of an angle changes the torque by up to K e, with the stiffness K of the follower [N m/rad]. So an
    error stays unsent only if K e is within the deadband of the displayed torque, `torque_bound` of axis and torque [N
    m].
    """

    def __init__(self, bounds: Joints, coupling: Joints, torque_bound: Callable[[int, float], float]) -> None:
        self._scales = [1.0 / (bound * stiffness) for bound, stiffness in zip(bounds, coupling, strict=True)]
        self._torque_bound = torque_bound

    def share(self, torques: Joints) -> float:
        """The largest share of all deadbands, for these torques as displayed [N m]; inf where nothing is pressed."""
        most = inf
        for index, scale in enumerate(self._scales):
            torque = abs(torques[index])
            bound = self._torque_bound(index, torque)
            if torque > bound:
                most = min(most, bound * scale)
        return most


class AxesSensor(OutgoingChannel):
    """The angles or torques of the axes `first` to before `last` of an arm with `axes`, gripper included, as a channel.

    `value` is the newest usable measurement [rad | N m], of which `shown` gives what may be sent, None for all.
    `pressed`: of a leader, for a follower whose stiffness is known; `felt` is then the display of the torques.
    """

    def __init__(self, encoder: Encoder, quantity: Quantity, first: int, last: int, axes: int) -> None:
        super().__init__(encoder, (0.0,) * (last - first))
        self._takes_angles = quantity == "angles"
        self._first, self._last, self._axes = first, last, axes
        self.place = attrgetter("angles", "torques")
        self.shown: Callable[[Joints], Joints] | None = None
        self.pressed: PressedAxes | None = None
        self.felt: Any = None

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

    @property
    def way(self) -> Joints:
        way: Joints = self.value
        return way

    def held(self, reading: ArmReading, guard: Any) -> Joints:
        held: Joints = guard.near(reading.angles)
        return held

    def sample(self, tick: int) -> tuple[Vector, float]:  # noqa: ARG002
        self.sampled = self.value if self.shown is None else self.shown(self.value)
        return ZERO, inf if self.pressed is None else self.pressed.share(self.part(self.felt.decoded))


def sensors_of(spec: ArmSpec, quantity: Quantity, channels: Sequence[Channel]) -> list[AxesSensor]:
    """The sensor of the joints and, where there is one, that of the gripper."""
    joints, axes = len(spec.joints), spec.axes
    spans = [(0, joints), (joints, axes)] if spec.gripper else [(0, joints)]
    return [
        AxesSensor(Encoder(channel), quantity, first, last, axes)
        for channel, (first, last) in zip(channels, spans, strict=True)
    ]
