"""Feetech servos on their bus: what they measure, what their errors mean, and how they are set up and left."""

from contextlib import suppress
from typing import Final

from weberlink.hardware.discovery import UsbId
from weberlink.hardware.fault import HardwareFault
from weberlink_arms.feetech import packet, registers
from weberlink_arms.feetech.packet import FRAMING
from weberlink_arms.feetech.registers import PRESENT_ADDRESS, PRESENT_SIZE, Present, Register
from weberlink_arms.servo.bus import ServoBus, Servos
from weberlink_arms.servo.packet import Status

# Waveshare and Seeed boards (CH343, CH340) and boards with an STM32; only the servos tell which leads to an arm.
USB: Final = (UsbId(0x1A86, 0x55D3), UsbId(0x1A86, 0x7523), UsbId(0x0483, 0x5740))


class FeetechBus(ServoBus):
    """Servos on one port. A servo with an error answers all the same, so only its measurements are a fault."""

    FRAMING = FRAMING
    PRESENT = (PRESENT_ADDRESS, PRESENT_SIZE)

    @staticmethod
    def decoded(data: bytes) -> Present:
        return registers.present(data)

    def _check_present(self, status: Status) -> None:
        if status.error & packet.VOLTAGE_ERROR:
            volts = registers.present(status.parameters).voltage * registers.V_PER_COUNT
            raise HardwareFault(
                f"{self.label(status.id)}: its supply of {volts:.1f} V is out of its range; a 7.4 V servo needs the 5 "
                "to 7.4 V supply, a 12 V servo the 12 V supply"
            )
        if status.error:
            text = registers.error_text(status.error)
            raise HardwareFault(f"{self.label(status.id)}: {text}; switch its power off and on again")


def torque_off(ids: tuple[int, ...]) -> bytes:
    """The request that takes the torque off these servos; empty for none."""
    return FRAMING.sync_write(registers.TORQUE_ENABLE.address, 1, [(id_, b"\0") for id_ in ids]) if ids else b""


class FeetechServos(Servos[FeetechBus]):
    """All servos of an arm."""

    TORQUE = registers.TORQUE_ENABLE
    KIND = "servo"

    def __init__(self, bus: FeetechBus) -> None:
        super().__init__(bus)
        self._before: list[tuple[int, Register, int]] = []

    def advice(self) -> str:
        return "the power supply and the cable from the board to the first servo, then baud and ids"

    def find(self) -> None:
        """Check that they are of the right model too."""
        super().find()
        for id_ in self.bus.ids:
            if (model := self.read(id_, registers.MODEL_NUMBER)) != registers.MODEL:
                raise HardwareFault(
                    f"{self.bus.label(id_)}: is model {model}, an SO-101 has the STS3215 (model {registers.MODEL}): "
                    "check ids"
                )

    def ranges(self) -> list[tuple[int, int]]:
        """Least and largest position of each servo, as its calibration has left them [counts]."""
        return [
            (self.read(id_, registers.MIN_POSITION), self.read(id_, registers.MAX_POSITION)) for id_ in self.bus.ids
        ]

    def prepare(self, p_gain: int) -> None:
        """Position control, the shortest return delay, and this P gain until the power goes off or `restore`.

        Raises as the bus does; HardwareFault too for a servo that does not take a setting.
        """
        for id_ in self.bus.ids:
            for register in (registers.TORQUE_LIMIT, registers.P_GAIN):
                self._before.append((id_, register, self.read(id_, register)))
            if self.read(id_, registers.MODE) != registers.MODE_POSITION:
                self.write(id_, registers.TORQUE_ENABLE, 0)
                self._set(id_, registers.MODE, registers.MODE_POSITION)
            self._set(id_, registers.RETURN_DELAY, 0)
            self._set(id_, registers.P_GAIN, p_gain)

    def _set(self, id_: int, register: Register, value: int) -> None:
        """Write an EEPROM register without wearing it: with the lock at 1, the value lasts until the power goes off."""
        if self.read(id_, register) == value:
            return
        for lock in (1, 0):  # a firmware that refuses under the lock takes it without
            self.write(id_, registers.LOCK, lock)
            self.write(id_, register, value)
            if self.read(id_, register) == value:
                break
        else:
            raise HardwareFault(f"{self.bus.label(id_)}: does not take {value} in register {register.address}")
        self.write(id_, registers.LOCK, 1)

    def restore(self) -> None:
        """Set P gains and torque limits back to what they were before `prepare`; never raises."""
        before, self._before = self._before, []
        for id_, register, value in before:
            with suppress(HardwareFault):
                self.bus.write(id_, register, value)

    def release(self) -> None:
        """Take the torque off, and set the servos back to their own gain and limit; never raises."""
        with suppress(HardwareFault):
            self.bus.send(torque_off(self.bus.ids))
        self.restore()
