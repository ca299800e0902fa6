"""`bridge ros2`: publishes a running session as ROS 2 topics over Zenoh, for nodes with rmw_zenoh."""

from collections.abc import Callable
from dataclasses import dataclass
from time import monotonic, time, time_ns
from typing import Any

import numpy as np
from numpy.typing import NDArray

from weberlink.apps.bridge import follow
from weberlink.apps.bridge.diagnostics import Level, SideCondition, Status
from weberlink.apps.ros_topics import shown, topics
from weberlink.ros2.messages import encode_body, types
from weberlink.ros2.names import Qos
from weberlink.ros2.node import ROUTER, Node, Publisher
from weberlink.system.configuration import ConfigurationError
from weberlink.system.scoring.arm import ArmLayout, arm_in
from weberlink.system.scoring.session import Records
from weberlink.telemetry.recording.message import Origin
from weberlink.watching.rings import RingSource

NAME = "ros2"
NODE = "weberlink"
PERIOD_S = 0.002
"""Between two looks at the rings [s]: a message waits half of it on average."""
DIAGNOSTICS_S = 1.0
DIAGNOSTICS = "/diagnostics"
ARRAY, STATUS, PAIR = (f"diagnostic_msgs/msg/{name}" for name in ("DiagnosticArray", "DiagnosticStatus", "KeyValue"))
FRESH_S = 2 * follow.FIND_S
"""Of a side that is found, older records are left out [s]: a topic is no history."""
LARGEST_STEP_S = 0.1
"""A wall clock that was set by more than this moves the stamps along [s]."""


@dataclass
class _Side:
    """A side that is published.

    Args:
        source: of the side.
        condition: for its diagnostics.
        stride: of so many ticks one is published.
        arm: the axes of a session in joint space.
        wall_offset_s: from the clock of the records to the wall clock [s].
        since: older records are left out, on the clock of the records [s].
        before: ticks that were overwritten before the side was found; None until its first records.
    """

    source: RingSource
    condition: SideCondition
    stride: int
    arm: ArmLayout | None
    wall_offset_s: float
    since: float
    before: int | None = None

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


class Ros2Bridge:
    """Publishes the records of a session.

    Args:
        node: that publishes; closed with the bridge.
        qos: of the topics of a session.
        rate_hz: of the messages of each topic; None for every tick.
        tell: called with lines for the user.
        offset_s: from the monotonic clock to the wall clock [s].
    """

    def __init__(
        self,
        node: Node,
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
        self._lost = 0
        """Ticks of sides that have ended, which were overwritten before they were read."""

    def begin(self, session: str, source: RingSource) -> None:
        self._session = session
        try:
            arm = arm_in((source.description or {})["system"])
        except (KeyError, ValueError) as error:
            self._tell(f"{source.side} is left out: its description does not tell what it is ({error})")
            return
        stride = 1 if self._rate_hz is None else max(1, round(source.rate_hz / self._rate_hz))
        now = monotonic()
        condition = SideCondition(source, now)
        self._sides[source.side] = _Side(source, condition, stride, arm, self._offset_s(), now - FRESH_S)
        for topic, type_name in topics(source.side, arm).items():
            if topic not in self._publishers:
                self._publishers[topic] = self._node.publisher(topic, type_name, self._qos)

    def put(self, source: RingSource, records: Records) -> None:
        side = self._sides.get(source.side)
        if side is None:
            return
        if side.before is None:
            side.before = source.lost
        side.condition.take(records, monotonic())
        ticks = side.choose(records)
        if not len(ticks):
            return
        for topic, _, bodies in shown(source.side, ticks, side.times_ns(ticks["at"]), side.arm):
            publisher, size = self._publishers[topic], bodies.dtype.itemsize
            data, now_ns = bodies.tobytes(), time_ns()
            for begin in range(0, len(data), size):
                publisher.put_body(data[begin : begin + size], now_ns)

    def end(self, source: RingSource) -> None:
        side = self._sides.pop(source.side, None)
        if side is not None:
            self._ended.append(side.condition.status(monotonic()))
            self._lost += side.lost
        if not self._sides:
            self._session = None

    def look(self, now: float) -> None:
        if now >= self._diagnose_at:
            self._diagnose_at = now + DIAGNOSTICS_S
            offset_s = self._offset_s()
            for side in self._sides.values():
                if abs(offset_s - side.wall_offset_s) > LARGEST_STEP_S:
                    side.wall_offset_s = offset_s
            self._diagnose(now)

    def close(self) -> None:
        self._node.close()

    def _diagnose(self, now: float) -> None:
        statuses = [self._own_status(), *self._ended, *(side.condition.status(now) for side in self._sides.values())]
        self._ended.clear()
        now_ns = time_ns()
        self._diagnostics.put_body(encode_body(_array(statuses, now_ns), ARRAY), now_ns)

    def _own_status(self) -> Status:
        lost = self._lost + sum(side.lost for side in self._sides.values())
        told = "waits for a session" if self._session is None else f"publishes session {self._session}"
        level = Level.OK
        if lost:
            level, told = Level.WARN, f"{told}; {lost} ticks were overwritten before they were published"
        values = {
            "messages": str(sum(publisher.sequence for publisher in self._publishers.values())),
            "ticks lost": str(lost),
            "connections": str(self._node.connections),
            "in place of the router": "yes" if self._node.is_router else "no",
        }
        return Status(level, "weberlink: bridge", told, "", values)


def _array(statuses: list[Status], now_ns: int) -> Any:
    """The message diagnostic_msgs/DiagnosticArray."""
    made = types().types
    header = made["std_msgs/msg/Header"](made["builtin_interfaces/msg/Time"](now_ns // 10**9, now_ns % 10**9), "")
    told = [
        made[STATUS](
            int(status.level),
            status.name,
            status.message,
            status.hardware,
            [made[PAIR](name, value) for name, value in status.values.items()],
        )
        for status in statuses
    ]
    return made[ARRAY](header, told)


def run(session: str | None, domain: int, connect: str | None, qos: Qos, rate_hz: float | None) -> None:
    """Publish running sessions until a signal.

    Args:
        session: name of the session to follow; None for the newest.
        domain: of ROS.
        connect: endpoint of the Zenoh router; None for that of this host, or of the file of the environment.
        qos: of the topics.
        rate_hz: of the messages of each topic; None for every tick.

    Raises:
        ConfigurationError: no such domain or endpoint.
        NodeError: no Zenoh session can be opened, or it has failed.
    """

    def tell(text: str) -> None:
        follow.tell(NAME, text)

    try:
        node = Node(NODE, domain, connect)
    except ValueError as error:
        raise ConfigurationError(f"weberlink bridge ros2: {error}") from None
    place = connect or ROUTER
    if node.is_router:
        tell(f"no Zenoh router at {place}: takes its place until it ends, for this host only")
    elif not node.connections:
        tell(f"not connected to {place} yet; keeps trying")
    follow.run(Ros2Bridge(node, qos, rate_hz, tell), session, PERIOD_S, tell)
