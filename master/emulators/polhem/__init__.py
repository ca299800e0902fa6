"""The open relatives of the PHANTOM, emulated: a handle with encoders and motors, and the boards that speak for it."""

from master.emulators.polhem.hid_board import PolhemHidEmulator, PolhemHidEmulatorOptions
from master.emulators.polhem.serial_board import PolhemSerialEmulator, PolhemSerialEmulatorOptions

__all__ = ["PolhemHidEmulator", "PolhemHidEmulatorOptions", "PolhemSerialEmulator", "PolhemSerialEmulatorOptions"]
