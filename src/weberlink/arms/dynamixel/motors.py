"""The four motors: set up for current control, watched while they run, and left in a safe state."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from math import ceil, floor
from typing import Final, TypeVar

from weberlink.arms.dynamixel import registers
from weberlink.arms.dynamixel.bus import MotorBus, MotorReading
from weberlink.arms.dynamixel.registers import (
    MODELS,
    OPENMANIPULATOR_X_MODEL,
    WITHOUT_CURRENT_CONTROL,
    Register,
)
from weberlink.hardware.fault import BadReply, HardwareFault

TRIES: Final = 12
"""At opening, where a late answer must not be fatal; together longer than a pause of a busy host."""

MotorReply = TypeVar("MotorReply")


def watchdog_units(watchdog_s: float) -> int:
    """Register value of a bus watchdog of at least this time [s]."""
    return min(max(1, ceil(watchdog_s / registers.WATCHDOG_UNIT_S - 1e-9)), registers.WATCHDOG_MOST)


class Motors:
    """The motors of the arm.

    Args:
        bus: With their ids in the order of the joints.
        baud: Its rate [bit/s], for error messages.
        watchdog_s: Time without instructions after which a motor stops [s].
        current: Largest one ever commanded [A].
    """

    def __init__(self, bus: MotorBus, baud: int, watchdog_s: float, current: float) -> None:
        self._bus = bus
        self._baud = baud
        self._watchdog_s = watchdog_s
        self._watchdog = watchdog_units(watchdog_s)
        self._most = floor(current / registers.A_PER_COUNT)
        self._next = 0
        self.current_limit = 0
        """Largest goal current that all of them accept [counts]."""

    def find(self) -> None:
        """Check models, direction and alarms; raises HardwareFault with what to check."""
        bus = self._bus
        models = {id_: self._found(id_) for id_ in bus.ids}
        missing = [bus.label(id_) for id_, model in models.items() if model is None]
        if len(missing) == len(models):
            raise HardwareFault(
                f"{bus.path}: no motor answers at {self._baud} bit/s: check the 12 V supply and the cable to the arm, "
                "then baud (57600 as motors are delivered) and ids"
            )
        if missing:
            raise HardwareFault(
                f"{', '.join(missing)}: no answer at {self._baud} bit/s, but others answer: check the cable to it, "
                "its id and its baud rate"
            )
        for id_, number in models.items():
            self._check_model(id_, number or 0)
            if self._read(id_, registers.DRIVE_MODE) & registers.DRIVE_MODE_REVERSE:
                raise HardwareFault(f"{bus.label(id_)}: runs in reverse; clear bit 0 of its drive mode (register 10)")
        self.current_limit = min(self._read(id_, registers.CURRENT_LIMIT) for id_ in bus.ids)

    def _found(self, id_: int) -> int | None:
        try:
            return self._insist(lambda: self._bus.ping(id_))
        except BadReply:
            return None

    def _check_model(self, id_: int, number: int) -> None:
        if number == OPENMANIPULATOR_X_MODEL:
            return
        wanted, name = MODELS[OPENMANIPULATOR_X_MODEL], MODELS.get(number, f"model {number}")
        reason = ", which cannot control its current" if number in WITHOUT_CURRENT_CONTROL else ""
        raise HardwareFault(
            f"{self._bus.label(id_)}: is a {name}{reason}; an OpenMANIPULATOR-X has {wanted}: check ids"
        )

    def engage(self, goals: Sequence[int]) -> None:
        """Enable current control with these goals [counts]; raises as the bus does.

        A motor whose settings differ is without torque for the few milliseconds that it takes to change them.
        """
        for number, (id_, goal) in enumerate(zip(self._bus.ids, goals, strict=True)):
            if self._read(id_, registers.BUS_WATCHDOG) == registers.WATCHDOG_TRIPPED:
                self._write(id_, registers.BUS_WATCHDOG, 0)
            self._set_eeprom(id_, registers.RETURN_DELAY_TIME, 0)
            self._set_eeprom(id_, registers.OPERATING_MODE, registers.MODE_CURRENT)
            self._write(id_, registers.BUS_WATCHDOG, self._watchdog)
            # A change of mode sets the largest current as the goal, so it must be overwritten before torque is on.
            self._write(id_, registers.GOAL_CURRENT, goal)
            self._write(id_, registers.TORQUE_ENABLE, 1)
            self.command(goals[: number + 1])  # feeds the watchdogs of the motors before it

    def _set_eeprom(self, id_: int, register: Register, value: int) -> None:
        """Write only if it differs: EEPROM wears out, and can be written with the torque off only."""
        if self._read(id_, register) != value:
            self._write(id_, registers.TORQUE_ENABLE, 0)
            self._write(id_, register, value)

    def command(self, goals: Sequence[int]) -> None:
        """Set goal currents [counts] from joint 1 on, limited to what the motors accept and may have."""
        limit = min(self.current_limit, self._most)
        self._bus.sync_write(
            registers.GOAL_CURRENT,
            [(id_, min(max(goal, -limit), limit)) for id_, goal in zip(self._bus.ids, goals, strict=False)],
        )

    def present(self) -> list[MotorReading]:
        return self._bus.present()

    def first_present(self) -> list[MotorReading]:
        """As `present`, tried again after a bad answer."""
        return self._insist(self._bus.present)

    def slept(self, now: float) -> bool:
        """Whether the bus was silent, now or since `watch_all`, long enough for a watchdog to trip."""
        return max(self._bus.silence, now - self._bus.sent_at) >= self._watchdog_s

    def watch(self) -> None:
        """Check torque or watchdog of one motor, in turn, since its measurements do not show them.

        Raises:
            BadReply: As of the bus.
            HardwareFault: Its watchdog has tripped, or it was without power.
        """
        count = len(self._bus.ids)
        number, self._next = self._next, (self._next + 1) % (2 * count)
        id_ = self._bus.ids[number % count]
        if (number + number // count) % 2:
            self._check_watchdog(id_)
        else:
            self._check_torque(id_)

    def watch_all(self) -> None:
        """As `watch`, for all motors at once."""
        self._bus.silence = 0.0
        for id_ in self._bus.ids:
            self._check_watchdog(id_)
            self._check_torque(id_)

    def _check_watchdog(self, id_: int) -> None:
        if self._bus.read(id_, registers.BUS_WATCHDOG) == registers.WATCHDOG_TRIPPED:
            raise HardwareFault(
                f"{self._bus.label(id_)}: its bus watchdog tripped: it heard nothing for "
                f"{self._watchdog * registers.WATCHDOG_UNIT_S * 1e3:.0f} ms and went limp"
            )

    def _check_torque(self, id_: int) -> None:
        if not self._bus.read(id_, registers.TORQUE_ENABLE):
            raise HardwareFault(f"{self._bus.label(id_)}: its torque is off; was it without power?")

    def leave(self, hold: bool) -> None:
        """Hold the arm by the motors' own position control, or let it go limp; never raises.

        A motor that holds has no watchdog; only its goal current limits it, to the largest one ever commanded. The
        watchdog would end the hold at once, and with a homing offset a motor has been seen to run away when its
        watchdog tripped in a multi-turn mode (ROBOTIS-GIT/DynamixelSDK, issue 584).

        The change of mode takes a few milliseconds without torque. The watchdog is off only while the torque is off or
        the motor holds, so a motor that stops answering, or whose host is killed meanwhile, goes limp, is limp, or
        holds within the limit.
        """
        for id_ in self._bus.ids:
            # A motor with an alarm is limp already, and must not prevent the others from holding.
            with suppress(HardwareFault):
                self._leave_one(id_, hold)

    def _leave_one(self, id_: int, hold: bool) -> None:
        position = self._bus.read(id_, registers.PRESENT_POSITION)
        self._write(id_, registers.TORQUE_ENABLE, 0)
        self._write(id_, registers.BUS_WATCHDOG, 0)
        if hold:
            self._write(id_, registers.OPERATING_MODE, registers.MODE_CURRENT_BASED_POSITION)
            self._write(id_, registers.GOAL_CURRENT, min(self.current_limit, self._most))
            self._write(id_, registers.GOAL_POSITION, position)
            self._write(id_, registers.TORQUE_ENABLE, 1)

    def _read(self, id_: int, register: Register) -> int:
        return self._insist(lambda: self._bus.read(id_, register))

    def _write(self, id_: int, register: Register, value: int) -> None:
        self._insist(lambda: self._bus.write(id_, register, value))

    @staticmethod
    def _insist(ask: Callable[[], MotorReply]) -> MotorReply:
        for _ in range(TRIES - 1):
            with suppress(BadReply):
                return ask()
        return ask()
