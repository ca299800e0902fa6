"""The tables of haptic device drivers and of leader arms, extended by the entry points of their groups."""

from weberlink.registry import Driver, Registry

BUILT_IN = {
    "operator": "weberlink.master.devices.operator:OperatorDevice",
    "polhem_hid": "weberlink.master.devices.polhem.hid_device:PolhemHidDevice",
    "polhem_serial": "weberlink.master.devices.polhem.serial_device:PolhemSerialDevice",
    "replay": "weberlink.master.devices.replay:ReplayDevice",
}
DEVICES: Registry[Driver] = Registry("device", BUILT_IN, "weberlink.devices")
LEADERS: Registry[Driver] = Registry("leader arm", {}, "weberlink.leaders")
