"""The table of haptic device drivers, extended by entry points of the group `weberlink.devices`."""

from weberlink.registry import Driver, Registry

BUILT_IN = {
    "operator": "weberlink.master.devices.operator:OperatorDevice",
    "pointer": "weberlink.master.devices.pointer:PointerDevice",
    "polhem_hid": "weberlink.master.devices.polhem.hid_device:PolhemHidDevice",
    "polhem_serial": "weberlink.master.devices.polhem.serial_device:PolhemSerialDevice",
    "replay": "weberlink.master.devices.replay:ReplayDevice",
}
DEVICES: Registry[Driver] = Registry("device", BUILT_IN, "weberlink.devices")
