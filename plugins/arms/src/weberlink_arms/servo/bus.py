"""The servos of an arm on their bus: requests, answers within a deadline, and errors that name joint and id."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from time import monotonic, sleep
from typing import Any, ClassVar, Final, Generic, Protocol, TypeVar

from weberlink.hardware.fault import BadReply, HardwareFault
from weberlink_arms.servo.packet import Framing, Status

BITS_PER_BYTE: Final = 10
SETTLE_S: Final = 0.003  # of silence after a bad answer, so that a late answer is not taken for the next one
_SETTLE_MOST: Final = 8
ADAPTER_S: Final = 0.0002  # least delay of any adapter beyond the time on the wire
TRIES: Final = 12  # at opening, where a late answer must not be fatal; together longer than a pause of a busy host

Reply = TypeVar("Reply")


class Register(Protocol):
    """Of a servo."""

    @property
    def address(self) -> int: ...

    @property
    def size(self) -> int: ...

    def encode(self, value: int) -> bytes: ...

    def decode(self, data: bytes) -> int: ...


class ServoBus:
    """Servos on one open port, such as a `SerialPort`, at their rate `baud` [bit/s], `ids` in the order of the axes.

    `names` are those of the axes, for messages; numbers if empty. `margin` is the longest time of an answer beyond its
    time on the wire [s]: adapter, host and return delay. `pause` sleeps [s].

    What asks raises BadReply where there is no good answer, and HardwareFault if a servo refuses (see `check`) or the
    port is gone.
    """

    FRAMING: ClassVar[Framing]
    PRESENT: ClassVar[tuple[int, int]]  # address and size of all measurements
    PING_SIZE: ClassVar[int] = 0  # bytes of data in the answer to a ping

    def __init__(
        self,
        port: Any,
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
        self.path: str = port.path
        self._port, self._byte_s, self._margin = port, BITS_PER_BYTE / baud, margin
        self._clock, self._pause = clock, pause
        self._reader = self.FRAMING.answers()
        self._unsettled, self._marks = False, 0
        self.sent_at = clock()  # when the last request was sent [s]
        self.silence = 0.0  # longest time between two requests since this was set to 0 [s]

    def label(self, id_: int) -> str:
        """Name of a servo for messages."""
        return f"{self._names[id_]} (id {id_})"

    def check(self, status: Status, what: str) -> None:
        """Raise the error that an answer reports, if it is one for any request."""

    def ping(self, id_: int) -> bytes:
        """What it answers, whatever errors it has."""
        (status,) = self._ask(self.FRAMING.ping(id_), (id_,), self.PING_SIZE)
        return status.parameters

    def read(self, id_: int, register: Register) -> int:
        """The value of a register."""
        request = self.FRAMING.read(id_, register.address, register.size)
        (status,) = self._ask(request, (id_,), register.size)
        self.check(status, f"a read of register {register.address}")
        return register.decode(status.parameters)

    def write(self, id_: int, register: Register, value: int) -> None:
        """Set a register and wait for the confirmation."""
        request = self.FRAMING.write(id_, register.address, register.encode(value))
        (status,) = self._ask(request, (id_,), 0)
        self.check(status, f"{value} in register {register.address}")

    def sync_write(self, register: Register, values: Sequence[tuple[int, int]]) -> None:
        """Set a register of several servos to (id, value) each, without confirmation."""
        encoded = [(id_, register.encode(value)) for id_, value in values]
        self.send(self.FRAMING.sync_write(register.address, register.size, encoded))

    def send(self, requests: bytes) -> None:
        """Send requests that no servo answers."""
        now = self._clock()
        self.silence = max(self.silence, now - self.sent_at)
        self.sent_at = now
        self._port.write(requests)

    def present(self, orders: bytes = b"") -> list[Any]:
        """The measurements of all servos, in the order of the axes; each measures when it answers.

        `orders` are requests that no servo answers. They leave immediately before, in one message, so that a guardian
        sees both as one. While a late answer may come they leave alone: what makes servos safe does not wait.
        """
        if self._unsettled and orders:
            self.send(orders)
            orders = b""
        statuses = self._ask(orders + self._ask_present, self.ids, self.PRESENT[1])
        for status in statuses:
            self._check_present(status)
        return [self.decoded(status.parameters) for status in statuses]

    @staticmethod
    def decoded(data: bytes) -> Any:
        """What a servo measures."""
        raise NotImplementedError

    def _check_present(self, status: Status) -> None:
        self.check(status, "a read of what it measures")

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
                fits = len(status.parameters) == size or status.error & self.FRAMING.REFUSAL
                if len(statuses) < len(ids) and status.id == ids[len(statuses)] and fits:
                    statuses.append(status)
        self._unsettled = False
        return statuses

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


Bus = TypeVar("Bus", bound=ServoBus)


class Servos(Generic[Bus]):
    """All servos of an arm; a subclass says what they are, and sets them up."""

    TORQUE: ClassVar[Register]  # whether the torque is on
    KIND: ClassVar[str]

    def __init__(self, bus: Bus) -> None:
        self.bus = bus
        self._next = 0

    def advice(self) -> str:
        """What to check where none answers."""
        raise NotImplementedError

    def find(self) -> None:
        """Check that all are there; raises HardwareFault with what to check."""
        bus = self.bus
        missing = [id_ for id_ in bus.ids if not self._answers(id_)]
        if len(missing) == len(bus.ids):
            raise HardwareFault(f"{bus.path}: no {self.KIND} answers at {bus.baud} bit/s: check {self.advice()}")
        if missing:
            raise HardwareFault(
                f"{', '.join(map(bus.label, missing))}: no answer at {bus.baud} bit/s, but others answer: check the "
                "cable to it, its id and its baud rate"
            )

    def watch(self) -> None:
        """Check the torque of one servo, in turn, since its measurements do not show it; HardwareFault if it is off."""
        ids = self.bus.ids
        self.check_torque(ids[self._next])
        self._next = (self._next + 1) % len(ids)

    def check_torque(self, id_: int) -> None:
        if not self.bus.read(id_, self.TORQUE):
            raise HardwareFault(f"{self.bus.label(id_)}: its torque is off; was it without power?")

    def read(self, id_: int, register: Register) -> int:
        """A register, with patience."""
        return self.bus.insist(lambda: self.bus.read(id_, register))

    def write(self, id_: int, register: Register, value: int) -> None:
        self.bus.insist(lambda: self.bus.write(id_, register, value))

    def _answers(self, id_: int) -> bool:
        try:
            self.bus.insist(lambda: self.bus.ping(id_))
        except BadReply:
            return False
        return True
