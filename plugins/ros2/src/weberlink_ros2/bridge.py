"""`bridge ros2`: publishes a running session as ROS 2 topics over Zenoh, for nodes with rmw_zenoh."""

from functools import partial

from weberlink.config import ConfigurationError
from weberlink_ros2 import follow
from weberlink_ros2.diagnostics import Level, Status
from weberlink_ros2.names import Qos
from weberlink_ros2.node import ROUTER, Node
from weberlink_ros2.topics import TopicBridge

NAME = "ros2"
NODE = "weberlink"
PERIOD_S = 0.002  # between two looks at the rings [s]: a message waits half of it on average


class Ros2Bridge(TopicBridge):
    """Publishes by a node of ROS 2."""

    _node: Node

    def own_status(self) -> Status:
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


def run(session: str | None, domain: int, connect: str | None, qos: Qos, rate_hz: float | None) -> None:
    """Publish running sessions until a signal: the one of this name, or the newest; see `Node` and `TopicBridge`.

    Raises:
        ConfigurationError: no such domain or endpoint.
        NodeError: no Zenoh session can be opened, or it has failed.
    """
    tell = partial(follow.tell, NAME)
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
