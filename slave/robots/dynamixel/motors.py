"""The four motors: made ready for current control, watched while they run, and left safe.

Owns the order in which that has to happen. Knows no kinematics: what the currents are for is another matter.
"""

from collections.abc import Callable, Sequence
from contextlib import suppress
from enum import StrEnum
from math import ceil, floor
from typing import Final, TypeVar

from weberlink.hardware.fault import BadReply, HardwareFault
from weberlink.slave.robots.dynamixel import registers
from weberlink.slave.robots.dynamixel.bus import Bus, Present
from weberlink.slave.robots.dynamixel.registers import MODELS, OPENMANIPULATOR_X_MODEL, Register

TRIES: Final = 12
"""At opening, where one answer that is late should not be the end; in all longer than a busy host pauses."""

Answer = TypeVar("Answer")


class OnClose(StrEnum):
    """How the arm is left.

    A torque that is switched off under gravity drops the arm, so `hold` is the default.
    """

    HOLD = "hold"
    LIMP = "limp"
    REST = "rest"


def watchdog_units(watchdog_s: float) -> int:
    """What stands in the register of a bus watchdog of at least this long [s]."""
    return min(max(1, ceil(watchdog_s / registers.WATCHDOG_UNIT_S - 1e-9)), registers.WATCHDOG_MOST)


class Motors:
    """The motors of the arm, on a bus that is theirs alone.

    Args:
        bus: with their ids in the order of the joints.
        baud: its rate [bit/s], for complaints.
        watchdog_s: how long a motor that hears nothing goes on [s].
        current: largest one that a motor is ever told to have [A].
    """

    def __init__(self, bus: Bus, baud: int, watchdog_s: float, current: float) -> None:
        self._bus = bus
        self._baud = baud
        self._watchdog_s = watchdog_s
        self._watchdog = watchdog_units(watchdog_s)
        self._most = floor(current / registers.A_PER_COUNT)
        self._next = 0
        self.current_limit = 0
        """Largest goal current that all of them take [counts]."""

    def find(self) -> None:
        """Make sure that the right motors are there, turn the right way, and have no alarm.

        Raises:
            HardwareFault: with what to check.
        """
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
        wanted = MODELS[OPENMANIPULATOR_X_MODEL].name
        model = MODELS.get(number)
        name = model.name if model is not None else f"model {number}"
        reason = ", which cannot control its current" if model is not None and not model.current_control else ""
        raise HardwareFault(
            f"{self._bus.label(id_)}: is a {name}{reason}; an OpenMANIPULATOR-X has {wanted}: check ids"
        )

    def engage(self, goals: Sequence[int]) -> None:
        """Current control with torque on, beginning with these goals [counts].

        A motor whose settings differ loses its torque for the few milliseconds that it takes to change them.

        Raises:
            BadReply, HardwareFault: as of the bus.
        """
        for number, (id_, goal) in enumerate(zip(self._bus.ids, goals, strict=True)):
            if self._read(id_, registers.BUS_WATCHDOG) == registers.WATCHDOG_TRIPPED:
                self._write(id_, registers.BUS_WATCHDOG, 0)
            self._set_eeprom(id_, registers.RETURN_DELAY_TIME, 0)
            self._set_eeprom(id_, registers.OPERATING_MODE, registers.MODE_CURRENT)
            self._write(id_, registers.BUS_WATCHDOG, self._watchdog)
            # A change of mode leaves the largest current as the goal: that it is gone must be sure before torque.
            self._write(id_, registers.GOAL_CURRENT, goal)
            self._write(id_, registers.TORQUE_ENABLE, 1)
            self.command(goals[: number + 1])  # or the watchdogs of those before it would trip meanwhile

    def _set_eeprom(self, id_: int, register: Register, value: int) -> None:
        """EEPROM wears, and takes writes with the torque off only."""
        if self._read(id_, register) != value:
            self._write(id_, registers.TORQUE_ENABLE, 0)
            self._write(id_, register, value)

    def command(self, goals: Sequence[int]) -> None:
        """Goal currents [counts] of the motors from joint 1 on, cut to what they take and may have."""
        limit = min(self.current_limit, self._most)
        self._bus.sync_write(
            registers.GOAL_CURRENT,
            [(id_, min(max(goal, -limit), limit)) for id_, goal in zip(self._bus.ids, goals, strict=False)],
        )

    def present(self) -> list[Present]:
        return self._bus.present()

    def first_present(self) -> list[Present]:
        """As `present`, where one answer that is late should not be the end."""
        return self._insist(self._bus.present)

    def slept(self, now: float) -> bool:
        """Whether the bus was silent, now or since `watch_all`, for so long that the watchdogs may have tripped."""
        return max(self._bus.silence, now - self._bus.sent_at) >= self._watchdog_s

    def watch(self) -> None:
        """Look at one register of one motor, in turn: whether it still does what it is told, its answers do not say.

        Raises:
            BadReply: as of the bus.
            HardwareFault: its watchdog has tripped, or it was without power.
        """
        count = len(self._bus.ids)
        number, self._next = self._next, (self._next + 1) % (2 * count)
        id_ = self._bus.ids[number % count]
        if (number + number // count) % 2:
            self._check_watchdog(id_)
        else:
            self._check_torque(id_)

    def watch_all(self) -> None:
        """As `watch`, of everything."""
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
        """Hold the arm where it is by the motors' own position control, or let it go limp; never raises.

        Nobody watches a motor that holds: its watchdog is off, and all that bounds it is its goal current, the largest
        one it was ever told to have. Left on, the watchdog would end the hold at once; and in firmware with a homing
        offset a motor has been seen to run away when it tripped in a mode that counts turns, as this one does
        (ROBOTIS-GIT/DynamixelSDK, issue 584).

        To hold, a motor has to change its mode, for which its torque is off for a few milliseconds. Its watchdog is
        switched off only while its torque is: one that does not answer any more, or whose host is killed meanwhile,
        goes limp by its watchdog, is limp, or holds within the bound.
        """
        for id_ in self._bus.ids:
            # An alarm has made its motor limp already, and must not keep the others from holding.
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
    def _insist(ask: Callable[[], Answer]) -> Answer:
        for _ in range(TRIES - 1):
            with suppress(BadReply):
                return ask()
        return ask()
