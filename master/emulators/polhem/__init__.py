"""The open relatives of the PHANTOM, emulated: a handle with encoders and motors, and the boards that speak for it."""

from weberlink.master.emulators.polhem.hid_board import PolhemHidEmulator, PolhemHidEmulatorOptions
from weberlink.master.emulators.polhem.serial_board import PolhemSerialEmulator, PolhemSerialEmulatorOptions

__all__ = ["PolhemHidEmulator", "PolhemHidEmulatorOptions", "PolhemSerialEmulator", "PolhemSerialEmulatorOptions"]
