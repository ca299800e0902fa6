"""The buses of both kinds of servos, on a port that answers as the test says."""

from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from weberlink.hardware.fault import BadReply, HardwareFault
from weberlink_arms.dynamixel import packet as dynamixel, registers as dynamixel_registers
from weberlink_arms.dynamixel.bus import MotorBus, MotorReading, latency_advice, latency_ms
from weberlink_arms.feetech import registers as feetech_registers
from weberlink_arms.feetech.bus import FeetechBus
from weberlink_arms.feetech.registers import Present
from weberlink_arms.servo.packet import READ, SYNC_READ, SYNC_WRITE, Status

IDS = (11, 12, 13, 14)
NAMES = ("pan", "lift", "flex", "roll")
BAUD, MARGIN_S, ADAPTER_S = 1_000_000, 0.01, 0.0002
DYNAMIXEL, FEETECH = MotorBus.FRAMING, FeetechBus.FRAMING


class Kind(NamedTuple):
    """Of a bus."""

    bus: type[Any]
    mode: Any  # a register of a byte
    data: Callable[[int], bytes]  # of the measurements of an id
    expected: Callable[[int], Any]  # what they mean
    request: int  # bytes of the request for them


def motor_data(id_: int) -> bytes:
    """Current, velocity and position."""
    return (-id_).to_bytes(2, "little", signed=True) + (10 * id_).to_bytes(4, "little") + bytes((id_, 8, 0, 0))


def servo_data(id_: int) -> bytes:
    """Position, velocity, load, volts, temperature, four of no use, current."""
    return bytes((id_, 8, id_, 0x80, id_, 4, 74, 30, 0, 0, 0, 0, 0, id_, 0x80))


KINDS = {
    "dynamixel": Kind(
        MotorBus, dynamixel_registers.OPERATING_MODE, motor_data,
        lambda id_: MotorReading(-id_, 10 * id_, 2048 + id_), 18,
    ),
    "feetech": Kind(
        FeetechBus, feetech_registers.MODE, servo_data,
        lambda id_: Present(2048 + id_, -id_, -id_, 74, 30, id_), 12,
    ),
}  # fmt: skip


class Wired:
    """A bus and its port, which answers each request with what `reply` gives, well until a test changes that, read by
    read; an empty read is a timeout."""

    path = "/dev/answering"

    def __init__(self, kind: Kind) -> None:
        self.kind, self.framing = kind, kind.bus.FRAMING
        self.reply: Callable[[Any], Sequence[bytes]] = self.good
        self.reads: deque[bytes] = deque()
        self.heard: list[Any] = []
        self.paused: list[float] = []
        self.until: list[float] = []
        self._reader = self.framing.requests()
        self.bus = kind.bus(self, BAUD, IDS, NAMES, MARGIN_S, lambda: 5.0, self.paused.append)

    def write(self, data: bytes) -> None:
        for request in self._reader.feed(data):
            self.heard.append(request)
            self.reads += self.reply(request)

    def read(self, until: float) -> bytes:
        self.until.append(until)
        return self.reads.popleft() if self.reads else b""

    def drain(self) -> bytes:
        drained = b"".join(self.reads)
        self.reads.clear()
        return drained

    def answer(self, id_: int, error: int, data: bytes) -> bytes:
        return bytes(self.framing.encode(Status(id_, error, data)))

    def good(self, request: Any) -> list[bytes]:
        """To a read of one servo, as many zeros as it asks for."""
        if request.instruction == READ:
            return [self.answer(request.id, 0, bytes(self.framing.number(request.parameters, 1)))]
        return [self.answer(id_, 0, self.kind.data(id_)) for id_ in IDS]

    def measured(self) -> bool:
        return bool(self.bus.present() == [self.kind.expected(id_) for id_ in IDS])

    def one(self) -> int:
        """A register of id 11."""
        return int(self.bus.read(11, self.kind.mode))


@pytest.fixture(params=KINDS)
def wired(request: pytest.FixtureRequest) -> Wired:
    return Wired(KINDS[request.param])


def test_all_are_measured_at_once_and_in_time(wired: Wired) -> None:
    """The host sleeps while the bytes are on the wire, and waits for the margin beyond that."""
    assert wired.measured()
    (request,) = wired.heard
    assert request.instruction == SYNC_READ and request.parameters[-len(IDS) :] == bytes(IDS)
    wire_s = (wired.kind.request + len(IDS) * 21) * 10 / BAUD
    assert wired.paused == pytest.approx([wire_s + ADAPTER_S])
    assert wired.until == pytest.approx([5.0 + wire_s + MARGIN_S] * len(IDS))


def test_fragments_and_strays_are_tolerated(wired: Wired) -> None:
    kind, answer = wired.kind, wired.answer

    def in_pieces(request: Any) -> list[bytes]:
        stream = b"\x00\xff\xff" + b"".join(wired.good(request))
        return [answer(15, 0, kind.data(15))] + [stream[i : i + 7] for i in range(0, len(stream), 7)]

    wired.reply = in_pieces
    assert wired.measured()
    wired.reply = wired.good
    wired.reads += [answer(id_, 0, kind.data(1)) for id_ in IDS]  # of an earlier request
    assert wired.measured()


@pytest.mark.parametrize("missing", range(len(IDS)))
@pytest.mark.parametrize("is_garbled", [False, True])
def test_a_missing_or_garbled_answer_is_named_and_the_next_is_good(
    wired: Wired, missing: int, is_garbled: bool
) -> None:
    def spoilt(request: Any) -> list[bytes]:
        parts = wired.good(request)
        spoilt = parts[missing][:-1] + bytes((parts[missing][-1] ^ 0x10,))
        return [*parts[:missing], *([spoilt] if is_garbled else []), *parts[missing + 1 :]]

    wired.reply = spoilt
    complaint = "garbled" if is_garbled else "missing or late"
    with pytest.raises(BadReply, match=rf"^{NAMES[missing]} \(id {IDS[missing]}\): its answer was {complaint}"):
        wired.bus.present()
    wired.reply = wired.good
    assert wired.measured()


def test_a_late_answer_is_not_taken_for_the_next(wired: Wired) -> None:
    """It arrives after the next request, and before the answer of a size of its own that ends the wait."""
    answer, asked = wired.answer, wired.heard
    wired.reply = lambda _: []
    for _ in range(2):  # the answer of the unique size is missing too
        with pytest.raises(BadReply, match="late"):
            wired.one()
    late = answer(11, 0, b"\x01")
    wired.reply = lambda request: (
        [late, *wired.good(request)] if request is asked[-1] and len(asked) == 3 else [answer(11, 0, b"\x03")]
    )
    assert wired.one() == 3


@pytest.mark.parametrize(
    ("error", "kind", "says"),
    [
        (dynamixel.DATA_RANGE_ERROR, HardwareFault, r"roll \(id 14\) refuses 9 in register 102: value out of range"),
        (dynamixel.CRC_ERROR, BadReply, "garbled request"),
    ],
)
def test_a_refusal_is_a_fault_and_a_garbled_request_is_none(error: int, kind: type[Exception], says: str) -> None:
    wired = Wired(KINDS["dynamixel"])
    wired.reply = lambda request: [DYNAMIXEL.encode(Status(request.id, error))]
    with pytest.raises(HardwareFault, match=says) as caught:
        wired.bus.write(14, dynamixel_registers.GOAL_CURRENT, 9)
    assert type(caught.value) is kind


def test_an_error_of_a_servo_is_a_fault_of_the_exchange_alone() -> None:
    """Of Feetech servos, which tell all of it in the error byte; a single register is read all the same."""
    wired = Wired(KINDS["feetech"])
    for error, says in ((32, "overload"), (1, r"7\.4 V"), (4, "overheating")):
        wired.reply = lambda request, error=error: [
            FEETECH.encode(Status(id_, error * (id_ == 12), servo_data(id_))) for id_ in IDS
        ]
        with pytest.raises(HardwareFault, match=rf"^lift \(id 12\): .*{says}"):
            wired.bus.present()
    wired.reply = lambda request: [FEETECH.encode(Status(11, 32, b"\x03"))]
    assert wired.one() == 3


def test_orders_leave_before_the_request_and_alone_while_a_late_answer_may_come() -> None:
    """What makes servos safe does not wait."""
    wired = Wired(KINDS["feetech"])
    order = FEETECH.sync_write(40, 1, [(11, b"\0")])
    wired.bus.present(order)
    assert [each.instruction for each in wired.heard] == [SYNC_WRITE, SYNC_READ]
    wired.reply = lambda _: []
    with pytest.raises(BadReply):
        wired.bus.present(order)
    wired.reply, wired.heard = wired.good, []
    wired.bus.present(order)
    assert [each.instruction for each in wired.heard] == [SYNC_WRITE, READ, SYNC_READ]


@pytest.mark.parametrize(("text", "latency"), [("16\n", 16), ("1\n", 1), ("soon\n", None)])
def test_a_slow_adapter_is_advised_to_be_quicker(tmp_path: Path, text: str, latency: int | None) -> None:
    (tmp_path / "ttyUSB0").mkdir()
    (tmp_path / "ttyUSB0" / "latency_timer").write_text(text)
    assert latency_ms("/dev/ttyUSB0", tmp_path) == latency
    assert (latency_advice("/dev/ttyUSB0", tmp_path) is not None) is (latency == 16)
    assert latency_advice("/dev/ttyUSB9", tmp_path) is None
