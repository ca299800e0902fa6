"""The bus of the motors: requests, their answers within a deadline, and errors that name joint and id."""

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from struct import Struct
from time import monotonic, sleep
from typing import Final, NamedTuple, Protocol

from weberlink.hardware.discovery import UDEV_RULES, UsbId
from weberlink.hardware.fault import BadReply, HardwareFault
from weberlink_arms.dynamixel import packet
from weberlink_arms.dynamixel.packet import (
    ALERT,
    OVERHEAD,
    StatusPacket,
    StatusPacketReader,
    encode_packet,
    error_text,
)
from weberlink_arms.dynamixel.registers import (
    HARDWARE_ERROR,
    PRESENT_ADDRESS,
    PRESENT_INPUT_VOLTAGE,
    PRESENT_SIZE,
    VOLTAGE_ERROR,
    Register,
    hardware_error_text,
)

USB: Final = (UsbId(0x0403, 0x6014), UsbId(0x0403, 0x6001), UsbId(0x0403, 0x6010), UsbId(0x0403, 0x6015))
"""ROBOTIS U2D2 (identifies as FT232H) and other FTDI adapters; only the motors tell which one leads to an arm."""
ARM_USB: Final = (*USB, UsbId(0x1A86, 0x55D3))
"""Those, and the bus servo board of Waveshare that a Koch arm has (CH343); arms with Feetech servos have it too."""
SYSFS: Final = Path("/sys/bus/usb-serial/devices")
BITS_PER_BYTE: Final = 10
STATUS_OVERHEAD: Final = OVERHEAD + 1
SETTLE_S: Final = 0.003
"""Time of silence after a bad answer [s], so that a late answer is not taken for the next one."""
_SETTLE_MOST: Final = 8
MARK_ADDRESS: Final = 120
MARK_SIZES: Final = range(11, 27)
"""Sizes of reads that are used for nothing else; more than answers can be owed before the arm counts as lost."""
ADAPTER_S: Final = 0.0002
"""Least delay of any adapter beyond the time on the wire [s]."""
_PRESENT: Final = Struct("<hii")


class MotorPort(Protocol):
    """A serial port, such as `weberlink.hardware.serial_port.SerialPort`."""

    path: str

    def write(self, data: bytes) -> None: ...

    def read(self, until: float) -> bytes: ...

    def drain(self) -> bytes: ...

    def close(self) -> None: ...


class MotorReading(NamedTuple):
    """Measurements of a motor, in counts."""

    current: int
    velocity: int
    position: int


class MotorBus:
    """Motors on one port.

    Args:
        port: Open, at the rate of the motors.
        baud: That rate [bit/s].
        ids: Of the motors, in the order of the joints.
        names: Of the joints, for messages; numbers if empty.
        margin: Longest time of an answer beyond its time on the wire [s]: adapter, host and return delay.
        clock: Monotonic [s].
        pause: Sleeps [s].
    """

    def __init__(
        self,
        port: MotorPort,
        baud: int,
        ids: Sequence[int],
        margin: float = 0.02,
        clock: Callable[[], float] = monotonic,
        pause: Callable[[float], None] = sleep,
        names: Sequence[str] = (),
    ) -> None:
        self.ids = tuple(ids)
        self._names = tuple(names) or tuple(f"joint {number + 1}" for number in range(len(self.ids)))
        self._port = port
        self._byte_s = BITS_PER_BYTE / baud
        self._margin = margin
        self._clock = clock
        self._pause = pause
        self._reader = StatusPacketReader()
        self._unsettled = False
        self._marks = 0
        self._ask_present = encode_packet(packet.sync_read(PRESENT_ADDRESS, PRESENT_SIZE, self.ids))
        self.sent_at = clock()
        """When the last instruction was sent [s]."""
        self.silence = 0.0
        """Longest time between two instructions since this was set to 0 [s]."""

    @property
    def path(self) -> str:
        return self._port.path

    def label(self, id_: int) -> str:
        """Name of a motor for messages."""
        return f"{self._names[self.ids.index(id_)]} (id {id_})" if id_ in self.ids else f"id {id_}"

    def ping(self, id_: int) -> int:
        """The model number.

        Raises:
            BadReply: no good answer.
            HardwareFault: the port is gone.
        """
        # Alarms are ignored here, since a wrong model is reported before an alarm.
        (status,) = self._ask(encode_packet(packet.ping(id_)), (id_,), 3)
        return int.from_bytes(status.parameters[:2], "little")

    def read(self, id_: int, register: Register) -> int:
        """The value of a register.

        Raises:
            BadReply: no good answer.
            HardwareFault: the motor has an alarm or refuses, or the port is gone.
        """
        (status,) = self._ask(encode_packet(packet.read(id_, register.address, register.size)), (id_,), register.size)
        self._check(status, f"a read of register {register.address}")
        return register.decode(status.parameters)

    def write(self, id_: int, register: Register, value: int) -> None:
        """Set a register and wait for the confirmation; raises as `read` does."""
        request = packet.write(id_, register.address, register.encode(value))
        (status,) = self._ask(encode_packet(request), (id_,), 0)
        self._check(status, f"{value} in register {register.address}")

    def sync_write(self, register: Register, values: Iterable[tuple[int, int]]) -> None:
        """Set a register of several motors to (id, value) each, without confirmation.

        Raises:
            HardwareFault: the port is gone.
        """
        request = packet.sync_write(register.address, register.size, [(id_, register.encode(v)) for id_, v in values])
        self._send(encode_packet(request))

    def present(self) -> list[MotorReading]:
        """Measurements of all motors in the order of the joints; each measures when it answers.

        Raises:
            BadReply: an answer was missing, late or garbled.
            HardwareFault: a motor has an alarm, or the port is gone.
        """
        statuses = self._ask(self._ask_present, self.ids, PRESENT_SIZE)
        for status in statuses:
            self._check(status, "a read of what it measures")
        return [MotorReading(*_PRESENT.unpack(status.parameters)) for status in statuses]

    def reading_s(self) -> float:
        """Time of `present` on the wire [s]."""
        return (len(self._ask_present) + len(self.ids) * (STATUS_OVERHEAD + PRESENT_SIZE)) * self._byte_s

    def _send(self, request: bytes) -> None:
        now = self._clock()
        self.silence = max(self.silence, now - self.sent_at)
        self.sent_at = now
        self._port.write(request)

    def _ask(self, request: bytes, ids: tuple[int, ...], size: int) -> list[StatusPacket]:
        """One answer of each motor in turn, each with `size` bytes."""
        self._settle()
        if self._unsettled:
            self._mark()
        self._unsettled = True
        reader = self._reader
        bad_before = reader.bad_crc
        self._send(request)
        wire_s = (len(request) + len(ids) * (STATUS_OVERHEAD + size)) * self._byte_s
        until = self.sent_at + wire_s + self._margin
        # Nothing can be done before the last answer has arrived, so the thread sleeps until then.
        self._pause(wire_s + ADAPTER_S)
        statuses: list[StatusPacket] = []
        while len(statuses) < len(ids):
            data = self._port.read(until)
            if not data:
                complaint = "garbled" if reader.bad_crc > bad_before else "missing or late"
                raise BadReply(f"{self.label(ids[len(statuses)])}: its answer was {complaint}")
            for status in reader.feed(data):
                # Any other answer belongs to another motor or to an earlier request.
                if len(statuses) < len(ids) and status.id == ids[len(statuses)]:
                    statuses.append(self._sized(status, size))
        self._unsettled = False
        return statuses

    def _mark(self) -> None:
        """Wait until no answer to an earlier request can arrive any more.

        Answers arrive in the order of requests, and a late one looks like one in time. So this sends a read of a unique
        size: once its answer has arrived, all earlier ones have.
        """
        id_, size = self.ids[0], MARK_SIZES[self._marks % len(MARK_SIZES)]
        self._marks += 1
        request = encode_packet(packet.read(id_, MARK_ADDRESS, size))
        self._send(request)
        until = self.sent_at + (len(request) + STATUS_OVERHEAD + size) * self._byte_s + self._margin
        while data := self._port.read(until):
            if any(each.id == id_ and len(each.parameters) == size for each in self._reader.feed(data)):
                return
        raise BadReply(f"{self.label(id_)}: its answer was missing or late")

    def _sized(self, status: StatusPacket, size: int) -> StatusPacket:
        if len(status.parameters) != size and not status.error & ~ALERT:
            raise BadReply(f"{self.label(status.id)}: answered {len(status.parameters)} bytes instead of {size}")
        return status

    def _settle(self) -> None:
        """Discard what is not an answer to the next request."""
        self._reader.clear()
        self._port.drain()
        for _ in range(_SETTLE_MOST if self._unsettled else 0):
            if not self._port.read(self._clock() + SETTLE_S):
                return

    def _check(self, status: StatusPacket, what: str) -> None:
        """Raise the error that a status reports."""
        if not status.error:
            return
        error = status.error & ~ALERT
        if error == packet.CRC_ERROR:
            raise BadReply(f"{self.label(status.id)}: received a garbled request")
        if status.error & ALERT:
            raise HardwareFault(f"{self.label(status.id)}: {self._alarm(status.id)}")
        if error:
            raise HardwareFault(f"{self.label(status.id)} refuses {what}: {error_text(error)}")

    def _alarm(self, id_: int) -> str:
        """Meaning of a motor's alarm."""
        value = self._despite_alarm(id_, HARDWARE_ERROR)
        text = hardware_error_text(value)
        if value & VOLTAGE_ERROR:
            text += f"; it has {0.1 * self._despite_alarm(id_, PRESENT_INPUT_VOLTAGE):.1f} V now"
        return f"{text}; it stays off until its power was off and on again"

    def _despite_alarm(self, id_: int, register: Register) -> int:
        request = encode_packet(packet.read(id_, register.address, register.size))
        (status,) = self._ask(request, (id_,), register.size)
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
        f"echo 1 | sudo tee {SYSFS / name / 'latency_timer'} (the shipped {UDEV_RULES} does so for good)"
    )
