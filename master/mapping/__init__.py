"""The map between the frame of a haptic device and the frame of the robot: rotation, scale, clutch, virtual walls.

Everything beyond this package is in the robot's frame: what is encoded, sent, displayed and recorded. `MappedDevice`
is a device like any other, so that no loop knows whether there is a map.
"""

from weberlink.master.mapping.frame import FrameMap, Walls
from weberlink.master.mapping.mapped_device import Clutch, MappedDevice

__all__ = ["Clutch", "FrameMap", "MappedDevice", "Walls"]
