"""One STS3215 servo: what requests do to its registers, and what its registers do to its motor.

A register below 40 that is written with `lock` at 1 keeps the value until the power goes off, as the vendor's memory
table says. Writes to what is only measured are ignored. Not emulated: velocity, PWM and step mode, D and I gain,
acceleration, backlash, reg write and action.

The motor: torque = stall * (duty * supply / rated supply - speed / speed without load), the duty being that of the P
control of `weberlink_arms.feetech.registers.DUTY_PER_P_RAD`, within the torque limit.
"""

from typing import Final, NamedTuple

from weberlink_arms.feetech import packet
from weberlink_arms.feetech.arm import NO_LOAD_RAD_S
from weberlink_arms.feetech.registers import (
    A_PER_COUNT,
    BY_NAME,
    DUTY_PER_P_RAD,
    EEPROM_END,
    END,
    FULL_LOAD,
    MODE_POSITION,
    MODEL,
    REGISTERS,
    V_PER_COUNT,
)
from weberlink_arms.servo.layout import CENTRE, COUNTS_PER_TURN, RAD_PER_COUNT
from weberlink_arms.servo.packet import PING, READ, SYNC_READ, WRITE, Packet, Status

STALL_A: Final = 2.7
FASTEST: Final = 3400  # steps per second of the inner goal when `goal_velocity` is 0
CENTRE_HERE: Final = 128  # written to `torque_enable`: the present position becomes 2048
_NAME_OF: Final = {register.address + i: register.name for register in REGISTERS for i in range(register.size)}


class MotorOrder(NamedTuple):
    """What the registers command the motor."""

    goal: float = 0.0  # from the middle of the turn [counts]
    fastest: float = 0.0  # of the inner goal [counts/s]
    gain: float = 0.0  # duty per error [1/count]
    most: float = 0.0  # largest duty, 0 to 1
    dead_zone: float = 0.0  # largest error without duty [counts]
    overload: float = 1.0  # duty from which on the servo protects itself after a time


OFF: Final = MotorOrder()


class EmulatedServo:
    """A servo with power, as delivered but for its id and range [counts]; `stall` is its torque [N m] at `rated` V."""

    def __init__(self, id_: int, least: int, largest: int, supply: float, stall: float, rated: float) -> None:
        self.memory = bytearray(END)
        self.heard_at = 0.0
        self.supply = supply
        self._stall, self._rated = stall, rated
        self.angle = 0.0  # from the middle of the turn, without the homing offset [rad]
        self.speed = 0.0  # [rad/s]
        self.duty = 0.0  # present one of the bridge, -1 to 1
        self._overloaded_for = 0.0
        self.overloaded = False
        for register in REGISTERS:
            self[register.name] = register.initial
        self["id"], self["min_position"], self["max_position"] = id_, least, largest
        self["max_voltage"] = round(1.1 * rated / V_PER_COUNT)
        self._saved = bytes(self.memory[:EEPROM_END])
        self._inner_goal = 0.0
        self._order = OFF
        self.restart(0.0)

    def __getitem__(self, name: str) -> int:
        register = BY_NAME[name]
        return register.decode(self.memory[register.address : register.address + register.size])

    def __setitem__(self, name: str, value: int) -> None:
        register = BY_NAME[name]
        self.memory[register.address : register.address + register.size] = register.encode(value)

    @property
    def id(self) -> int:
        return self.memory[5]

    @property
    def return_delay(self) -> float:
        """[s]"""
        return 2e-6 * self["return_delay"]

    @property
    def torque_on(self) -> bool:
        return self.memory[40] == 1

    @property
    def position(self) -> int:
        """What it measures [counts]."""
        return (CENTRE + round(self.angle / RAD_PER_COUNT) - self["homing_offset"]) % COUNTS_PER_TURN

    @property
    def error(self) -> int:
        """The error byte of its answers."""
        volts = round(self.supply / V_PER_COUNT)
        return (
            packet.VOLTAGE_ERROR * (not self["min_voltage"] <= volts <= self["max_voltage"])
            | packet.HEAT_ERROR * (self["temperature"] > self["max_temperature"])
            | packet.OVERLOAD_ERROR * self.overloaded
        )

    def restart(self, now: float) -> None:  # noqa: ARG002
        """Power cycle: what was saved is kept, everything else as delivered, the torque off."""
        for register in REGISTERS:
            if register.address >= EEPROM_END:
                self[register.name] = register.initial
        self.memory[:EEPROM_END] = self._saved
        self["torque_limit"] = self["max_torque"]
        self["goal_position"] = self.position
        self.overloaded, self._overloaded_for = False, 0.0
        self._inner_goal = self.angle / RAD_PER_COUNT
        self._steer()

    def rename(self, model: int) -> None:
        """Report another model; 0 for its own."""
        self["model"] = model or MODEL

    def overload(self) -> None:
        """Begin the servo's own protection."""
        self.overloaded = True
        self._steer()

    def write(self, address: int, data: bytes) -> int:
        """Takes what can be written; never an error."""
        was_on = self.torque_on
        for at, byte in enumerate(data, start=address):
            name = _NAME_OF.get(at)
            if name is not None and BY_NAME[name].writable:
                self.memory[at] = byte
        if address < EEPROM_END and not self["lock"]:
            self._saved = bytes(self.memory[:EEPROM_END])
        if address <= 40 < address + len(data):
            self._enabled(was_on)
        self._steer()
        return 0

    def _steer(self) -> None:
        """Update the order for the motor."""
        if not self.torque_on or self["mode"] != MODE_POSITION:
            self._order = OFF
            return
        share = self["protective_torque"] / 100.0 if self.overloaded else 1.0
        offset = self["homing_offset"]
        self._order = MotorOrder(
            goal=min(max(self["goal_position"], self["min_position"]), self["max_position"]) + offset - CENTRE,
            fastest=abs(self["goal_velocity"]) or FASTEST,
            gain=self["p_gain"] * DUTY_PER_P_RAD * RAD_PER_COUNT,
            most=min(share, min(self["torque_limit"], self["max_torque"]) / FULL_LOAD),
            dead_zone=self["dead_zone_cw"],
            overload=self["overload_torque"] / 100.0,
        )

    def _enabled(self, was_on: bool) -> None:
        if self.memory[40] == CENTRE_HERE:
            self["homing_offset"] = CENTRE + round(self.angle / RAD_PER_COUNT) - CENTRE
            self["torque_enable"] = int(was_on)
            self._saved = bytes(self.memory[:EEPROM_END])
        if not was_on:
            self._inner_goal = self.angle / RAD_PER_COUNT
        self.overloaded, self._overloaded_for = False, 0.0

    def hears(self, now: float) -> bool:  # noqa: ARG002 - always
        return True

    def answer(self, request: Packet, now: float) -> Status | None:  # noqa: ARG002
        """Carry out a request for this servo; None if it does not answer."""
        given = request.parameters
        if request.instruction in (READ, SYNC_READ) and len(given) == 2:
            self._measure()
            data = bytes(self.memory[given[0] : given[0] + given[1]])
            return Status(self.id, self.error, data.ljust(given[1], b"\0"))  # zeros where there are no registers
        if request.instruction == WRITE and len(given) >= 2:
            level = self["response_level"]
            self.write(given[0], given[1:])
            return Status(self.id, self.error) if level else None
        return Status(self.id, self.error) if request.instruction == PING else None

    def torque(self, step: float) -> float:
        """Torque of the motor during the next step [s], at the present angle and speed [N m]."""
        order = self._order
        if order is OFF:
            self.duty = 0.0
            return 0.0
        way = order.fastest * step
        self._inner_goal += min(max(order.goal - self._inner_goal, -way), way)
        error = self._inner_goal - self.angle / RAD_PER_COUNT
        self.duty = 0.0 if abs(error) <= order.dead_zone else min(max(order.gain * error, -order.most), order.most)
        # The servo's own protection: after a time of overload it pushes with the protective torque only.
        self._overloaded_for = self._overloaded_for + step if abs(self.duty) >= order.overload else 0.0
        if self._overloaded_for and self._overloaded_for >= 0.01 * self["protection_time"]:
            self.overload()
        return self._stall * (self.duty * self.supply / self._rated - self.speed / NO_LOAD_RAD_S)

    def _measure(self) -> None:
        current = self.duty * self.supply / self._rated - self.speed / NO_LOAD_RAD_S if self.torque_on else 0.0
        self["position"] = self.position
        self["velocity"] = round(self.speed / RAD_PER_COUNT)
        self["load"] = round(FULL_LOAD * self.duty)
        self["voltage"] = round(self.supply / V_PER_COUNT)
        self["status"] = self.error
        self["moving"] = int(abs(self.speed) > 0.02)
        self["current"] = round(abs(current) * STALL_A / A_PER_COUNT)
