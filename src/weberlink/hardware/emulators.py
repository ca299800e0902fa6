"""The table of emulators, each by the name of its driver; entry points of `weberlink.emulators` add more."""

from weberlink.hardware.emulator import EmulatorClass
from weberlink.registry import Registry

BUILT_IN = {
    "polhem_hid": "weberlink.master.emulators.polhem.hid_board:PolhemHidEmulator",
    "polhem_serial": "weberlink.master.emulators.polhem.serial_board:PolhemSerialEmulator",
}
EMULATORS: Registry[EmulatorClass] = Registry("emulated device", BUILT_IN, "weberlink.emulators")
