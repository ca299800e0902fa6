"""The map between the frames of a haptic device and of the robot: rotation, scale, clutch and virtual walls.

Everything outside this package uses the robot's frame. `MappedDevice` implements the device contract, so the loop does
not depend on the map.
"""

from weberlink.master.mapping.frame import FrameMap, Walls
from weberlink.master.mapping.mapped_device import Clutch, MappedDevice

__all__ = ["Clutch", "FrameMap", "MappedDevice", "Walls"]
