"""ROS 2 topics over Zenoh without ROS: names, types and sessions as rmw_zenoh has them."""

from weberlink.ros2.names import Qos
from weberlink.ros2.node import Node, NodeError, Publisher

__all__ = ["Node", "NodeError", "Publisher", "Qos"]
