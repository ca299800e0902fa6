"""The bus of the servos: requests, their answers within a deadline, and errors that name joint and id."""

from collections.abc import Callable, Sequence
from time import monotonic, sleep
from typing import Final, Protocol

from weberlink.hardware.discovery import UsbId
from weberlink.hardware.fault import BadReply, HardwareFault
from weberlink_arms.feetech import packet, registers
from weberlink_arms.feetech.packet import OVERHEAD, Frame, FrameReader
from weberlink_arms.feetech.registers import PRESENT_ADDRESS, PRESENT_SIZE, Present, Register

USB: Final = (UsbId(0x1A86, 0x55D3), UsbId(0x1A86, 0x7523), UsbId(0x0483, 0x5740))
"""Waveshare and Seeed boards (CH343, CH340) and boards with an STM32; only the servos tell which leads to an arm."""
BITS_PER_BYTE: Final = 10
SETTLE_S: Final = 0.003
"""Time of silence after a bad answer [s], so that a late answer is not taken for the next one."""
_SETTLE_MOST: Final = 8
ADAPTER_S: Final = 0.0002
"""Least delay of any adapter beyond the time on the wire [s]."""


class ServoPort(Protocol):
    """A serial port, such as `weberlink.hardware.serial_port.SerialPort`."""

    path: str

    def write(self, data: bytes) -> None: ...

    def read(self, until: float) -> bytes: ...

    def drain(self) -> bytes: ...

    def close(self) -> None: ...


class ServoBus:
    """Servos on one port.

    Args:
        port: Open, at the rate of the servos.
        baud: That rate [bit/s].
        ids: Of the servos, in the order of the axes.
        names: Of the axes.
        margin: Longest time of an answer beyond its time on the wire [s]: adapter, host and return delay.
        clock: Monotonic [s].
        pause: Sleeps [s].
    """

    def __init__(
        self,
        port: ServoPort,
        baud: int,
        ids: Sequence[int],
        names: Sequence[str],
        margin: float = 0.02,
        clock: Callable[[], float] = monotonic,
        pause: Callable[[float], None] = sleep,
    ) -> None:
        self.ids = tuple(ids)
        self._names = dict(zip(ids, names, strict=True))
        self._port = port
        self._byte_s = BITS_PER_BYTE / baud
        self._margin = margin
        self._clock = clock
        self._pause = pause
        self._reader = FrameReader()
        self._unsettled = False
        self._marks = 0
        self._ask_present = packet.sync_read(PRESENT_ADDRESS, PRESENT_SIZE, self.ids)

    @property
    def path(self) -> str:
        return self._port.path

    def label(self, id_: int) -> str:
        """Name of a servo for messages."""
        return f"{self._names[id_]} (id {id_})"

    def ping(self, id_: int) -> None:
        """Raises BadReply for no good answer, HardwareFault if the port is gone; errors of the servo are ignored."""
        self._ask(packet.ping(id_), (id_,), 0)

    def read(self, id_: int, register: Register) -> int:
        """The value of a register; errors of the servo are ignored, as it answers all the same.

        Raises:
            BadReply: no good answer.
            HardwareFault: the port is gone.
        """
        (answer,) = self._ask(packet.read(id_, register.address, register.size), (id_,), register.size)
        return register.decode(answer.parameters)

    def write(self, id_: int, register: Register, value: int) -> None:
        """Set a register and wait for the confirmation; raises as `read` does."""
        self._ask(packet.write(id_, register.address, register.encode(value)), (id_,), 0)

    def send(self, orders: bytes) -> None:
        """Send requests that no servo answers; raises HardwareFault if the port is gone."""
        self._port.write(orders)

    def exchange(self, orders: bytes = b"") -> list[Present]:
        """Measurements of all servos in the order of the axes.

        Args:
            orders: Requests that no servo answers; they leave immediately before the request for the measurements, in
                one message, so that a guardian sees both as one.

        Raises:
            BadReply: an answer was missing, late or garbled.
            HardwareFault: a servo reports an error, or the port is gone.
        """
        if self._unsettled and orders:
            self.send(orders)  # what makes the servos safe does not wait for late answers
            orders = b""
        answers = self._ask(orders + self._ask_present, self.ids, PRESENT_SIZE)
        for answer in answers:
            if answer.code:
                raise HardwareFault(self.complaint(answer.id, answer.code, answer.parameters))
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

    def exchange_s(self, orders: int) -> float:
        """Time of an exchange with so many bytes of orders on the wire [s]."""
        return (orders + len(self._ask_present) + len(self.ids) * (OVERHEAD + PRESENT_SIZE)) * self._byte_s

    def _ask(self, request: bytes, ids: tuple[int, ...], size: int) -> list[Frame]:
        """One answer of each servo in turn, each with `size` bytes."""
        self._settle()
        if self._unsettled:
            self._mark()
        self._unsettled = True
        reader = self._reader
        bad_before = reader.bad_checksums
        sent_at = self._clock()
        self._port.write(request)
        wire_s = (len(request) + len(ids) * (OVERHEAD + size)) * self._byte_s
        until = sent_at + wire_s + self._margin
        self._pause(wire_s + ADAPTER_S)  # nothing can be done before the last answer has arrived
        answers: list[Frame] = []
        while len(answers) < len(ids):
            data = self._port.read(until)
            if not data:
                garbled = reader.bad_checksums > bad_before
                complaint = "garbled (wrong checksum)" if garbled else "missing or late"
                raise BadReply(f"{self.label(ids[len(answers)])}: its answer was {complaint}")
            for frame in reader.feed(data):
                # Any other answer belongs to another servo or to an earlier request.
                if len(answers) < len(ids) and frame.id == ids[len(answers)] and len(frame.parameters) == size:
                    answers.append(frame)
        self._unsettled = False
        return answers

    def _mark(self) -> None:
        """Wait until no answer to an earlier request can arrive any more.

        Answers arrive in the order of requests, and a late one looks like one in time. So this sends a read of a size
        of its own: once its answer has arrived, all earlier ones have.
        """
        id_, size = self.ids[0], 3 + self._marks % (PRESENT_SIZE - 3)
        self._marks += 1
        request = packet.read(id_, PRESENT_ADDRESS, size)
        until = self._clock() + (len(request) + OVERHEAD + size) * self._byte_s + self._margin
        self._port.write(request)
        while data := self._port.read(until):
            if any(each.id == id_ and len(each.parameters) == size for each in self._reader.feed(data)):
                return
        raise BadReply(f"{self.label(id_)}: its answer was missing or late")

    def _settle(self) -> None:
        """Discard what is not an answer to the next request."""
        self._reader.clear()
        self._port.drain()
        for _ in range(_SETTLE_MOST if self._unsettled else 0):
            if not self._port.read(self._clock() + SETTLE_S):
                return
