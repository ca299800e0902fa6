"""The table of emulated haptic devices, each by the name of the driver that talks to it."""

from weberlink.hardware.emulator import EmulatorClass
from weberlink.registry import Registry

EMULATORS = {
    "gamepad": "weberlink.master.emulators.gamepad:GamepadEmulator",
    "haply_2diy": "weberlink.master.emulators.haply:HaplyEmulator",
    "inverse3": "weberlink.master.emulators.inverse3:Inverse3Emulator",
    "koch_leader": "weberlink.arms.emulators.dynamixel.joint_arm:KochLeaderEmulator",
    "omx_leader": "weberlink.arms.emulators.dynamixel.joint_arm:OmxLeaderEmulator",
    "polhem_hid": "weberlink.master.emulators.polhem.hid_board:PolhemHidEmulator",
    "polhem_serial": "weberlink.master.emulators.polhem.serial_board:PolhemSerialEmulator",
    "so101_leader": "weberlink.arms.emulators.feetech:So101LeaderEmulator",
    "spacemouse": "weberlink.master.emulators.spacemouse:SpaceMouseEmulator",
}
_registry: Registry[EmulatorClass] = Registry("emulated device", EMULATORS)
load = _registry.load
