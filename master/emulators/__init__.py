"""The emulated haptic devices there are: the mirror of `weberlink.slave.emulators`."""

from collections.abc import Mapping
from difflib import get_close_matches
from importlib import import_module
from typing import Any, ClassVar, Protocol, cast

from pydantic import BaseModel

EMULATORS = {
    "haply_2diy": "weberlink.master.emulators.haply:HaplyEmulator",
    "polhem_hid": "weberlink.master.emulators.polhem.hid_board:PolhemHidEmulator",
    "polhem_serial": "weberlink.master.emulators.polhem.serial_board:PolhemSerialEmulator",
}
"""By the name of the driver that talks to it: "module:Class", imported only on use."""


class EmulatorClass(Protocol):
    """An emulator as the table names it: its options, its transport (serial or hid), and the faults of its own.

    `OWN_FAULTS` has what each of them does, and with what value. A class for HID also has `identity`, a
    `weberlink.hardware.umockdev.description.HidIdentity`.
    """

    Options: ClassVar[type[BaseModel]]
    transport: ClassVar[str]
    OWN_FAULTS: ClassVar[Mapping[str, str]]
    __call__: Any


def load(name: str) -> EmulatorClass:
    """The emulator's class; raises ValueError for an unknown name."""
    if name not in EMULATORS:
        nearest = get_close_matches(name, EMULATORS, n=1, cutoff=0.0)
        raise ValueError(f"no emulated device is called {name!r}; nearest is {nearest[0]!r}")
    module, _, attribute = EMULATORS[name].partition(":")
    return cast(EmulatorClass, getattr(import_module(module), attribute))


__all__ = ["EMULATORS", "EmulatorClass", "load"]
