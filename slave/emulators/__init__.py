"""The table of emulated robots, each by the name of the driver that talks to it."""

from weberlink.hardware.emulator import EmulatorClass
from weberlink.registry import Registry

EMULATORS = {
    "dynamixel": "weberlink.slave.emulators.dynamixel:DynamixelEmulator",
    "koch_follower": "weberlink.arms.emulators.dynamixel.joint_arm:KochFollowerEmulator",
    "open_manipulator_x": "weberlink.slave.emulators.dynamixel:DynamixelEmulator",
    "so101_follower": "weberlink.arms.emulators.feetech:So101FollowerEmulator",
}
load = Registry[EmulatorClass]("emulated robot", EMULATORS).load
