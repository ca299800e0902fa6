"""The bus of Dynamixel motors: what they measure, and what their alarms mean."""

from pathlib import Path
from struct import Struct
from typing import Final, NamedTuple

from weberlink.hardware.discovery import UsbId
from weberlink.hardware.fault import BadReply, HardwareFault
from weberlink_arms.dynamixel.packet import ALERT, CRC_ERROR, FRAMING, error_text
from weberlink_arms.dynamixel.registers import (
    HARDWARE_ERROR,
    PRESENT_ADDRESS,
    PRESENT_INPUT_VOLTAGE,
    PRESENT_SIZE,
    VOLTAGE_ERROR,
    Register,
    hardware_error_text,
)
from weberlink_arms.servo.bus import ServoBus
from weberlink_arms.servo.packet import Status

# ROBOTIS U2D2 (identifies as FT232H) and other FTDI adapters; only the motors tell which one leads to an arm.
USB: Final = (UsbId(0x0403, 0x6014), UsbId(0x0403, 0x6001), UsbId(0x0403, 0x6010), UsbId(0x0403, 0x6015))
# Those, and the bus servo board of Waveshare that a Koch arm has (CH343); arms with Feetech servos have it too.
ARM_USB: Final = (*USB, UsbId(0x1A86, 0x55D3))
SYSFS: Final = Path("/sys/bus/usb-serial/devices")
_PRESENT: Final = Struct("<hii")


class MotorReading(NamedTuple):
    """Measurements of a motor, in counts."""

    current: int
    velocity: int
    position: int


class MotorBus(ServoBus):
    """Motors on one port."""

    FRAMING = FRAMING
    PRESENT = (PRESENT_ADDRESS, PRESENT_SIZE)
    PING_SIZE = 3

    @staticmethod
    def decoded(data: bytes) -> MotorReading:
        return MotorReading(*_PRESENT.unpack(data))

    def check(self, status: Status, what: str) -> None:
        if not status.error:
            return
        error = status.error & ~ALERT
        if error == CRC_ERROR:
            raise BadReply(f"{self.label(status.id)}: received a garbled request")
        if status.error & ALERT:
            value = self._despite_alarm(status.id, HARDWARE_ERROR)
            text = hardware_error_text(value)
            if value & VOLTAGE_ERROR:
                text += f"; it has {0.1 * self._despite_alarm(status.id, PRESENT_INPUT_VOLTAGE):.1f} V now"
            raise HardwareFault(f"{self.label(status.id)}: {text}; it stays off until its power was off and on again")
        raise HardwareFault(f"{self.label(status.id)} refuses {what}: {error_text(error)}")

    def _despite_alarm(self, id_: int, register: Register) -> int:
        (status,) = self._ask(self.FRAMING.read(id_, register.address, register.size), (id_,), register.size)
        return register.decode(status.parameters)


def latency_ms(path: str, sysfs: Path = SYSFS) -> int | None:
    """Time for which an FTDI adapter collects bytes [ms]; None where it is unknown."""
    try:
        return int((sysfs / Path(path).resolve().name / "latency_timer").read_text())
    except (OSError, ValueError):
        return None


def latency_advice(path: str, sysfs: Path = SYSFS) -> str | None:
    """Advice for an adapter that collects for more than 1 ms; None otherwise."""
    latency = latency_ms(path, sysfs)
    if latency is None or latency <= 1:
        return None
    name = Path(path).resolve().name
    return (
        f"{path} collects what it receives for {latency} ms; set it to 1 ms with: "
        f"echo 1 | sudo tee {SYSFS / name / 'latency_timer'} (`weberlink device rules` does so for good)"
    )
