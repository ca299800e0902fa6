"""Which poses of a topic lead the hand, and why the others do not.

Pure: times are arguments. A pose that is refused counts as silence, so a publisher of nothing else has let go.
"""

from math import isfinite
from typing import NamedTuple

from weberlink.geometry.rotation import unit_quaternion, vector
from weberlink.geometry.vector import ZERO, Vector, is_finite, subtract

UNIT_WITHIN = 0.01
"""Largest difference between the length of a quaternion and 1."""
RELAX = 0.1
"""By how much the shortest delay may grow [s/s]: a clock of the publisher that was set back is forgiven so fast."""
MOST_CLOCKS = 16
"""Publishers whose delays are remembered."""
SHOWN_S = 1.0
"""Time for which a refusal is told [s]."""
SECOND_NS = 1_000_000_000


class Subscription(NamedTuple):
    """What to listen to."""

    topic: str  # of geometry_msgs/msg/PoseStamped
    domain: int  # of ROS
    connect: str | None  # endpoint of the Zenoh router; None for that of this host
    frame_id: str | None  # of the poses; None for any
    origin: Vector  # becomes (0, 0, 0) [m], in that frame
    silence: float  # time after which a publisher has let go [s]
    turns: bool  # whether the orientation counts


class Pose(NamedTuple):
    """A received message."""

    stamp_ns: int  # of its header; 0 if the publisher gives none
    frame_id: str
    position: Vector  # [m]
    orientation: tuple[float, float, float, float]  # (w, x, y, z)
    source: bytes  # identity of the publisher
    sent_ns: int  # on the clock of the publisher


class Admission:
    """Takes the poses of one publisher at a time.

    The first publisher leads until it has been silent for `silence`; then the next pose of any publisher does. While a
    publisher leads, the stamps of its headers must rise, if it gives any. A pose is late if it took longer than the
    fastest one of its publisher by more than `silence`: clocks of two hosts may differ, but a queue that holds poses
    back shows.
    """

    def __init__(self, subscription: Subscription) -> None:
        self._wanted = subscription
        self._leader = b""
        self._taken_at: float | None = None
        self._stamp_ns = 0
        self._clocks: dict[bytes, tuple[float, float]] = {}  # by publisher: shortest delay, last pose [s]
        self._refused: tuple[float, str] | None = None

    def take(self, pose: Pose, now: float) -> tuple[Vector, Vector] | None:
        """Position [m] and rotation vector [rad] to lead to; None if the pose does not lead.

        `now` is its time of arrival [s], of a clock that is never set.
        """
        if self.is_silent(now):
            self._begin(pose, now)
        rotation = self._rotation(pose)
        refusal = self._refusal(pose, now)
        if rotation is None:
            refusal = refusal or f"its orientation is no unit quaternion: {_shown(pose.orientation)}"
        if refusal is not None:
            self._refused = now, refusal
            return None
        self._leader, self._taken_at, self._stamp_ns = pose.source, now, pose.stamp_ns
        return subtract(pose.position, self._wanted.origin), rotation or ZERO

    def is_silent(self, now: float) -> bool:
        """Whether nobody leads."""
        return self._taken_at is None or now - self._taken_at > self._wanted.silence

    def refusal(self, now: float) -> str | None:
        """Why a pose was refused within the last second; None if none was."""
        return None if self._refused is None or now - self._refused[0] > SHOWN_S else self._refused[1]

    def _begin(self, pose: Pose, now: float) -> None:
        if self._taken_at is not None and pose.source == self._leader and now - self._taken_at < SHOWN_S:
            gap = now - self._taken_at
            self._refused = now, f"poses came {gap * 1e3:.0f} ms apart: publish faster, or raise silence_ms"
        self._leader, self._stamp_ns = pose.source, 0

    def _refusal(self, pose: Pose, now: float) -> str | None:
        wanted = self._wanted
        if pose.source != self._leader:
            return "another node publishes it too; the one that came first leads"
        late = self._lateness(pose, now)
        if wanted.frame_id is not None and pose.frame_id != wanted.frame_id:
            return f"its frame_id is {pose.frame_id[:60]!r}, not {wanted.frame_id!r}"
        if not is_finite(subtract(pose.position, wanted.origin)):
            return f"its position is not finite: {_shown(pose.position)}"
        if 0 < pose.stamp_ns <= self._stamp_ns:
            back = (self._stamp_ns - pose.stamp_ns) / SECOND_NS
            return f"its time goes back by {back:.3f} s" if back else "its time stands still"
        if late > wanted.silence:
            return f"poses come {late:.1f} s late"
        return None

    def _lateness(self, pose: Pose, now: float) -> float:
        """By how much it took longer than the fastest pose of this publisher [s]."""
        delay = now - pose.sent_ns / SECOND_NS
        least, looked_at = self._clocks.pop(pose.source, (delay, now))
        least = min(delay, least + RELAX * min(now - looked_at, self._wanted.silence))
        if len(self._clocks) >= MOST_CLOCKS:
            del self._clocks[next(iter(self._clocks))]  # of who has been silent for longest
        self._clocks[pose.source] = least, now
        return delay - least

    def _rotation(self, pose: Pose) -> Vector | None:
        if not self._wanted.turns:
            return ZERO
        unit = unit_quaternion(pose.orientation) if all(map(isfinite, pose.orientation)) else None
        square = sum(part * part for part in pose.orientation)
        return vector(unit) if unit is not None and abs(square**0.5 - 1.0) <= UNIT_WITHIN else None


def _shown(values: tuple[float, ...]) -> str:
    return ", ".join(f"{value:g}" for value in values)
