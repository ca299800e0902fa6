"""Registers of the STS3215, and the units of what they hold.

Addresses, sizes and the sign bits of offset and velocity: the tables of huggingface/lerobot (motors/feetech/tables.py);
the sign bit of the load, and defaults: Feetech's memory table of the STS series. Signed words hold a magnitude and a
sign bit, not a two's complement.
"""

from typing import Final, NamedTuple

MODEL: Final = 777
EEPROM_END: Final = 40  # registers below survive a power cycle if they were written with `lock` at 0
END: Final = 87


class Register(NamedTuple):
    """A value of 1 or 2 bytes, little endian; `sign` is the number of its sign bit, None if it has none."""

    address: int
    size: int
    name: str
    initial: int = 0
    writable: bool = True
    sign: int | None = None

    def encode(self, value: int) -> bytes:
        """Raises OverflowError for a value that does not fit."""
        if self.sign is not None and value < 0:
            if -value >= 1 << self.sign:
                raise OverflowError(f"{self.name}: {value} does not fit")
            value = -value | 1 << self.sign
        return value.to_bytes(self.size, "little")

    def decode(self, data: bytes | bytearray) -> int:
        value = int.from_bytes(data[: self.size], "little")
        if self.sign is None:
            return value
        magnitude = value & ((1 << self.sign) - 1)
        return -magnitude if value >> self.sign & 1 else magnitude


REGISTERS: Final = (
    Register(0, 1, "firmware_major", 3, writable=False),
    Register(1, 1, "firmware_minor", 10, writable=False),
    Register(3, 2, "model", MODEL, writable=False),
    Register(5, 1, "id", 1),
    Register(6, 1, "baud_rate"),
    Register(7, 1, "return_delay", 250),
    Register(8, 1, "response_level", 1),
    Register(9, 2, "min_position"),
    Register(11, 2, "max_position", 4095),
    Register(13, 1, "max_temperature", 70),
    Register(14, 1, "max_voltage", 80),
    Register(15, 1, "min_voltage", 40),
    Register(16, 2, "max_torque", 1000),
    Register(18, 1, "phase", 12),
    Register(19, 1, "unloading_condition", 44),
    Register(20, 1, "led_condition", 47),
    Register(21, 1, "p_gain", 32),
    Register(22, 1, "d_gain", 32),
    Register(23, 1, "i_gain"),
    Register(24, 2, "startup_force", 16),
    Register(26, 1, "dead_zone_cw", 1),
    Register(27, 1, "dead_zone_ccw", 1),
    Register(28, 2, "protection_current", 500),
    Register(30, 1, "angular_resolution", 1),
    Register(31, 2, "homing_offset", sign=11),
    Register(33, 1, "mode"),
    Register(34, 1, "protective_torque", 20),
    Register(35, 1, "protection_time", 200),
    Register(36, 1, "overload_torque", 80),
    Register(37, 1, "velocity_p_gain", 10),
    Register(38, 1, "overcurrent_time", 200),
    Register(39, 1, "velocity_i_gain", 10),
    Register(40, 1, "torque_enable"),
    Register(41, 1, "acceleration"),
    Register(42, 2, "goal_position", 2048, sign=15),
    Register(44, 2, "goal_time"),
    Register(46, 2, "goal_velocity", sign=15),
    Register(48, 2, "torque_limit", 1000),
    Register(55, 1, "lock", 1),
    Register(56, 2, "position", 2048, writable=False, sign=15),
    Register(58, 2, "velocity", writable=False, sign=15),
    Register(60, 2, "load", writable=False, sign=10),
    Register(62, 1, "voltage", 74, writable=False),
    Register(63, 1, "temperature", 30, writable=False),
    Register(65, 1, "status", writable=False),
    Register(66, 1, "moving", writable=False),
    Register(69, 2, "current", writable=False, sign=15),
    Register(80, 1, "moving_velocity"),
    Register(84, 1, "maximum_velocity"),
    Register(85, 1, "maximum_acceleration", 254),
)
BY_NAME: Final = {register.name: register for register in REGISTERS}

MODEL_NUMBER: Final = BY_NAME["model"]
RETURN_DELAY: Final = BY_NAME["return_delay"]
MIN_POSITION: Final = BY_NAME["min_position"]
MAX_POSITION: Final = BY_NAME["max_position"]
P_GAIN: Final = BY_NAME["p_gain"]
MODE: Final = BY_NAME["mode"]
TORQUE_ENABLE: Final = BY_NAME["torque_enable"]
GOAL_POSITION: Final = BY_NAME["goal_position"]
TORQUE_LIMIT: Final = BY_NAME["torque_limit"]
LOCK: Final = BY_NAME["lock"]
POSITION: Final = BY_NAME["position"]

MODE_POSITION: Final = 0

ORDER_ADDRESS: Final = TORQUE_ENABLE.address
ORDER_SIZE: Final = 10  # torque, acceleration, goal, time, velocity and torque limit are contiguous: one write
PRESENT_ADDRESS: Final = POSITION.address
PRESENT_SIZE: Final = 15  # position to current: one read

FULL_LOAD: Final = 1000  # load and torque limit are shares of the full supply voltage in 0.1 %
A_PER_COUNT: Final = 6.5e-3
V_PER_COUNT: Final = 0.1
# Share of the supply voltage for a P gain of 1 and an error of 1 rad, measured with an oscilloscope on the STS3215:
# 0.166 (Rhoban/bam, feetech/actuator.py), 0.165 (kscalelabs/sysid, STS_3215_12V).
DUTY_PER_P_RAD: Final = 0.165

# By the value of the register, as LeRobot has them; delivered with 0.
BAUD_RATES: Final = (1_000_000, 500_000, 250_000, 128_000, 115_200, 57_600, 38_400, 19_200)
ERRORS: Final = {  # by the bit of the error byte
    1: "voltage",
    2: "angle sensor fault",
    4: "overheating: let it cool down",
    8: "overcurrent",
    32: "overload: it pushed too hard for too long",
}


class Present(NamedTuple):
    """Measurements of a servo: counts, counts per second, share of the full voltage in 0.1 %, 0.1 V, degrees Celsius,
    and the magnitude of the current in counts, whose sign firmware versions do not agree on."""

    position: int
    velocity: int
    load: int
    voltage: int
    temperature: int
    current: int


_VELOCITY, _LOAD, _CURRENT = (BY_NAME[name] for name in ("velocity", "load", "current"))


def present(data: bytes) -> Present:
    """From the 15 bytes at `PRESENT_ADDRESS`."""
    return Present(
        POSITION.decode(data[0:2]),
        _VELOCITY.decode(data[2:4]),
        _LOAD.decode(data[4:6]),
        data[6],
        data[7],
        abs(_CURRENT.decode(data[13:15])),
    )


def order(torque: bool, goal: int, limit: int) -> bytes:
    """The 10 bytes at `ORDER_ADDRESS` for a goal without a profile."""
    return bytes((int(torque), 0)) + GOAL_POSITION.encode(goal) + bytes(4) + TORQUE_LIMIT.encode(limit)


def error_text(error: int) -> str:
    """Meaning of the error byte."""
    return "; ".join(text for bit, text in ERRORS.items() if error & bit) or f"error {error}"
