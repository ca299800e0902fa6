"""The `ros2` driver: a modelled hand that follows the poses of a ROS 2 topic."""

from math import inf
from typing import Annotated, ClassVar, Protocol

from pydantic import AfterValidator, Field

from weberlink.geometry.vector import ZERO, Vector
from weberlink.master.devices.contract import DeviceFault, DeviceReading
from weberlink_pointer.device import PointerDevice, PointerOptions
from weberlink_pointer.target_link import POINTER, PointerTarget, TargetSocket, TargetSource, unpack
from weberlink_ros2.admission import Subscription
from weberlink_ros2.names import LARGEST_DOMAIN, check_endpoint, check_topic
from weberlink_ros2.process import ListenerProcess


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
        silence, turns = self.silence_ms * 1e-3, self.wrist is not None
        return Subscription(self.topic, self.domain, self.connect, self.frame_id, self.origin_m, silence, turns)


HOLD_S = 0.2  # who lets the topic lead, and has said nothing for longer, lets it no more [s]


class PoseSource(TargetSource[PointerTarget], Protocol):
    """Targets from a process that may end; texts and `lead` are those of `ListenerProcess`."""

    trouble: str | None
    failure: str | None

    def lead(self, *, allowed: bool) -> None: ...


class Ros2Device(PointerDevice):
    """A `pointer` whose targets are poses of a topic. It is held while poses come, and a person of this host lets them
    lead: a program of this user sends held targets to the socket of a `pointer`, of which the place does not count.

    Args:
        options: of the driver.
        tick_period: [s].
        source: of the targets; None for a listener process, which `open` starts.
        hold: whether the topic may lead, as the `held` of its targets; None for the socket of this process.
    """

    NAME: ClassVar = "ros2"
    LIVE: ClassVar = True  # another program leads it, so it cannot run in virtual time
    Options: ClassVar[type[Ros2Options]] = Ros2Options

    def __init__(
        self,
        options: Ros2Options,
        tick_period: float,
        source: PoseSource | None = None,
        hold: TargetSource[PointerTarget] | None = None,
    ) -> None:
        self._poses: PoseSource = ListenerProcess(options.subscription) if source is None else source
        self._hold: TargetSource[PointerTarget] = TargetSocket(POINTER, unpack) if hold is None else hold
        super().__init__(options, tick_period, self._poses)

    @property
    def trouble(self) -> str | None:
        return self._poses.trouble

    def _begin(self) -> None:
        super()._begin()
        self._may_lead, self._may_lead_until = False, -inf

    def open(self, now: float) -> None:
        try:
            self._hold.open()
        except OSError as error:
            raise DeviceFault(f"{self.NAME}: its socket cannot be opened: {error.strerror or error}") from None
        try:
            super().open(now)
        except BaseException:
            self._hold.close()
            raise

    def close(self) -> None:
        self._hold.close()
        super().close()

    def _take_target(self, now: float) -> None:
        asked = self._hold.newest()
        if asked is not None:
            self._may_lead_until = now + HOLD_S if asked.held else -inf
        if self._may_lead is not (now <= self._may_lead_until):
            self._may_lead = not self._may_lead
            self._held_until = -inf
            self._poses.lead(allowed=self._may_lead)
        super()._take_target(now)

    def latest(self, now: float) -> DeviceReading:
        reading = super().latest(now)
        if self._poses.failure is not None:
            raise DeviceFault(f"{self.NAME}: {self._poses.failure}")
        return reading
