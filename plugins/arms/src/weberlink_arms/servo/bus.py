"""The bus of the servos: requests, their answers within a deadline, and errors that name joint and id."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from time import monotonic, sleep
from typing import ClassVar, Final, Protocol, TypeVar

from weberlink.hardware.fault import BadReply
from weberlink_arms.servo.packet import Framing, Status

BITS_PER_BYTE: Final = 10
SETTLE_S: Final = 0.003
"""Time of silence after a bad answer [s], so that a late answer is not taken for the next one."""
_SETTLE_MOST: Final = 8
ADAPTER_S: Final = 0.0002
"""Least delay of any adapter beyond the time on the wire [s]."""
TRIES: Final = 12
"""At opening, where a late answer must not be fatal; together longer than a pause of a busy host."""

Reply = TypeVar("Reply")


class ServoPort(Protocol):
    """A serial port, such as `weberlink.hardware.serial_port.SerialPort`."""

    path: str

    def write(self, data: bytes) -> None: ...

    def read(self, until: float) -> bytes: ...

    def drain(self) -> bytes: ...

    def close(self) -> None: ...


class Register(Protocol):
    """Of a servo."""

    @property
    def address(self) -> int: ...

    @property
    def size(self) -> int: ...

    def encode(self, value: int) -> bytes: ...

    def decode(self, data: bytes) -> int: ...


class ServoBus:
    """Servos on one port.

    Args:
        port: Open, at the rate of the servos.
        baud: That rate [bit/s].
        ids: Of the servos, in the order of the axes.
        names: Of the axes, for messages; numbers if empty.
        margin: Longest time of an answer beyond its time on the wire [s]: adapter, host and return delay.
        clock: Monotonic [s].
        pause: Sleeps [s].
    """

    FRAMING: ClassVar[Framing]
    PRESENT: ClassVar[tuple[int, int]]
    """Address and size of all measurements."""
    PING_SIZE: ClassVar[int] = 0
    """Bytes of data in the answer to a ping."""

    def __init__(
        self,
        port: ServoPort,
        baud: int,
        ids: Sequence[int],
        names: Sequence[str] = (),
        margin: float = 0.02,
        clock: Callable[[], float] = monotonic,
        pause: Callable[[float], None] = sleep,
    ) -> None:
        self.ids, self.baud = tuple(ids), baud
        self._names = dict(zip(ids, names or [f"joint {number + 1}" for number in range(len(ids))], strict=True))
        self._ask_present = self.FRAMING.sync_read(*self.PRESENT, self.ids)
        self._port = port
        self._byte_s = BITS_PER_BYTE / baud
        self._margin = margin
        self._clock = clock
        self._pause = pause
        self._reader = self.FRAMING.answers()
        self._unsettled = False
        self._marks = 0
        self.sent_at = clock()
        """When the last request was sent [s]."""
        self.silence = 0.0
        """Longest time between two requests since this was set to 0 [s]."""

    @property
    def path(self) -> str:
        return self._port.path

    def label(self, id_: int) -> str:
        """Name of a servo for messages."""
        return f"{self._names[id_]} (id {id_})"

    def check(self, status: Status, what: str) -> None:
        """Raise the error that an answer reports, if it is one for any request."""

    def ping(self, id_: int) -> bytes:
        """What it answers, whatever errors it has.

        Raises:
            BadReply: no good answer.
            HardwareFault: the port is gone.
        """
        (status,) = self._ask(self.FRAMING.ping(id_), (id_,), self.PING_SIZE)
        return status.parameters

    def read(self, id_: int, register: Register) -> int:
        """The value of a register.

        Raises:
            BadReply: no good answer.
            HardwareFault: the servo refuses, see `check`, or the port is gone.
        """
        request = self.FRAMING.read(id_, register.address, register.size)
        (status,) = self._ask(request, (id_,), register.size)
        self.check(status, f"a read of register {register.address}")
        return register.decode(status.parameters)

    def write(self, id_: int, register: Register, value: int) -> None:
        """Set a register and wait for the confirmation; raises as `read` does."""
        request = self.FRAMING.write(id_, register.address, register.encode(value))
        (status,) = self._ask(request, (id_,), 0)
        self.check(status, f"{value} in register {register.address}")

    def sync_write(self, register: Register, values: Sequence[tuple[int, int]]) -> None:
        """Set a register of several servos to (id, value) each, without confirmation; HardwareFault as `send`."""
        encoded = [(id_, register.encode(value)) for id_, value in values]
        self.send(self.FRAMING.sync_write(register.address, register.size, encoded))

    def send(self, requests: bytes) -> None:
        """Send requests that no servo answers; raises HardwareFault if the port is gone."""
        now = self._clock()
        self.silence = max(self.silence, now - self.sent_at)
        self.sent_at = now
        self._port.write(requests)

    def measure(self, orders: bytes = b"") -> list[Status]:
        """The measurements of all servos, in the order of the axes; each measures when it answers.

        Args:
            orders: Requests that no servo answers; they leave immediately before, in one message, so that a guardian
                sees both as one. While a late answer may come they leave alone: what makes servos safe does not wait.

        Raises:
            BadReply: an answer was missing, late or garbled.
            HardwareFault: see `check`.
        """
        if self._unsettled and orders:
            self.send(orders)
            orders = b""
        statuses = self._ask(orders + self._ask_present, self.ids, self.PRESENT[1])
        for status in statuses:
            self.check(status, "a read of what it measures")
        return statuses

    def insist(self, ask: Callable[[], Reply]) -> Reply:
        """What `ask` gives, tried again after bad answers."""
        for _ in range(TRIES - 1):
            with suppress(BadReply):
                return ask()
        return ask()

    def _ask(self, request: bytes, ids: Sequence[int], size: int) -> list[Status]:
        """One answer of each servo in turn, each with `size` bytes."""
        self._settle()
        if self._unsettled:
            self._mark()
        self._unsettled = True
        reader = self._reader
        bad_before = reader.bad
        self.send(request)
        wire_s = (len(request) + len(ids) * (self.FRAMING.OVERHEAD + size)) * self._byte_s
        until = self.sent_at + wire_s + self._margin
        # Nothing can be done before the last answer has arrived, so the thread sleeps until then.
        self._pause(wire_s + ADAPTER_S)
        statuses: list[Status] = []
        while len(statuses) < len(ids):
            data = self._port.read(until)
            if not data:
                complaint = "garbled" if reader.bad > bad_before else "missing or late"
                raise BadReply(f"{self.label(ids[len(statuses)])}: its answer was {complaint}")
            for status in reader.feed(data):
                # Any other answer belongs to another servo or to an earlier request.
                if len(statuses) < len(ids) and status.id == ids[len(statuses)] and self._fits(status, size):
                    statuses.append(status)
        self._unsettled = False
        return statuses

    def _fits(self, status: Status, size: int) -> bool:
        return len(status.parameters) == size or bool(status.error & self.FRAMING.REFUSAL)

    def _mark(self) -> None:
        """Wait until no answer to an earlier request can arrive any more.

        Answers arrive in the order of requests, and a late one looks like one in time. So this sends a read of a unique
        size: once its answer has arrived, all earlier ones have.
        """
        id_ = self.ids[0]
        request, size = self.FRAMING.mark(id_, self._marks)
        self._marks += 1
        self.send(request)
        until = self.sent_at + (len(request) + self.FRAMING.OVERHEAD + size) * self._byte_s + self._margin
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
