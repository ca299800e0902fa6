"""Registers of Dynamixel X-series motors that the driver uses, their units, and the meaning of alarms.

Source: ROBOTIS e-Manual, pages "XM430-W350" and "Bus Watchdog". Registers below 64 are EEPROM: writable only with the
torque off.
"""

from math import pi
from typing import Final, NamedTuple


class Register(NamedTuple):
    """Address and size of a value [bytes]."""

    address: int
    size: int
    signed: bool = False

    def encode(self, value: int) -> bytes:
        """Raises OverflowError for a value that does not fit."""
        return value.to_bytes(self.size, "little", signed=self.signed)

    def decode(self, data: bytes) -> int:
        return int.from_bytes(data, "little", signed=self.signed)


MODEL_NUMBER: Final = Register(0, 2)
ID: Final = Register(7, 1)
BAUD_RATE: Final = Register(8, 1)
RETURN_DELAY_TIME: Final = Register(9, 1)
DRIVE_MODE: Final = Register(10, 1)
OPERATING_MODE: Final = Register(11, 1)
HOMING_OFFSET: Final = Register(20, 4, signed=True)
CURRENT_LIMIT: Final = Register(38, 2)
TORQUE_ENABLE: Final = Register(64, 1)
HARDWARE_ERROR: Final = Register(70, 1)
BUS_WATCHDOG: Final = Register(98, 1, signed=True)
GOAL_CURRENT: Final = Register(102, 2, signed=True)
GOAL_POSITION: Final = Register(116, 4, signed=True)
PRESENT_CURRENT: Final = Register(126, 2, signed=True)
PRESENT_VELOCITY: Final = Register(128, 4, signed=True)
PRESENT_POSITION: Final = Register(132, 4, signed=True)

PRESENT_ADDRESS: Final = PRESENT_CURRENT.address
PRESENT_SIZE: Final = 10
"""Current, velocity and position are contiguous: one read of 10 bytes."""

MODE_CURRENT: Final = 0
MODE_CURRENT_BASED_POSITION: Final = 5

DRIVE_MODE_REVERSE: Final = 0x01
"""Bit of the drive mode: position, velocity and current have the opposite sign."""

WATCHDOG_TRIPPED: Final = -1
"""Read from the bus watchdog: goals are read-only until 0 is written to it."""
WATCHDOG_UNIT_S: Final = 0.020
WATCHDOG_MOST: Final = 127

BAUD_RATES: Final = (9_600, 57_600, 115_200, 1_000_000, 2_000_000, 3_000_000, 4_000_000, 4_500_000)
"""By the value of the register [bit/s]; delivered with 1."""

COUNTS_PER_TURN: Final = 4096
CENTRE: Final = 2048
RAD_PER_COUNT: Final = 2.0 * pi / COUNTS_PER_TURN
RAD_S_PER_COUNT: Final = 0.229 * 2.0 * pi / 60.0
A_PER_COUNT: Final = 2.69e-3
"""Of XM430-W350; "about", says the vendor."""

HARDWARE_ERRORS: Final = {
    0: "input voltage out of range: check the supply, 12 V",
    2: "overheating: let it cool down",
    3: "encoder fault",
    4: "electrical shock or too little power: check supply and cables",
    5: "overload: it pushed too hard for too long",
}
"""By the bit of the hardware error register."""


MODELS: Final = {
    1000: "XH430-W350",
    1020: "XM430-W350",
    1060: "XL430-W250",
    1080: "XC430-W240",
    1160: "2XC430-W250",
}
"""By model number, those of the vendor's own software."""
WITHOUT_CURRENT_CONTROL: Final = {1060, 1080, 1160}
OPENMANIPULATOR_X_MODEL: Final = 1020


def angle(counts: int) -> float:
    """Angle of a joint [rad] from the position of its motor."""
    return (counts - CENTRE) * RAD_PER_COUNT


def counts_of_current(amperes: float) -> int:
    return round(amperes / A_PER_COUNT)


def hardware_error_text(value: int) -> str:
    """Meaning of the hardware error register."""
    names = [HARDWARE_ERRORS.get(bit, f"alarm bit {bit}") for bit in range(8) if value >> bit & 1]
    return "; ".join(names) if names else "none"
