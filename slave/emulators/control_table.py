"""The control table of an XM430-W350, as its manual prints it: addresses, sizes, access, initial values and ranges.

Written from the manual alone, apart from the table that the driver has, so that each checks the other. Only data: what
a register does is in `slave.emulators.servo`. Left out: indirect addressing (168 and above), which no driver here uses.

Source: ROBOTIS e-Manual, XM430-W350, "Control Table of EEPROM Area" and "of RAM Area".
"""

from typing import NamedTuple

EEPROM_END = 64
END = 147
ANY_16, ANY_32 = 0x7FFF, 0x7FFF_FFFF
"""Range of a goal that only another register limits."""
MODEL = 1020
"""XM430-W350."""
FIRMWARE = 45
"""Of a servo new enough for everything here (bus watchdog from 38, clear from 42)."""


class Item(NamedTuple):
    """One register. Signed where `low` is below 0; `low` and `high` are what the manual gives as its range."""

    address: int
    size: int
    name: str
    writable: bool
    initial: int
    low: int
    high: int


def _read_only(address: int, size: int, name: str, initial: int = 0, *, signed: bool = False) -> Item:
    low = -(1 << (8 * size - 1)) if signed else 0
    return Item(address, size, name, False, initial, low, (1 << (8 * size - (1 if signed else 0))) - 1)


def _read_write(address: int, size: int, name: str, initial: int, low: int, high: int) -> Item:
    return Item(address, size, name, True, initial, low, high)


ITEMS = (
    _read_only(0, 2, "model_number", MODEL),
    _read_only(2, 4, "model_information"),
    _read_only(6, 1, "firmware_version", FIRMWARE),
    _read_write(7, 1, "id", 1, 0, 252),
    _read_write(8, 1, "baud_rate", 1, 0, 7),
    _read_write(9, 1, "return_delay_time", 250, 0, 254),
    _read_write(10, 1, "drive_mode", 0, 0, 5),
    _read_write(11, 1, "operating_mode", 3, 0, 16),
    _read_write(12, 1, "secondary_id", 255, 0, 255),
    _read_write(13, 1, "protocol_version", 2, 1, 2),
    _read_write(20, 4, "homing_offset", 0, -1_044_479, 1_044_479),
    _read_write(24, 4, "moving_threshold", 10, 0, 1023),
    _read_write(31, 1, "temperature_limit", 80, 0, 100),
    _read_write(32, 2, "max_voltage_limit", 160, 95, 160),
    _read_write(34, 2, "min_voltage_limit", 95, 95, 160),
    _read_write(36, 2, "pwm_limit", 885, 0, 885),
    _read_write(38, 2, "current_limit", 1193, 0, 1193),
    _read_write(40, 4, "acceleration_limit", 32_767, 0, 32_767),
    _read_write(44, 4, "velocity_limit", 350, 0, 1023),
    _read_write(48, 4, "max_position_limit", 4095, 0, 4095),
    _read_write(52, 4, "min_position_limit", 0, 0, 4095),
    _read_write(63, 1, "shutdown", 52, 0, 255),
    _read_write(64, 1, "torque_enable", 0, 0, 1),
    _read_write(65, 1, "led", 0, 0, 1),
    _read_write(68, 1, "status_return_level", 2, 0, 2),
    _read_only(69, 1, "registered_instruction"),
    _read_only(70, 1, "hardware_error_status"),
    _read_write(76, 2, "velocity_i_gain", 1920, 0, 16_383),
    _read_write(78, 2, "velocity_p_gain", 100, 0, 16_383),
    _read_write(80, 2, "position_d_gain", 0, 0, 16_383),
    _read_write(82, 2, "position_i_gain", 0, 0, 16_383),
    _read_write(84, 2, "position_p_gain", 800, 0, 16_383),
    _read_write(88, 2, "feedforward_2nd_gain", 0, 0, 16_383),
    _read_write(90, 2, "feedforward_1st_gain", 0, 0, 16_383),
    _read_write(98, 1, "bus_watchdog", 0, -1, 127),
    _read_write(100, 2, "goal_pwm", 885, -ANY_16, ANY_16),
    _read_write(102, 2, "goal_current", 0, -ANY_16, ANY_16),
    _read_write(104, 4, "goal_velocity", 0, -ANY_32, ANY_32),
    _read_write(108, 4, "profile_acceleration", 0, 0, 32_767),
    _read_write(112, 4, "profile_velocity", 0, 0, 32_767),
    _read_write(116, 4, "goal_position", 0, -1_048_575, 1_048_575),
    _read_only(120, 2, "realtime_tick"),
    _read_only(122, 1, "moving"),
    _read_only(123, 1, "moving_status"),
    _read_only(124, 2, "present_pwm", signed=True),
    _read_only(126, 2, "present_current", signed=True),
    _read_only(128, 4, "present_velocity", signed=True),
    _read_only(132, 4, "present_position", signed=True),
    _read_only(136, 4, "velocity_trajectory", signed=True),
    _read_only(140, 4, "position_trajectory", signed=True),
    _read_only(144, 2, "present_input_voltage", 120),
    _read_only(146, 1, "present_temperature", 30),
)
BY_NAME = {item.name: item for item in ITEMS}
BY_ADDRESS = {item.address: item for item in ITEMS}
DEFINED = frozenset(item.address + offset for item in ITEMS for offset in range(item.size))
GOALS = frozenset({"goal_pwm", "goal_current", "goal_velocity", "goal_position"})
"""Read-only while the bus watchdog is tripped."""

BAUD_RATES = (9_600, 57_600, 115_200, 1_000_000, 2_000_000, 3_000_000, 4_000_000, 4_500_000)
"""By the value of the register `baud_rate` [bit/s]."""


def covered(address: int, size: int) -> list[Item] | None:
    """The items that `size` bytes from `address` are made of; None where they begin or end within one or in a gap."""
    items = []
    end = address + size
    while address < end:
        item = BY_ADDRESS.get(address)
        if item is None or address + item.size > end:
            return None
        items.append(item)
        address += item.size
    return items
