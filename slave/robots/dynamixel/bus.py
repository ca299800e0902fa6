"""The bus: one request at a time, its answers within a deadline, and what goes wrong named by joint and id.

Owns deadlines and the pairing of requests with answers. Knows what a register is, and nothing of what the arm does.
"""

from collections.abc import Callable, Iterable, Sequence
from struct import Struct
from time import monotonic, sleep
from typing import Final, NamedTuple, Protocol

from weberlink.hardware.fault import BadReply, HardwareFault
from weberlink.slave.robots.dynamixel import packet
from weberlink.slave.robots.dynamixel.packet import ALERT, Packet, Status, StatusReader, encode_packet, error_text
from weberlink.slave.robots.dynamixel.registers import (
    HARDWARE_ERROR,
    PRESENT_ADDRESS,
    PRESENT_SIZE,
    Register,
    hardware_error_text,
)

BITS_PER_BYTE: Final = 10
STATUS_OVERHEAD: Final = 11
SETTLE_S: Final = 0.003
"""How long the line has to be quiet after an answer went wrong, so that a late one is not taken for the next."""
_SETTLE_MOST: Final = 8
MARK_ADDRESS: Final = 120
MARK_SIZES: Final = range(11, 27)
"""Of reads that nothing else asks for; more of them than can be owed before the arm counts as lost."""
ADAPTER_S: Final = 0.0002
"""What any adapter adds to the time on the wire, at least [s]."""
_PRESENT: Final = Struct("<hii")


class Port(Protocol):
    """What `weberlink.hardware.serial_port.SerialPort` offers."""

    path: str

    def write(self, data: bytes) -> None: ...

    def read(self, until: float) -> bytes: ...

    def drain(self) -> bytes: ...

    def close(self) -> None: ...


class Present(NamedTuple):
    """What a motor measures, in counts."""

    current: int
    velocity: int
    position: int


class Bus:
    """Motors on one port.

    Args:
        port: open, at the rate of the motors.
        baud: that rate [bit/s].
        ids: of the motors, in the order of the joints.
        margin: how long an answer may take beyond its time on the wire [s]: adapter, host and return delay.
        clock: monotonic [s].
        pause: lets time pass [s].
    """

    def __init__(
        self,
        port: Port,
        baud: int,
        ids: Sequence[int],
        margin: float = 0.02,
        clock: Callable[[], float] = monotonic,
        pause: Callable[[float], None] = sleep,
    ) -> None:
        self.ids = tuple(ids)
        self._port = port
        self._byte_s = BITS_PER_BYTE / baud
        self._margin = margin
        self._clock = clock
        self._pause = pause
        self._reader = StatusReader()
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
        """A motor, for a person."""
        return f"joint {self.ids.index(id_) + 1} (id {id_})" if id_ in self.ids else f"id {id_}"

    def ping(self, id_: int) -> int:
        """The model number.

        Raises:
            BadReply: no good answer.
            HardwareFault: the port is gone.
        """
        # Asked for without regard to alarms: what stands there is told before why it does not work.
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
        """Set a register and wait for the motor to say so; raises as `read` does."""
        request = Packet(id_, packet.WRITE, register.address.to_bytes(2, "little") + register.encode(value))
        (status,) = self._ask(encode_packet(request), (id_,), 0)
        self._check(status, f"{value} in register {register.address}")

    def sync_write(self, register: Register, values: Iterable[tuple[int, int]]) -> None:
        """Set a register of several motors to (id, value) each. None of them answers.

        Raises:
            HardwareFault: the port is gone.
        """
        request = packet.sync_write(register.address, register.size, [(id_, register.encode(v)) for id_, v in values])
        self._send(encode_packet(request))

    def present(self) -> list[Present]:
        """What all motors measure, in the order of the joints; they measure one after the other, as they answer.

        Raises:
            BadReply: an answer was missing, late or garbled.
            HardwareFault: a motor has an alarm, or the port is gone.
        """
        statuses = self._ask(self._ask_present, self.ids, PRESENT_SIZE)
        for status in statuses:
            if status.error:
                self._check(status, "a read of what it measures")
        return [Present(*_PRESENT.unpack(status.parameters)) for status in statuses]

    def reading_s(self) -> float:
        """Time of `present` on the wire [s]."""
        return (len(self._ask_present) + len(self.ids) * (STATUS_OVERHEAD + PRESENT_SIZE)) * self._byte_s

    def _send(self, request: bytes) -> None:
        now = self._clock()
        self.silence = max(self.silence, now - self.sent_at)
        self.sent_at = now
        self._port.write(request)

    def _ask(self, request: bytes, ids: tuple[int, ...], size: int) -> list[Status]:
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
        # To wake for every answer as it comes costs more than it gains: nothing is done before the last one is there.
        self._pause(wire_s + ADAPTER_S)
        statuses: list[Status] = []
        while len(statuses) < len(ids):
            data = self._port.read(until)
            if not data:
                complaint = "garbled" if reader.bad_crc > bad_before else "missing or late"
                raise BadReply(f"{self.label(ids[len(statuses)])}: its answer was {complaint}")
            for status in reader.feed(data):
                # Anything but the answer that is due is a stray: of another motor or of an earlier request.
                if len(statuses) < len(ids) and status.id == ids[len(statuses)]:
                    statuses.append(self._sized(status, size))
        self._unsettled = False
        return statuses

    def _mark(self) -> None:
        """Make sure that no answer is owed any more.

        Answers come in the order of requests, and a late one looks like one in time. So something is asked for that is
        told from all that may still be owed by its size: once its answer is there, whatever was owed before has come.
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

    def _sized(self, status: Status, size: int) -> Status:
        if len(status.parameters) != size and not status.error & ~ALERT:
            raise BadReply(f"{self.label(status.id)}: answered {len(status.parameters)} bytes instead of {size}")
        return status

    def _settle(self) -> None:
        """Take away what is not an answer to what is asked next."""
        self._reader.clear()
        self._port.drain()
        for _ in range(_SETTLE_MOST if self._unsettled else 0):
            if not self._port.read(self._clock() + SETTLE_S):
                return

    def _check(self, status: Status, what: str) -> None:
        """Raise what the error byte says."""
        error = status.error & ~ALERT
        if error == packet.CRC_ERROR:
            raise BadReply(f"{self.label(status.id)}: the request arrived there garbled")
        if status.error & ALERT:
            raise HardwareFault(f"{self.label(status.id)}: {self._alarm(status.id)}")
        if error:
            raise HardwareFault(f"{self.label(status.id)} refuses {what}: {error_text(error)}")

    def _alarm(self, id_: int) -> str:
        """What the motor's alarm means."""
        register = HARDWARE_ERROR
        (status,) = self._ask(encode_packet(packet.read(id_, register.address, register.size)), (id_,), register.size)
        value = register.decode(status.parameters)
        return f"{hardware_error_text(value)}; it stays off until its power was off and on again"
