"""The memory of one servo and who may write what; only the rules that need nothing but the registers themselves."""

from struct import Struct
from typing import NamedTuple

from weberlink.slave.emulators.control_table import (
    DEFINED,
    EEPROM_END,
    END,
    GOALS,
    ITEMS,
    Item,
    covered,
)
from weberlink.slave.robots.dynamixel.packet import (
    ACCESS_ERROR,
    DATA_LENGTH_ERROR,
    DATA_LIMIT_ERROR,
    DATA_RANGE_ERROR,
    RESULT_FAIL,
)

CURRENT_MODE, POSITION_MODE, EXTENDED_MODE, CURRENT_POSITION_MODE = 0, 3, 4, 5
MODES = (CURRENT_MODE, POSITION_MODE, EXTENDED_MODE, CURRENT_POSITION_MODE)
LIMITS = {"goal_current": "current_limit", "goal_velocity": "velocity_limit", "goal_pwm": "pwm_limit"}
"""Goals to the registers that bound their size."""


class Place(NamedTuple):
    """Where a register lies in the memory, and what fits into it."""

    address: int
    layout: Struct
    low: int
    high: int


def _place(item: Item) -> Place:
    signed, bits = item.low < 0, 8 * item.size
    code = {1: "b", 2: "h", 4: "i"}[item.size]
    layout = Struct("<" + (code if signed else code.upper()))
    if signed:
        return Place(item.address, layout, -(1 << (bits - 1)), (1 << (bits - 1)) - 1)
    return Place(item.address, layout, 0, (1 << bits) - 1)


PLACES = {item.name: _place(item) for item in ITEMS}


class RegisterTable:
    """As delivered; `memory` is what the addresses hold."""

    def __init__(self) -> None:
        self.memory = bytearray(END)
        for item in ITEMS:
            self[item.name] = item.initial

    def __getitem__(self, name: str) -> int:
        address, layout, _, _ = PLACES[name]
        return int(layout.unpack_from(self.memory, address)[0])

    def __setitem__(self, name: str, value: int) -> None:
        """What does not fit is cut to what does."""
        address, layout, low, high = PLACES[name]
        layout.pack_into(self.memory, address, min(high, max(low, value)))

    def clear_ram(self) -> None:
        """As after power: what is not EEPROM is as delivered."""
        for item in ITEMS:
            if item.address >= EEPROM_END:
                self[item.name] = item.initial

    def unreadable(self, address: int, size: int) -> int:
        """Why these addresses cannot be read, as an error number; 0 for no reason."""
        return 0 if size > 0 and _defined(address, size) else ACCESS_ERROR

    def unwritable(self, address: int, data: bytes) -> int:
        """Why these bytes must not be written, as an error number; 0 for no reason."""
        if not data or not _defined(address, len(data)):
            return ACCESS_ERROR
        items = covered(address, len(data))
        if items is None:
            return DATA_LENGTH_ERROR
        for item in items:
            error = self._refusal(item, PLACES[item.name].layout.unpack_from(data, item.address - address)[0])
            if error:
                return error
        return 0

    def _refusal(self, item: Item, value: int) -> int:
        """Why a register must not take a value; 0 for no reason."""
        name = item.name
        if not item.writable or (item.address < EEPROM_END and self["torque_enable"]):
            return ACCESS_ERROR
        if not item.low <= value <= item.high or (name == "operating_mode" and value not in MODES):
            return DATA_RANGE_ERROR
        if name in GOALS:
            return DATA_RANGE_ERROR if self["bus_watchdog"] < 0 else self._beyond(name, value)
        if name == "bus_watchdog" and (value < 0 or (self[name] < 0 and value != 0)):
            return DATA_RANGE_ERROR
        if name == "torque_enable" and value and self["hardware_error_status"] & self["shutdown"]:
            return RESULT_FAIL
        return 0

    def _beyond(self, goal: str, value: int) -> int:
        """Whether a goal is beyond the registers that limit it, as an error number."""
        if goal != "goal_position":
            return DATA_LIMIT_ERROR if abs(value) > self[LIMITS[goal]] else 0
        if self["operating_mode"] != POSITION_MODE:
            return 0
        return 0 if self["min_position_limit"] <= value <= self["max_position_limit"] else DATA_LIMIT_ERROR


def _defined(address: int, size: int) -> bool:
    return address + size <= END and DEFINED.issuperset(range(address, address + size))
