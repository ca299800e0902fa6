"""One servo: what instructions do to its registers, and what its registers do to its motor.

Where the manual is silent, the stricter of the plausible behaviours is taken: goals written while the torque is off are
kept, and a tripped bus watchdog accepts nothing but 0. Not emulated: velocity and PWM mode (refused as out of range),
profiles, indirect addressing, shadow id, factory reset, clear, reg write.

The motor is described by the manual: stall torque and current, and speed without load. Torque is proportional to the
current of the motor by the ratio of the first two; losses are part of the friction of the joint. What the registers of
the current say of it is the law of the model, see `weberlink_arms.dynamixel.motor_models`.
"""

from collections.abc import Callable
from math import inf
from struct import Struct
from typing import NamedTuple

from weberlink_arms.dynamixel.motor_models import FULL_DUTY, XM430_W350, CurrentLaw, MotorModel
from weberlink_arms.dynamixel.packet import ALERT, DATA_LENGTH_ERROR, INSTRUCTION_ERROR
from weberlink_arms.dynamixel.registers import (
    ANY_16,
    BAUD_RATES,
    BY_NAME,
    EEPROM_END,
    MODE_CURRENT,
    MODE_CURRENT_BASED_POSITION,
    MODE_POSITION,
    RAD_S_PER_COUNT,
    VOLTAGE_ERROR,
    WATCHDOG_MOST,
    WATCHDOG_UNIT_S,
)
from weberlink_arms.emulators.dynamixel.register_table import RegisterTable
from weberlink_arms.servo.layout import CENTRE, COUNTS_PER_TURN, RAD_PER_COUNT
from weberlink_arms.servo.packet import PING, READ, REBOOT, SYNC_READ, WRITE, Packet, Status

OFFSET_MOST = 1024  # largest homing offset that has an effect in position control
PRESENT = BY_NAME["realtime_tick"].address  # measurements begin here
ID, TORQUE_ENABLE, BUS_WATCHDOG = (BY_NAME[name].address for name in ("id", "torque_enable", "bus_watchdog"))
# Real-time tick, moving, its status, PWM, current, velocity, position, and both trajectories.
MEASUREMENTS = Struct("<HBBhhiiii")
READING = (READ, SYNC_READ)
REBOOT_S = 0.2  # without answers after a reboot; a guess, since the manual does not state it


class MotorOrder(NamedTuple):
    """What the registers command the motor."""

    on: bool = False  # torque enabled
    current: float | None = None  # goal [A]; None for position control
    goal: float = 0.0  # angle [rad]
    gain: float = 0.0  # duty per error of angle [1/rad]
    duty: float = 1.0  # largest one, 0 to 1
    limit: float = inf  # of the current [A]


OFF = MotorOrder()


def amperes(order: MotorOrder, angle: float, velocity: float, model: MotorModel = XM430_W350) -> float:
    """The current of the motor [A] at an angle [rad] and a speed [rad/s].

    The supply bounds it to stall current (d - speed / no-load speed) at a duty d. Position control sets the duty in
    proportion to the error; its integral and derivative parts and the profiles are not emulated. In mode 5 the current
    is limited as well.
    """
    if not order.on:
        return 0.0
    stall = model.stall_a
    back = stall * velocity / model.no_load_rad_s
    if order.current is not None:
        wanted = order.current
        top, bottom = stall * order.duty - back, -stall * order.duty - back
    else:
        duty = min(order.duty, max(-order.duty, order.gain * (order.goal - angle)))
        wanted = stall * duty - back
        top, bottom = order.limit, -order.limit
    return min(top, max(bottom, wanted))


class Measured(NamedTuple):
    """Sensor values: angle [rad] from the middle of the turn, speed [rad/s], current of the motor [A]."""

    angle: float
    velocity: float
    current: float


class Servo:
    """A servo with power, as delivered but for its id and rate, one of `BAUD_RATES`.

    `law` is what its registers of the current mean; that of the model if None.
    """

    def __init__(
        self,
        id_: int,
        measured: Callable[[], Measured],
        *,
        baud: int = 57_600,
        model: MotorModel = XM430_W350,
        law: CurrentLaw | None = None,
    ) -> None:
        self._measured = measured
        self.model = model
        self._law = model.law if law is None else law
        self.registers = RegisterTable(model)
        self.registers["id"] = id_
        self.registers["baud_rate"] = BAUD_RATES.index(baud)
        self._turns = 0
        self._sign, self._middle = 1, CENTRE
        self._deaf_until = -inf
        self.heard_at = 0.0  # when the last instruction for it ended [s]
        self.drive = OFF  # the present order for its motor
        self.watchdog_trips = 0
        self._start()

    @property
    def id(self) -> int:
        return self.registers.memory[ID]

    @property
    def return_delay(self) -> float:
        """[s]"""
        return 2e-6 * self.registers["return_delay_time"]

    @property
    def torque_on(self) -> bool:
        return self.registers.memory[TORQUE_ENABLE] != 0

    @property
    def deadline(self) -> float:
        """When the bus watchdog trips without an instruction [s]; infinity for never."""
        memory = self.registers.memory
        limit = memory[BUS_WATCHDOG]
        if memory[TORQUE_ENABLE] and 0 < limit <= WATCHDOG_MOST:
            return self.heard_at + WATCHDOG_UNIT_S * limit
        return inf

    def hears(self, now: float) -> bool:
        """False while it reboots."""
        return now >= self._deaf_until

    def answer(self, packet: Packet, now: float) -> Status | None:
        """Carry out an instruction for this servo; None if it does not answer."""
        if packet.instruction == REBOOT:
            status = self.status(REBOOT, 0)
            self.restart(now)
            return status
        if packet.instruction == PING:
            return self.status(PING, 0, bytes(self.registers.memory[0:2] + self.registers.memory[6:7]))
        if packet.instruction in READING:
            if len(packet.parameters) != 4:
                return self.status(READ, DATA_LENGTH_ERROR)
            return self.status(READ, *self.read(word(packet.parameters, 0), word(packet.parameters, 2)))
        error, given = INSTRUCTION_ERROR, packet.parameters
        if packet.instruction == WRITE:
            error = DATA_LENGTH_ERROR if len(given) < 3 else self.write(word(given, 0), given[2:])
        return self.status(packet.instruction, error)

    def status(self, instruction: int, error: int, data: bytes = b"") -> Status | None:
        """The answer to an instruction; None if the status return level suppresses it."""
        level = self.registers["status_return_level"]
        if instruction != PING and level < (1 if instruction in READING else 2):
            return None
        alert = ALERT if self.registers["hardware_error_status"] else 0
        return Status(self.id, error | alert, data)

    def read(self, address: int, size: int) -> tuple[int, bytes]:
        """Error number, and the bytes if it is 0."""
        error = self.registers.unreadable(address, size)
        if error:
            return error, b""
        if address + size > PRESENT:
            self._measure()
        return 0, bytes(self.registers.memory[address : address + size])

    def write(self, address: int, data: bytes) -> int:
        """Write all of it or nothing; returns the error number."""
        registers = self.registers
        error = registers.unwritable(address, data)
        if error:
            return error
        mode, was_on = registers["operating_mode"], self.torque_on
        registers.memory[address : address + len(data)] = data
        self._orient()
        if registers["operating_mode"] != mode:
            self._change_mode()
        if self.torque_on and not was_on and mode == MODE_POSITION:
            self._forget_turns()
        self._steer()
        return 0

    def watch(self, now: float) -> None:
        """Trip the bus watchdog if its deadline has passed."""
        if now >= self.deadline:
            self.trip()

    def trip(self) -> None:
        """Stop and refuse goals, as the bus watchdog does; no effect with the torque off, as the manual says."""
        if not self.torque_on:
            return
        self.watchdog_trips += 1
        registers = self.registers
        registers["bus_watchdog"] = -1
        registers["goal_current"] = registers["goal_velocity"] = 0
        registers["goal_position"] = self._position(self._measured().angle)
        self._steer()

    def alarm(self, bits: int) -> None:
        """Latch a hardware error; one that the register `shutdown` names takes the torque off."""
        self.registers["hardware_error_status"] |= bits
        if bits & self.registers["shutdown"]:
            self.registers["torque_enable"] = 0
            self._steer()

    def restart(self, now: float) -> None:
        """As a power cycle: RAM as delivered, EEPROM kept, alarms cleared."""
        for register in self.model.registers:
            if register.address >= EEPROM_END:
                self.registers[register.name] = register.initial
        self._deaf_until = now + REBOOT_S
        self._start()

    def lose_supply(self) -> None:
        """The supply falls below the limit: half a volt less, and the alarm of the input voltage."""
        self.registers["present_input_voltage"] = self.registers["min_voltage_limit"] - 5
        self.alarm(VOLTAGE_ERROR)

    def rename(self, model: int) -> None:
        """Report another model; 0 for its own."""
        self.registers["model_number"] = model or self.model.number

    def _start(self) -> None:
        """After power on: the position is within one turn, and is the goal."""
        registers = self.registers
        self._forget_turns()
        registers["goal_pwm"] = registers["pwm_limit"]
        registers["goal_position"] = self._position(self._measured().angle)
        if registers["operating_mode"] == MODE_CURRENT_BASED_POSITION:
            registers["goal_current"] = registers["current_limit"]
        self._steer()

    def _change_mode(self) -> None:
        """Reset gains, profile and goals, as the manual says for a change of mode."""
        registers = self.registers
        for register in self.model.registers:
            if register.name.endswith("_gain") or register.name.startswith("profile_"):
                registers[register.name] = register.initial
        registers["goal_pwm"] = registers["pwm_limit"]
        registers["goal_current"] = registers["current_limit"]
        registers["goal_velocity"] = 0
        if registers["operating_mode"] == MODE_POSITION:
            self._forget_turns()
        registers["goal_position"] = self._position(self._measured().angle)

    def _forget_turns(self) -> None:
        """Restart multi-turn counting."""
        self._turns = (round(self._measured().angle / RAD_PER_COUNT) + CENTRE) // COUNTS_PER_TURN

    def _orient(self) -> None:
        """Update the sign of positions and the middle of the turn."""
        self._sign = -1 if self.registers["drive_mode"] & 1 else 1
        offset = self.registers["homing_offset"]
        ignored = self.registers["operating_mode"] == MODE_POSITION and abs(offset) > OFFSET_MOST
        self._middle = CENTRE + (0 if ignored else offset)

    def _position(self, angle: float) -> int:
        """Register value of an angle [rad]."""
        return self._sign * (round(angle / RAD_PER_COUNT) - COUNTS_PER_TURN * self._turns) + self._middle

    def _angle(self, position: int) -> float:
        """Angle [rad] of a register value."""
        return (self._sign * (position - self._middle) + COUNTS_PER_TURN * self._turns) * RAD_PER_COUNT

    def _steer(self) -> None:
        """Update the order for the motor."""
        registers = self.registers
        if not self.torque_on:
            self.drive = OFF
            return
        mode, current = registers["operating_mode"], self.model.motor_current(registers["goal_current"], self._law)
        duty = abs(registers["goal_pwm"]) / FULL_DUTY
        if mode == MODE_CURRENT:
            self.drive = MotorOrder(True, current=self._sign * current, duty=duty)
            return
        gain = self.model.duty_per_rad(registers["position_p_gain"])
        limit = abs(current) if mode == MODE_CURRENT_BASED_POSITION else inf
        self.drive = MotorOrder(True, goal=self._angle(registers["goal_position"]), gain=gain, duty=duty, limit=limit)

    def _measure(self) -> None:
        """Update the registers of measurements."""
        registers, sign, model = self.registers, self._sign, self.model
        angle, velocity, current = self._measured()
        duty = current / model.stall_a + velocity / model.no_load_rad_s
        speed = sign * round(velocity / RAD_S_PER_COUNT)
        MEASUREMENTS.pack_into(
            registers.memory,
            PRESENT,
            int(self.heard_at * 1e3) % 32_768,
            int(abs(speed) > registers["moving_threshold"]),
            0,
            sign * _bounded(FULL_DUTY * duty, FULL_DUTY),
            sign * _bounded(model.register_current(current, self._law), ANY_16),
            speed,
            self._position(angle),
            0,
            registers["goal_position"],
        )


def _bounded(value: float, most: int) -> int:
    return round(min(most, max(-most, value)))


def word(data: bytes, at: int) -> int:
    """Two bytes, little endian."""
    return data[at] | data[at + 1] << 8
