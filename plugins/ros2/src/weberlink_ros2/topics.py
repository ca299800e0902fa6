"""The ROS topics of a running session, for a bridge to publish: motion, forces, markers and diagnostics."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from time import monotonic, time, time_ns
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from weberlink.telemetry.reader import Records
from weberlink_figures.channel import joints_in
from weberlink_figures.message import Origin
from weberlink_figures.watching.rings import RingSource
from weberlink_figures.watching.ros import shown, topics
from weberlink_figures.watching.scene import drawn
from weberlink_ros2 import follow
from weberlink_ros2.diagnostics import SideCondition, Status
from weberlink_ros2.markers import MARKERS, body_markers, no_markers, reach_of, scene_markers
from weberlink_ros2.messages import encode_body, types
from weberlink_ros2.names import Qos

DIAGNOSTICS_S = 1.0  # period of the diagnostics, and of the scene, which whoever comes later needs as well
BODIES_S = 1.0 / 30.0  # period of the markers of hand and robot
DIAGNOSTICS, SCENE, BODIES = "/diagnostics", "/weberlink/scene", "/weberlink/bodies"
ARRAY, STATUS, PAIR = (f"diagnostic_msgs/msg/{name}" for name in ("DiagnosticArray", "DiagnosticStatus", "KeyValue"))
FRESH_S = 2 * follow.FIND_S  # of a side that is found, older records are left out [s]: a topic is no history
LARGEST_STEP_S = 0.1  # a wall clock that was set by more than this moves the stamps along [s]


@dataclass
class _Side:
    """A side that is published."""

    source: RingSource
    condition: SideCondition
    stride: int  # of so many ticks one is published
    joints: tuple[str, ...]  # the axes of a session in joint space
    wall_offset_s: float  # from the clock of the records to the wall clock
    since: float  # older records are left out, on the clock of the records [s]
    before: int | None = None  # ticks that were overwritten before the side was found; None until its first records

    @property
    def lost(self) -> int:
        """Ticks that were overwritten before they were read."""
        return 0 if self.before is None else self.source.lost - self.before

    def choose(self, records: Records) -> Records:
        """Those to publish."""
        chosen = records if self.stride == 1 else records[records["tick"] % self.stride == 0]
        return chosen if len(chosen) == 0 or chosen["at"][0] >= self.since else chosen[chosen["at"] >= self.since]

    def times_ns(self, at: NDArray[np.float64]) -> NDArray[np.uint64]:
        """Wall clock of some ticks [ns since 1970]."""
        return Origin(self.source.side, self.source.rate_hz, self.wall_offset_s, 0.0).log_times_ns(at)


def wall_offset_s() -> float:
    """From the monotonic clock to the wall clock [s]."""
    return time() - monotonic()


class Publisher(Protocol):
    """Of one topic; `sequence` is the number of messages published, which are given without encapsulation header."""

    sequence: int

    def put_body(self, cdr: bytes, stamp_ns: int) -> None: ...


class TopicNode(Protocol):
    """What publishes: a node of ROS 2, or a server for Foxglove."""

    def publisher(self, topic: str, type_name: str, qos: Qos | None = None) -> Publisher: ...

    def close(self) -> None: ...


class TopicBridge(ABC):
    """Publishes the records of a session; all calls come from one thread. A subclass tells its own condition.

    Args:
        node: that publishes; closed with the bridge.
        qos: of the topics of a session.
        rate_hz: of the messages of each topic; None for every tick.
        tell: called with lines for the user.
        offset_s: from the monotonic clock to the wall clock [s].
    """

    def __init__(
        self,
        node: TopicNode,
        qos: Qos,
        rate_hz: float | None,
        tell: follow.Tell,
        offset_s: Callable[[], float] = wall_offset_s,
    ) -> None:
        self._node, self._qos, self._rate_hz, self._tell, self._offset_s = node, qos, rate_hz, tell, offset_s
        self._sides: dict[str, _Side] = {}
        self._publishers: dict[str, Publisher] = {}
        self._diagnostics = node.publisher(DIAGNOSTICS, ARRAY)
        self._diagnose_at = 0.0
        self._ended: list[Status] = []
        self._session: str | None = None
        self._newest: dict[str, Any] = {}
        self._scene: bytes | None = None  # its markers; None for arms, which have none
        self._reach, self._show_at = 0.0, 0.0
        self._lost = 0  # ticks of sides that have ended, which were overwritten before they were read

    def begin(self, session: str, source: RingSource) -> None:
        """A side of a session begins; `source.description` is its configuration (`weberlink.session.description`)."""
        self._session = session
        try:
            joints = joints_in((source.description or {})["system"])
        except (KeyError, ValueError) as error:
            self._tell(f"{source.side} is left out: its description does not tell what it is ({error})")
            return
        stride = 1 if self._rate_hz is None else max(1, round(source.rate_hz / self._rate_hz))
        now = monotonic()
        condition = SideCondition(source, now)
        self._sides[source.side] = _Side(source, condition, stride, joints, self._offset_s(), now - FRESH_S)
        for topic, type_name in topics(source.side, arm=bool(joints)).items():
            self._publish(topic, type_name)
        for topic in self._publishers.keys() & {SCENE, BODIES}:
            self._publishers[topic].put_body(no_markers(), time_ns())
        self._scene = None
        if not joints:
            slave = (source.description or {})["system"]["slave"]
            solids, tool = drawn(slave.get("scene") or ()), (slave["robot"].get("tool") or {}).get("points_m") or ()
            self._reach, self._scene = reach_of(solids), scene_markers(solids, tool)
            self._publish(SCENE, MARKERS).put_body(self._scene, time_ns())
            self._publish(BODIES, MARKERS)

    def put(self, source: RingSource, records: Records) -> None:
        """New records of that side, oldest first, at least one."""
        side = self._sides.get(source.side)
        if side is None:
            return
        if side.before is None:
            side.before = source.lost
        side.condition.take(records, monotonic())
        self._newest[source.side] = records[-1]
        ticks = side.choose(records)
        if not len(ticks):
            return
        for topic, _, bodies in shown(source.side, ticks, side.times_ns(ticks["at"]), side.joints):
            publisher, size = self._publishers[topic], bodies.dtype.itemsize
            data, now_ns = bodies.tobytes(), time_ns()
            for begin in range(0, len(data), size):
                publisher.put_body(data[begin : begin + size], now_ns)

    def end(self, source: RingSource) -> int:
        """The side has ended; all its records were put. Returns how many ticks were overwritten before that."""
        side, lost = self._sides.pop(source.side, None), 0
        if side is not None:
            self._ended.append(side.condition.status(monotonic()))
            lost = side.lost
        self._lost += lost
        self._newest.pop(source.side, None)
        if not self._sides:
            self._session = None
        return lost

    def look(self, now: float) -> None:
        """Called once a round, after the records."""
        if now >= self._show_at and self._newest and self._scene is not None:
            self._show_at, now_ns = now + BODIES_S, time_ns()
            self._publishers[BODIES].put_body(body_markers(self._newest, self._reach, now_ns), now_ns)
        if now >= self._diagnose_at:
            self._diagnose_at = now + DIAGNOSTICS_S
            offset_s = self._offset_s()
            for side in self._sides.values():
                if abs(offset_s - side.wall_offset_s) > LARGEST_STEP_S:
                    side.wall_offset_s = offset_s
            self._diagnose(now)

    def close(self) -> None:
        self._node.close()

    @abstractmethod
    def own_status(self) -> Status:
        """The condition of the bridge."""

    def _publish(self, topic: str, type_name: str) -> Publisher:
        """The publisher of a topic, which is announced on first use."""
        if topic not in self._publishers:
            self._publishers[topic] = self._node.publisher(topic, type_name, self._qos)
        return self._publishers[topic]

    def _diagnose(self, now: float) -> None:
        if self._scene is not None and self._sides:
            self._publish(SCENE, MARKERS).put_body(self._scene, time_ns())
        statuses = [self.own_status(), *self._ended, *(side.condition.status(now) for side in self._sides.values())]
        self._ended.clear()
        now_ns, made = time_ns(), types().types
        header = made["std_msgs/msg/Header"](made["builtin_interfaces/msg/Time"](now_ns // 10**9, now_ns % 10**9), "")
        told = [
            made[STATUS](int(level), *texts, [made[PAIR](*pair) for pair in values.items()])
            for level, *texts, values in statuses
        ]
        self._diagnostics.put_body(encode_body(made[ARRAY](header, told), ARRAY), now_ns)
