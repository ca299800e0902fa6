"""The `ros2` driver: a modelled hand that follows the poses of a ROS 2 topic."""

from typing import ClassVar, Protocol

from weberlink.master.devices.contract import DeviceFault, DeviceReading
from weberlink.master.devices.pointer import PointerDevice
from weberlink.master.devices.pointer_link import TargetSource
from weberlink_ros2.options import Ros2Options
from weberlink_ros2.process import ListenerProcess


class PoseSource(TargetSource, Protocol):
    """Targets from a process that may end."""

    trouble: str | None
    """Why no pose leads, or why some do not; None if all is well."""
    failure: str | None
    """Why there will be no more; None while there may be."""


class Ros2Device(PointerDevice):
    """A `pointer` whose targets are poses of a topic. It is held while poses come.

    Args:
        options: of the driver.
        tick_period: [s].
        source: of the targets; None for a listener process, which `open` starts.
    """

    NAME: ClassVar = "ros2"
    LIVE: ClassVar = True
    """Another program leads it, so it cannot run in virtual time."""
    Options: ClassVar[type[Ros2Options]] = Ros2Options

    def __init__(self, options: Ros2Options, tick_period: float, source: PoseSource | None = None) -> None:
        self._poses: PoseSource = ListenerProcess(options.subscription) if source is None else source
        super().__init__(options, tick_period, self._poses)

    @property
    def trouble(self) -> str | None:
        return self._poses.trouble

    def latest(self, now: float) -> DeviceReading:
        reading = super().latest(now)
        if self._poses.failure is not None:
            raise DeviceFault(f"{self.NAME}: {self._poses.failure}")
        return reading
