"""The control table of an XM430-W350: addresses, sizes, access, initial values, ranges, units and alarms.

Those of other models differ in initial values and ranges, see `weberlink_arms.dynamixel.motor_models`.

Source: ROBOTIS e-Manual, XM430-W350, "Control Table of EEPROM Area" and "of RAM Area", and "Bus Watchdog". Registers
below 64 are EEPROM: writable only with the torque off. Indirect addressing (168 and above) is left out.
"""

from math import ceil, pi
from typing import Final, NamedTuple

EEPROM_END: Final = 64
END: Final = 147
ANY_16: Final = 0x7FFF  # range of a goal that only another register limits
ANY_32: Final = 0x7FFF_FFFF
FIRMWARE: Final = 45  # new enough for all functions used here (bus watchdog from 38, clear from 42)


class Register(NamedTuple):
    """One register; signed if `low` is below 0. `low` and `high` are the range that the manual states."""

    address: int
    size: int
    name: str
    writable: bool
    initial: int
    low: int
    high: int

    @property
    def signed(self) -> bool:
        return self.low < 0

    def encode(self, value: int) -> bytes:
        """Raises OverflowError for a value that does not fit."""
        return value.to_bytes(self.size, "little", signed=self.low < 0)

    def decode(self, data: bytes | bytearray) -> int:
        return int.from_bytes(data, "little", signed=self.low < 0)


def _measured(address: int, size: int, name: str, initial: int = 0, *, signed: bool = False) -> Register:
    low = -(1 << (8 * size - 1)) if signed else 0
    return Register(address, size, name, False, initial, low, (1 << (8 * size - (1 if signed else 0))) - 1)


def _setting(address: int, size: int, name: str, initial: int, low: int, high: int) -> Register:
    return Register(address, size, name, True, initial, low, high)


REGISTERS: Final = (
    _measured(0, 2, "model_number", 1020),
    _measured(2, 4, "model_information"),
    _measured(6, 1, "firmware_version", FIRMWARE),
    _setting(7, 1, "id", 1, 0, 252),
    _setting(8, 1, "baud_rate", 1, 0, 7),
    _setting(9, 1, "return_delay_time", 250, 0, 254),
    _setting(10, 1, "drive_mode", 0, 0, 5),
    _setting(11, 1, "operating_mode", 3, 0, 16),
    _setting(12, 1, "secondary_id", 255, 0, 255),
    _setting(13, 1, "protocol_version", 2, 1, 2),
    _setting(20, 4, "homing_offset", 0, -1_044_479, 1_044_479),
    _setting(24, 4, "moving_threshold", 10, 0, 1023),
    _setting(31, 1, "temperature_limit", 80, 0, 100),
    _setting(32, 2, "max_voltage_limit", 160, 95, 160),
    _setting(34, 2, "min_voltage_limit", 95, 95, 160),
    _setting(36, 2, "pwm_limit", 885, 0, 885),
    _setting(38, 2, "current_limit", 1193, 0, 1193),
    _setting(40, 4, "acceleration_limit", 32_767, 0, 32_767),
    _setting(44, 4, "velocity_limit", 350, 0, 1023),
    _setting(48, 4, "max_position_limit", 4095, 0, 4095),
    _setting(52, 4, "min_position_limit", 0, 0, 4095),
    _setting(63, 1, "shutdown", 52, 0, 255),
    _setting(64, 1, "torque_enable", 0, 0, 1),
    _setting(65, 1, "led", 0, 0, 1),
    _setting(68, 1, "status_return_level", 2, 0, 2),
    _measured(69, 1, "registered_instruction"),
    _measured(70, 1, "hardware_error_status"),
    _setting(76, 2, "velocity_i_gain", 1920, 0, 16_383),
    _setting(78, 2, "velocity_p_gain", 100, 0, 16_383),
    _setting(80, 2, "position_d_gain", 0, 0, 16_383),
    _setting(82, 2, "position_i_gain", 0, 0, 16_383),
    _setting(84, 2, "position_p_gain", 800, 0, 16_383),
    _setting(88, 2, "feedforward_2nd_gain", 0, 0, 16_383),
    _setting(90, 2, "feedforward_1st_gain", 0, 0, 16_383),
    _setting(98, 1, "bus_watchdog", 0, -1, 127),
    _setting(100, 2, "goal_pwm", 885, -ANY_16, ANY_16),
    _setting(102, 2, "goal_current", 0, -ANY_16, ANY_16),
    _setting(104, 4, "goal_velocity", 0, -ANY_32, ANY_32),
    _setting(108, 4, "profile_acceleration", 0, 0, 32_767),
    _setting(112, 4, "profile_velocity", 0, 0, 32_767),
    _setting(116, 4, "goal_position", 0, -1_048_575, 1_048_575),
    _measured(120, 2, "realtime_tick"),
    _measured(122, 1, "moving"),
    _measured(123, 1, "moving_status"),
    _measured(124, 2, "present_pwm", signed=True),
    _measured(126, 2, "present_current", signed=True),
    _measured(128, 4, "present_velocity", signed=True),
    _measured(132, 4, "present_position", signed=True),
    _measured(136, 4, "velocity_trajectory", signed=True),
    _measured(140, 4, "position_trajectory", signed=True),
    _measured(144, 2, "present_input_voltage", 120),
    _measured(146, 1, "present_temperature", 30),
)
BY_NAME: Final = {register.name: register for register in REGISTERS}

RETURN_DELAY_TIME: Final = BY_NAME["return_delay_time"]
DRIVE_MODE: Final = BY_NAME["drive_mode"]
OPERATING_MODE: Final = BY_NAME["operating_mode"]
MAX_VOLTAGE_LIMIT: Final = BY_NAME["max_voltage_limit"]
MIN_VOLTAGE_LIMIT: Final = BY_NAME["min_voltage_limit"]
CURRENT_LIMIT: Final = BY_NAME["current_limit"]
TORQUE_ENABLE: Final = BY_NAME["torque_enable"]
HARDWARE_ERROR: Final = BY_NAME["hardware_error_status"]
POSITION_P_GAIN: Final = BY_NAME["position_p_gain"]
BUS_WATCHDOG: Final = BY_NAME["bus_watchdog"]
GOAL_CURRENT: Final = BY_NAME["goal_current"]
GOAL_POSITION: Final = BY_NAME["goal_position"]
PRESENT_CURRENT: Final = BY_NAME["present_current"]
PRESENT_POSITION: Final = BY_NAME["present_position"]
PRESENT_INPUT_VOLTAGE: Final = BY_NAME["present_input_voltage"]

PRESENT_ADDRESS: Final = PRESENT_CURRENT.address
PRESENT_SIZE: Final = 10  # current, velocity and position are contiguous: one read

MODE_CURRENT: Final = 0
MODE_POSITION: Final = 3
MODE_EXTENDED_POSITION: Final = 4
MODE_CURRENT_BASED_POSITION: Final = 5

DRIVE_MODE_REVERSE: Final = 0x01  # bit of the drive mode: position, velocity and current have the opposite sign
WATCHDOG_TRIPPED: Final = -1  # read from the bus watchdog: goals are read-only until 0 is written to it
WATCHDOG_UNIT_S: Final = 0.020
WATCHDOG_MOST: Final = 127
# By the value of the register [bit/s]; delivered with 1.
BAUD_RATES: Final = (9_600, 57_600, 115_200, 1_000_000, 2_000_000, 3_000_000, 4_000_000, 4_500_000)
RAD_S_PER_COUNT: Final = 0.229 * 2.0 * pi / 60.0
A_PER_COUNT: Final = 2.69e-3  # of XM430-W350; "about", says the vendor

VOLTAGE_ERROR: Final = 0x01
HARDWARE_ERRORS: Final = {  # by the bit of the hardware error register
    0: "input voltage out of range: check the supply",
    2: "overheating: let it cool down",
    3: "encoder fault",
    4: "electrical shock or too little power: check supply and cables",
    5: "overload: it pushed too hard for too long",
}
NAMES: Final = {  # by model number, those of the vendor's own software
    1000: "XH430-W350",
    1020: "XM430-W350",
    1060: "XL430-W250",
    1070: "XC430-W150",
    1080: "XC430-W240",
    1160: "2XC430-W250",
    1190: "XL330-M077",
    1200: "XL330-M288",
}
WITHOUT_CURRENT_CONTROL: Final = {1060, 1070, 1080, 1160}


def watchdog_units(watchdog_s: float) -> int:
    """Register value of a bus watchdog of at least this time [s]."""
    return min(max(1, ceil(watchdog_s / WATCHDOG_UNIT_S - 1e-9)), WATCHDOG_MOST)


def counts_of_current(amperes: float) -> int:
    return round(amperes / A_PER_COUNT)


def hardware_error_text(value: int) -> str:
    """Meaning of the hardware error register."""
    return "; ".join(HARDWARE_ERRORS.get(bit, f"alarm bit {bit}") for bit in range(8) if value >> bit & 1) or "none"
