"""The haptic devices there are: a table of drivers, imported only on use and extended by entry points."""

from difflib import get_close_matches
from importlib import import_module
from importlib.metadata import entry_points
from typing import cast

from weberlink.master.devices.contract import DeviceDriver

BUILT_IN = {
    "haply_2diy": "weberlink.master.devices.haply.device:HaplyDevice",
    "operator": "weberlink.master.devices.operator:OperatorDevice",
    "polhem_hid": "weberlink.master.devices.polhem.hid_device:PolhemHidDevice",
    "polhem_serial": "weberlink.master.devices.polhem.serial_device:PolhemSerialDevice",
    "replay": "weberlink.master.devices.replay:ReplayDevice",
}

COMPUTED = frozenset({"operator", "replay"})
"""Those that move nothing real. All others count as hardware, those of other packages included."""


def drivers() -> dict[str, str]:
    """Name to "module:Class"; the built-in ones win over entry points of the group `weberlink.devices`."""
    return {entry.name: entry.value for entry in entry_points(group="weberlink.devices")} | BUILT_IN


def load(name: str) -> DeviceDriver:
    """The driver class; raises ValueError for an unknown name, ImportError where its package is missing."""
    table = BUILT_IN if name in BUILT_IN else drivers()  # which has to look through all packages that are installed
    if name not in table:
        nearest = get_close_matches(name, table, n=1, cutoff=0.0)
        raise ValueError(
            f"driver: no device is called {name!r}; nearest is {nearest[0]!r}, there are {', '.join(sorted(table))}"
        )
    module, _, attribute = table[name].partition(":")
    return cast(DeviceDriver, getattr(import_module(module), attribute))


def is_hardware(name: str) -> bool:
    """Whether a driver of this name may move something real."""
    return name not in COMPUTED
