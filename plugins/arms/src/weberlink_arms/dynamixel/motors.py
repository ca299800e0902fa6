"""The motors of an arm: set up for current or position control, watched while they run, and left in a safe state."""

from collections.abc import Sequence
from contextlib import suppress
from math import floor

from weberlink.hardware.fault import HardwareFault
from weberlink_arms.dynamixel import registers
from weberlink_arms.dynamixel.bus import MotorBus
from weberlink_arms.dynamixel.motor_models import MotorModel
from weberlink_arms.dynamixel.registers import NAMES, WITHOUT_CURRENT_CONTROL, Register
from weberlink_arms.servo.bus import Servos


class Motors(Servos[MotorBus]):
    """The motors of an arm, of these `models` in the order of the joints.

    A motor stops `watchdog_s` [s] after the last instruction. `current` is the largest one ever commanded, in the unit
    of the current registers [A]; `arm` is what they belong to, for messages; `reversible`: a motor may run in reverse.
    """

    TORQUE = registers.TORQUE_ENABLE
    KIND = "motor"

    def __init__(
        self,
        bus: MotorBus,
        watchdog_s: float,
        current: float,
        models: Sequence[MotorModel],
        arm: str,
        *,
        reversible: bool = False,
    ) -> None:
        super().__init__(bus)
        self._watchdog_s = watchdog_s
        self._watchdog = registers.watchdog_units(watchdog_s)
        self._models = tuple(models)
        self._arm, self._reversible = arm, reversible
        self._limits = [floor(current / each.a_per_count) if each.controls_current else 0 for each in self._models]
        self.current_limit = 0  # largest goal current that all of them accept [counts]

    def advice(self) -> str:
        volts = " and ".join(sorted({f"{each.volts:.0f} V" for each in self._models}, reverse=True))
        return f"the {volts} supply and the cable to the arm, then baud (57600 as motors are delivered) and ids"

    def find(self) -> None:
        """Check models, direction, supply and alarms too."""
        super().find()
        bus = self.bus
        for id_, model in zip(bus.ids, self._models, strict=True):
            # Alarms are ignored here, since a wrong model is reported before an alarm.
            number = int.from_bytes(bus.insist(lambda id_=id_: bus.ping(id_))[:2], "little")  # type: ignore[misc]
            self._check_model(id_, number, model)
            if not self._reversible and self.read(id_, registers.DRIVE_MODE) & registers.DRIVE_MODE_REVERSE:
                raise HardwareFault(f"{bus.label(id_)}: runs in reverse; clear bit 0 of its drive mode (register 10)")
            self._check_supply(id_, model)
        # Goal currents are bounded by what the motors accept; the least of a model holds for all of that model.
        accepted: dict[int, int] = {}
        for id_, model in zip(bus.ids, self._models, strict=True):
            if model.controls_current:
                limit = self.read(id_, registers.CURRENT_LIMIT)
                accepted[model.number] = min(limit, accepted.get(model.number, limit))
        self._limits = [
            min(accepted.get(model.number, 0), most) for model, most in zip(self._models, self._limits, strict=True)
        ]
        self.current_limit = min(accepted.values(), default=0)

    def _check_model(self, id_: int, number: int, model: MotorModel) -> None:
        if number == model.number:
            return
        name = NAMES.get(number, f"model {number}")
        lacks = model.controls_current and number in WITHOUT_CURRENT_CONTROL
        reason = ", which cannot control its current" if lacks else ""
        where = "" if len({each.number for each in self._models}) == 1 else " there"
        raise HardwareFault(
            f"{self.bus.label(id_)}: is a {name}{reason}; {self._arm} has {model.name}{where}: check ids"
        )

    def _check_supply(self, id_: int, model: MotorModel) -> None:
        volts = 0.1 * self.read(id_, registers.PRESENT_INPUT_VOLTAGE)
        low, high = (0.1 * self.read(id_, each) for each in (registers.MIN_VOLTAGE_LIMIT, registers.MAX_VOLTAGE_LIMIT))
        if not low <= volts <= high:
            raise HardwareFault(
                f"{self.bus.label(id_)}: has a supply of {volts:.1f} V and needs {low:.1f} to {high:.1f} V: "
                f"check the {model.volts:.0f} V supply"
            )

    def quicken(self) -> None:
        """Answer without the delay as delivered, 0.5 ms each; a motor whose setting differs is without torque then."""
        for id_ in self.bus.ids:
            self._set_eeprom(id_, registers.RETURN_DELAY_TIME, 0)

    def engage(self, goals: Sequence[int]) -> None:
        """Enable current control with these goals [counts]; raises as the bus does.

        A motor whose settings differ is without torque for the few milliseconds that it takes to change them.
        """
        for number, (id_, goal) in enumerate(zip(self.bus.ids, goals, strict=True)):
            self._prepare(id_, registers.MODE_CURRENT)
            # A change of mode sets the largest current as the goal, so it must be overwritten before torque is on.
            self.write(id_, registers.GOAL_CURRENT, goal)
            self.write(id_, registers.TORQUE_ENABLE, 1)
            self.command(goals[: number + 1])  # feeds the watchdogs of the motors before it

    def engage_positions(self, gains: Sequence[int | None]) -> None:
        """Hold every motor where it is by its position control, which its goal current limits if it has one.

        `gains` are those of the position error (register 84) of each motor; None for that as delivered.
        """
        goals: list[int] = []
        for id_, model, limit, gain in zip(self.bus.ids, self._models, self._limits, gains, strict=True):
            current = model.controls_current
            self._prepare(id_, registers.MODE_CURRENT_BASED_POSITION if current else registers.MODE_EXTENDED_POSITION)
            if current:
                self.write(id_, registers.GOAL_CURRENT, limit)
            if gain is not None:
                self.write(id_, registers.POSITION_P_GAIN, gain)
            goals.append(self.read(id_, registers.PRESENT_POSITION))
            self.write(id_, registers.GOAL_POSITION, goals[-1])
            self.write(id_, registers.TORQUE_ENABLE, 1)
            self.go(goals)

    def _prepare(self, id_: int, mode: int) -> None:
        """Settings that both kinds of control need, and the bus watchdog."""
        if self.read(id_, registers.BUS_WATCHDOG) == registers.WATCHDOG_TRIPPED:
            self.write(id_, registers.BUS_WATCHDOG, 0)
        self._set_eeprom(id_, registers.OPERATING_MODE, mode)
        self.write(id_, registers.BUS_WATCHDOG, self._watchdog)

    def _set_eeprom(self, id_: int, register: Register, value: int) -> None:
        """Write only if it differs: EEPROM wears out, and can be written with the torque off only."""
        if self.read(id_, register) != value:
            self.write(id_, registers.TORQUE_ENABLE, 0)
            self.write(id_, register, value)

    def command(self, goals: Sequence[int]) -> None:
        """Set goal currents [counts] from joint 1 on, limited to what the motors accept and may have."""
        motors = zip(self.bus.ids, goals, self._limits, strict=False)
        self.bus.sync_write(
            registers.GOAL_CURRENT, [(id_, min(max(goal, -limit), limit)) for id_, goal, limit in motors]
        )

    def go(self, goals: Sequence[int]) -> None:
        """Set goal positions [counts] from joint 1 on."""
        self.bus.sync_write(registers.GOAL_POSITION, list(zip(self.bus.ids, goals, strict=False)))

    def slept(self, now: float) -> bool:
        """Whether the bus was silent, now or since `watch_all`, long enough for a watchdog to trip."""
        return max(self.bus.silence, now - self.bus.sent_at) >= self._watchdog_s

    def watch(self) -> None:
        """Check torque or watchdog of one motor, in turn, since its measurements do not show them; HardwareFault if its
        watchdog has tripped, or it was without power.
        """
        count = len(self.bus.ids)
        number, self._next = self._next, (self._next + 1) % (2 * count)
        turn, index = divmod(number, count)
        id_ = self.bus.ids[index]
        if (turn + index) % 2:
            self._check_watchdog(id_)
        else:
            self.check_torque(id_)

    def watch_all(self) -> None:
        """As `watch`, for all motors at once."""
        self.bus.silence = 0.0
        for id_ in self.bus.ids:
            self._check_watchdog(id_)
            self.check_torque(id_)

    def _check_watchdog(self, id_: int) -> None:
        if self.bus.read(id_, registers.BUS_WATCHDOG) == registers.WATCHDOG_TRIPPED:
            raise HardwareFault(
                f"{self.bus.label(id_)}: its bus watchdog tripped: it heard nothing for "
                f"{self._watchdog * registers.WATCHDOG_UNIT_S * 1e3:.0f} ms and went limp"
            )

    def leave(self, hold: bool) -> None:
        """Hold the arm by the motors' own position control, or let it go limp; never raises.

        A motor that holds has no watchdog; only its goal current limits it, to the largest one ever commanded. The
        watchdog would end the hold at once, and with a homing offset a motor has been seen to run away when its
        watchdog tripped in a multi-turn mode (ROBOTIS-GIT/DynamixelSDK, issue 584).

        The change of mode takes a few milliseconds without torque. The watchdog is off only while the torque is off or
        the motor holds, so a motor that stops answering, or whose host is killed meanwhile, goes limp, is limp, or
        holds within the limit.
        """
        for id_, limit in zip(self.bus.ids, self._limits, strict=True):
            # A motor with an alarm is limp already, and must not prevent the others from holding.
            with suppress(HardwareFault):
                position = self.bus.read(id_, registers.PRESENT_POSITION)
                self.write(id_, registers.TORQUE_ENABLE, 0)
                self.write(id_, registers.BUS_WATCHDOG, 0)
                if hold:
                    self.write(id_, registers.OPERATING_MODE, registers.MODE_CURRENT_BASED_POSITION)
                    self.write(id_, registers.GOAL_CURRENT, limit)
                    self.write(id_, registers.GOAL_POSITION, position)
                    self.write(id_, registers.TORQUE_ENABLE, 1)

    def release(self) -> None:
        """Let the arm go limp, motors with an alarm that keeps their torque on included; never raises."""
        with suppress(HardwareFault):
            self.bus.sync_write(registers.TORQUE_ENABLE, [(id_, 0) for id_ in self.bus.ids])
        self.leave(hold=False)

    def stay(self, goals: Sequence[int] | None) -> None:
        """Let position control hold the arm at these goals without a bus watchdog; never raises.

        A motor whose watchdog has tripped holds where it is now, as all do if goals are not known.
        """
        for number, (id_, model, limit) in enumerate(zip(self.bus.ids, self._models, self._limits, strict=True)):
            # A motor with an alarm is limp already, and must not prevent the others from holding.
            with suppress(HardwareFault):
                is_tripped = self.read(id_, registers.BUS_WATCHDOG) == registers.WATCHDOG_TRIPPED
                goal = self.read(id_, registers.PRESENT_POSITION) if goals is None or is_tripped else goals[number]
                self.write(id_, registers.BUS_WATCHDOG, 0)
                self.write(id_, registers.GOAL_POSITION, goal)
                if model.controls_current:  # that of a motor whose watchdog has tripped may be 0
                    self.write(id_, registers.GOAL_CURRENT, limit)
