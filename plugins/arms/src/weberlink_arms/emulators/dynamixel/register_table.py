"""The memory of one servo, and the rules for reading and writing it."""

from weberlink_arms.dynamixel.motor_models import MotorModel
from weberlink_arms.dynamixel.packet import (
    ACCESS_ERROR,
    DATA_LENGTH_ERROR,
    DATA_LIMIT_ERROR,
    DATA_RANGE_ERROR,
    RESULT_FAIL,
)
from weberlink_arms.dynamixel.registers import EEPROM_END, END, MODE_POSITION, Register

# Goals and the registers that limit their magnitude.
LIMITS = {"goal_current": "current_limit", "goal_velocity": "velocity_limit", "goal_pwm": "pwm_limit"}


class RegisterTable:
    """Registers of a model as delivered; `memory` holds the bytes at all addresses."""

    def __init__(self, model: MotorModel) -> None:
        self._model = model
        self._by_name = {register.name: register for register in model.registers}
        self._by_address = {register.address: register for register in model.registers}
        self._defined = frozenset(each.address + offset for each in model.registers for offset in range(each.size))
        self.memory = bytearray(END)
        for register in model.registers:
            self[register.name] = register.initial

    def __getitem__(self, name: str) -> int:
        """The value of a register; 0 for one that the model lacks."""
        register = self._by_name.get(name)
        if register is None:
            return 0
        return register.decode(self.memory[register.address : register.address + register.size])

    def __setitem__(self, name: str, value: int) -> None:
        """Values that do not fit are limited; no effect for a register that the model lacks."""
        register = self._by_name.get(name)
        if register is None:
            return
        bits = 8 * register.size - register.signed
        low, high = -(1 << bits) if register.signed else 0, (1 << bits) - 1
        self.memory[register.address : register.address + register.size] = register.encode(min(high, max(low, value)))

    def unreadable(self, address: int, size: int) -> int:
        """Error number for a read of these addresses; 0 if it is allowed."""
        return 0 if size > 0 and self._has(address, size) else ACCESS_ERROR

    def unwritable(self, address: int, data: bytes) -> int:
        """Error number for a write of these bytes; 0 if it is allowed."""
        if not data or not self._has(address, len(data)):
            return ACCESS_ERROR
        at = 0
        errors = []
        while at < len(data):
            register = self._by_address.get(address + at)
            if register is None or at + register.size > len(data):
                return DATA_LENGTH_ERROR
            errors.append(self._refusal(register, register.decode(data[at : at + register.size])))
            at += register.size
        return next(filter(None, errors), 0)

    def _refusal(self, register: Register, value: int) -> int:
        """Error number for a value of a register; 0 if it is allowed."""
        name = register.name
        if not register.writable or (register.address < EEPROM_END and self["torque_enable"]):
            return ACCESS_ERROR
        if not register.low <= value <= register.high or (name == "operating_mode" and value not in self._model.modes):
            return DATA_RANGE_ERROR
        if name in LIMITS or name == "goal_position":
            return DATA_RANGE_ERROR if self["bus_watchdog"] < 0 else self._beyond(name, value)
        if name == "bus_watchdog" and (value < 0 or (self[name] < 0 and value != 0)):
            return DATA_RANGE_ERROR
        if name == "torque_enable" and value and self["hardware_error_status"] & self["shutdown"]:
            return RESULT_FAIL
        return 0

    def _beyond(self, goal: str, value: int) -> int:
        """Error number for a goal beyond the registers that limit it."""
        if goal != "goal_position":
            return DATA_LIMIT_ERROR if abs(value) > self[LIMITS[goal]] else 0
        if self["operating_mode"] != MODE_POSITION:
            return 0
        return 0 if self["min_position_limit"] <= value <= self["max_position_limit"] else DATA_LIMIT_ERROR

    def _has(self, address: int, size: int) -> bool:
        return address + size <= END and self._defined.issuperset(range(address, address + size))
