"""The table of emulated robots, each by the name of the driver that talks to it."""

from collections.abc import Mapping
from typing import Any, ClassVar, Protocol

from pydantic import BaseModel

from weberlink.registry import Registry


class EmulatorClass(Protocol):
    """An emulator class: its options, its transport (serial or hid), and its own faults with what each value does."""

    Options: ClassVar[type[BaseModel]]
    transport: ClassVar[str]
    OWN_FAULTS: ClassVar[Mapping[str, str]]
    __call__: Any


EMULATORS = {"dynamixel": "weberlink.slave.emulators.dynamixel:DynamixelEmulator"}
_registry: Registry[EmulatorClass] = Registry("emulated robot", EMULATORS)
load = _registry.load
