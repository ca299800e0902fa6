"""Options of the `ros2` driver."""

from typing import Annotated

from pydantic import AfterValidator, Field

from weberlink.geometry.vector import ZERO, Vector
from weberlink.master.devices.pointer import PointerOptions
from weberlink_ros2.admission import Subscription
from weberlink_ros2.names import LARGEST_DOMAIN, check_endpoint, check_topic


class Ros2Options(PointerOptions):
    """Options of `ros2`: which topic leads the hand; the others are those of `pointer`."""

    topic: Annotated[str, AfterValidator(check_topic)] = Field(
        default="/weberlink/target", description="of geometry_msgs/msg/PoseStamped, with its namespace"
    )
    domain: int = Field(default=0, ge=0, le=LARGEST_DOMAIN, description="as ROS_DOMAIN_ID of the publisher")
    connect: Annotated[str, AfterValidator(check_endpoint)] | None = Field(
        default=None,
        description="endpoint of the Zenoh router, such as tcp/192.168.1.5:7447; that of this host if not given",
    )
    frame_id: str | None = Field(
        default="weberlink", description="frame that the poses must be in; null takes them in any frame"
    )
    origin_m: Vector = Field(
        default=ZERO, description="becomes (0, 0, 0), the middle of the workspace; in the frame of the poses"
    )

    @property
    def subscription(self) -> Subscription:
        """What the listener has to know of them."""
        return Subscription(
            self.topic,
            self.domain,
            self.connect,
            self.frame_id,
            self.origin_m,
            self.silence_ms * 1e-3,
            self.wrist is not None,
        )
