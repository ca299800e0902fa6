"""Which poses of a topic lead the hand, and why the others do not.

Pure: times are arguments. A pose that is refused counts as silence, so a publisher of nothing else has let go.

Everybody who reaches the topic can publish it, under the identity of another node too. So poses lead only while a
person on the operator's host lets them (`Admission.engage`), and one such act is for one publisher.
"""

from math import isfinite
from typing import NamedTuple

from weberlink.geometry.rotation import unit_quaternion, vector
from weberlink.geometry.vector import ZERO, Vector, is_finite, subtract

UNIT_WITHIN = 0.01  # largest difference between the length of a quaternion and 1
RELAX = 0.1
"""By how much the shortest delay may grow [s/s]: a clock of the publisher that was set back is forgiven so fast."""
MOST_CLOCKS = 16  # publishers whose delays are remembered
SHOWN_S = 1.0  # time for which a refusal is told [s]
SECOND_NS = 1_000_000_000
LET = "weberlink lead"  # the command by which a person lets a node lead
NOT_LET = f"nobody lets it lead the hand; run: {LET}"
LET_AGAIN = f"end {LET} and run it again"


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
    number: int  # of the message, as the publisher counts them


class Admission:
    """Takes the poses of one publisher after each act.

    After `engage` the only publisher leads, until `release`, or until it has been silent for `silence`, or its messages
    do not count up: then somebody else uses its identity. Nobody leads from then on until the next act, and none where
    two publish when it begins. While a publisher leads, the stamps of its headers must rise, if it gives any. A pose is
    late if it took longer than the fastest one of its publisher by more than `silence`: clocks of two hosts may differ,
    but a queue that holds poses back shows.
    """

    def __init__(self, subscription: Subscription) -> None:
        self._wanted = subscription
        self._ended: str | None = NOT_LET  # why nobody leads until the next act; None after one
        self._leader = b""
        self._taken_at: float | None = None
        self._stamp_ns = self._number = 0
        self._clocks: dict[bytes, tuple[float, float]] = {}  # by publisher: shortest delay, last pose [s]
        self._refused: tuple[float, str] | None = None

    def engage(self) -> None:
        """A person lets one publisher lead, the next that is heard."""
        self._ended, self._leader, self._taken_at = None, b"", None

    def release(self) -> None:
        """Nobody leads any more."""
        self._ended = NOT_LET

    def take(self, pose: Pose, now: float) -> tuple[Vector, Vector] | None:
        """Position [m] and rotation vector [rad] to lead to; None if the pose does not lead.

        `now` is its time of arrival [s], of a clock that is never set.
        """
        self._end(pose, now)
        rotation = self._rotation(pose)
        refusal = self._refusal(pose, now)
        if rotation is None:
            refusal = refusal or f"its orientation is no unit quaternion: {_shown(pose.orientation)}"
        if refusal is not None:
            self._refused = now, refusal
            return None
        self._leader, self._taken_at, self._stamp_ns, self._number = pose.source, now, pose.stamp_ns, pose.number
        return subtract(pose.position, self._wanted.origin), rotation or ZERO

    def is_silent(self, now: float) -> bool:
        """Whether nobody leads."""
        return self._ended is not None or self._taken_at is None or now - self._taken_at > self._wanted.silence

    def refusal(self, now: float) -> str | None:
        """Why a pose was refused within the last second; None if none was."""
        return None if self._refused is None or now - self._refused[0] > SHOWN_S else self._refused[1]

    def _end(self, pose: Pose, now: float) -> None:
        """End what the last act began, if its publisher was silent, or is not alone."""
        if self._ended is not None:
            return
        if self._taken_at is None:
            heard = [at for source, (_, at) in self._clocks.items() if source != pose.source]
            if any(now - at <= self._wanted.silence for at in heard):
                self._ended = f"two nodes publish it: end one, then {LET_AGAIN}"
            return
        gap = now - self._taken_at
        if gap > self._wanted.silence:
            again = "publish faster, or raise silence_ms, and " if pose.source == self._leader and gap < SHOWN_S else ""
            self._ended = f"nothing came of the node that led for {gap * 1e3:.0f} ms: {again}{LET_AGAIN}"
        elif pose.source == self._leader and pose.number <= self._number:
            self._ended = f"two nodes publish under one identity: {LET_AGAIN}"

    def _refusal(self, pose: Pose, now: float) -> str | None:
        wanted, leads = self._wanted, self._taken_at is not None and self._ended is None
        if leads and pose.source != self._leader:
            return "another node publishes it too; the one that came first leads"
        late = self._lateness(pose, now)
        if wanted.frame_id is not None and pose.frame_id != wanted.frame_id:
            return f"its frame_id is {pose.frame_id[:60]!r}, not {wanted.frame_id!r}"
        if not is_finite(subtract(pose.position, wanted.origin)):
            return f"its position is not finite: {_shown(pose.position)}"
        if leads and 0 < pose.stamp_ns <= self._stamp_ns:
            back = (self._stamp_ns - pose.stamp_ns) / SECOND_NS
            return f"its time goes back by {back:.3f} s" if back else "its time stands still"
        if late > wanted.silence:
            return f"poses come {late:.1f} s late"
        return self._ended

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
