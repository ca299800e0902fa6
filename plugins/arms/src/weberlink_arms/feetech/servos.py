"""The servos of an arm: found, set up, and left as they were."""

from collections.abc import Callable
from contextlib import suppress
from typing import Final, TypeVar

from weberlink.hardware.fault import BadReply, HardwareFault
from weberlink_arms.feetech import packet, registers
from weberlink_arms.feetech.bus import ServoBus
from weberlink_arms.feetech.registers import Register

TRIES: Final = 12
"""At opening, where a late answer must not be fatal; together longer than a pause of a busy host."""

Reply = TypeVar("Reply")


def torque_off(ids: tuple[int, ...]) -> bytes:
    """The request that takes the torque off these servos; empty for none."""
    return packet.sync_write(registers.TORQUE_ENABLE.address, 1, [(id_, b"\0") for id_ in ids]) if ids else b""


class Servos:
    """All servos of an arm.

    Args:
        bus: With their ids in the order of the axes.
        baud: Its rate [bit/s], for error messages.
    """

    def __init__(self, bus: ServoBus, baud: int) -> None:
        self.bus = bus
        self._baud = baud
        self._before: list[tuple[int, Register, int]] = []

    def find(self) -> None:
        """Check that all are there and of the right model; raises HardwareFault with what to check."""
        bus = self.bus
        missing = [id_ for id_ in bus.ids if not self._answers(id_)]
        if len(missing) == len(bus.ids):
            raise HardwareFault(
                f"{bus.path}: no servo answers at {self._baud} bit/s: check the power supply and the cable from the "
                "board to the first servo, then baud and ids"
            )
        if missing:
            raise HardwareFault(
                f"{', '.join(map(bus.label, missing))}: no answer, but others answer: check the cable to it, and its "
                "id (lerobot-setup-motors sets ids 1 to 6)"
            )
        for id_ in bus.ids:
            if (model := self._read(id_, registers.MODEL_NUMBER)) != registers.MODEL:
                raise HardwareFault(
                    f"{bus.label(id_)}: is model {model}, an SO-101 has the STS3215 (model {registers.MODEL}): check "
                    "ids"
                )

    def _answers(self, id_: int) -> bool:
        try:
            self.insist(lambda: self.bus.ping(id_))
        except BadReply:
            return False
        return True

    def ranges(self) -> list[tuple[int, int]]:
        """Least and largest position of each servo, as its calibration has left them [counts]."""
        return [
            (self._read(id_, registers.MIN_POSITION), self._read(id_, registers.MAX_POSITION)) for id_ in self.bus.ids
        ]

    def prepare(self, p_gain: int) -> None:
        """Position control, the shortest return delay, and this P gain until the power goes off or `restore`.

        Raises as the bus does; HardwareFault too for a servo that does not take a setting.
        """
        for id_ in self.bus.ids:
            for register in (registers.TORQUE_LIMIT, registers.P_GAIN):
                self._before.append((id_, register, self._read(id_, register)))
            if self._read(id_, registers.MODE) != registers.MODE_POSITION:
                self._write(id_, registers.TORQUE_ENABLE, 0)
                self._set(id_, registers.MODE, registers.MODE_POSITION)
            self._set(id_, registers.RETURN_DELAY, 0)
            self._set(id_, registers.P_GAIN, p_gain)

    def _set(self, id_: int, register: Register, value: int) -> None:
        """Write an EEPROM register without wearing it: with the lock at 1, the value lasts until the power goes off."""
        if self._read(id_, register) == value:
            return
        for lock in (1, 0):  # a firmware that refuses under the lock takes it without
            self._write(id_, registers.LOCK, lock)
            self._write(id_, register, value)
            if self._read(id_, register) == value:
                break
        else:
            raise HardwareFault(f"{self.bus.label(id_)}: does not take {value} in register {register.address}")
        self._write(id_, registers.LOCK, 1)

    def restore(self) -> None:
        """Set P gains and torque limits back to what they were before `prepare`; never raises."""
        before, self._before = self._before, []
        for id_, register, value in before:
            with suppress(HardwareFault):
                self.bus.write(id_, register, value)

    def insist(self, ask: Callable[[], Reply]) -> Reply:
        """What `ask` gives, tried again after bad answers."""
        for _ in range(TRIES - 1):
            with suppress(BadReply):
                return ask()
        return ask()

    def _read(self, id_: int, register: Register) -> int:
        return self.insist(lambda: self.bus.read(id_, register))

    def _write(self, id_: int, register: Register, value: int) -> None:
        self.insist(lambda: self.bus.write(id_, register, value))
