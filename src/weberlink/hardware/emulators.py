"""The table of emulators, each by the name of its driver; entry points of `weberlink.emulators` add more."""

from weberlink.hardware.emulator import EmulatorClass
from weberlink.registry import Registry

BUILT_IN = {
    "dynamixel": "weberlink.slave.emulators.dynamixel:DynamixelEmulator",
    "gamepad": "weberlink.master.emulators.gamepad:GamepadEmulator",
    "haply_2diy": "weberlink.master.emulators.haply:HaplyEmulator",
    "inverse3": "weberlink.master.emulators.inverse3:Inverse3Emulator",
    "koch_follower": "weberlink.arms.emulators.dynamixel.joint_arm:KochFollowerEmulator",
    "koch_leader": "weberlink.arms.emulators.dynamixel.joint_arm:KochLeaderEmulator",
    "omx_leader": "weberlink.arms.emulators.dynamixel.joint_arm:OmxLeaderEmulator",
    "open_manipulator_x": "weberlink.slave.emulators.dynamixel:DynamixelEmulator",
    "polhem_hid": "weberlink.master.emulators.polhem.hid_board:PolhemHidEmulator",
    "polhem_serial": "weberlink.master.emulators.polhem.serial_board:PolhemSerialEmulator",
    "so101_follower": "weberlink.arms.emulators.feetech:So101FollowerEmulator",
    "so101_leader": "weberlink.arms.emulators.feetech:So101LeaderEmulator",
    "spacemouse": "weberlink.master.emulators.spacemouse:SpaceMouseEmulator",
}
EMULATORS: Registry[EmulatorClass] = Registry("emulated device", BUILT_IN, "weberlink.emulators")
