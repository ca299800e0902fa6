"""The bus of Feetech servos: what they measure, and what their errors mean."""

from typing import Final

from weberlink.hardware.discovery import UsbId
from weberlink.hardware.fault import HardwareFault
from weberlink_arms.feetech import packet, registers
from weberlink_arms.feetech.packet import FRAMING
from weberlink_arms.feetech.registers import PRESENT_ADDRESS, PRESENT_SIZE, Present
from weberlink_arms.servo.bus import ServoBus

USB: Final = (UsbId(0x1A86, 0x55D3), UsbId(0x1A86, 0x7523), UsbId(0x0483, 0x5740))
"""Waveshare and Seeed boards (CH343, CH340) and boards with an STM32; only the servos tell which leads to an arm."""


class FeetechBus(ServoBus):
    """Servos on one port; see `ServoBus`. A servo with an error answers all the same."""

    FRAMING = FRAMING
    PRESENT = (PRESENT_ADDRESS, PRESENT_SIZE)

    def exchange(self, orders: bytes = b"") -> list[Present]:
        """Measurements of all servos in the order of the axes; see `measure`.

        Raises:
            BadReply: an answer was missing, late or garbled.
            HardwareFault: a servo reports an error, or the port is gone.
        """
        answers = self.measure(orders)
        for answer in answers:
            if answer.error:
                raise HardwareFault(self.complaint(answer.id, answer.error, answer.parameters))
        return [registers.present(answer.parameters) for answer in answers]

    def complaint(self, id_: int, error: int, measured: bytes) -> str:
        """What a servo with an error byte has to say, by what it measured."""
        if error & packet.VOLTAGE_ERROR:
            volts = registers.present(measured).voltage * registers.V_PER_COUNT
            return (
                f"{self.label(id_)}: its supply of {volts:.1f} V is out of its range; a 7.4 V servo needs the 5 to "
                "7.4 V supply, a 12 V servo the 12 V supply"
            )
        return f"{self.label(id_)}: {registers.error_text(error)}; switch its power off and on again"
