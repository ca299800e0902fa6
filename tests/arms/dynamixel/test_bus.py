"""Requests and answers of the bus, on a port that answers as the test says; the PTY is tested with the driver."""

from collections import deque
from collections.abc import Callable
from pathlib import Path

import pytest

from weberlink.arms.dynamixel import packet, registers
from weberlink.arms.dynamixel.bus import MARK_SIZES, MotorBus, MotorReading, latency_advice, latency_ms
from weberlink.arms.dynamixel.packet import (
    ALERT,
    Packet,
    PacketReader,
    StatusPacket,
    encode_packet,
    encode_status,
)
from weberlink.hardware.fault import BadReply, HardwareFault

IDS = (11, 12, 13, 14)
EXPECTED = [MotorReading(-id_, 10 * id_, 2048 - id_) for id_ in IDS]


def status(id_: int, error: int = 0, data: bytes = b"") -> bytes:
    return encode_status(StatusPacket(id_, error, data))


def measured(current: int, velocity: int, position: int) -> bytes:
    return (
        registers.PRESENT_CURRENT.encode(current)
        + registers.PRESENT_VELOCITY.encode(velocity)
        + registers.PRESENT_POSITION.encode(position)
    )


def all_motors(request: Packet) -> list[bytes]:
    """Measurements of all motors; to a read of one motor, as many zero bytes as it asks for."""
    if request.instruction == packet.READ:
        return [status(request.id, 0, bytes(int.from_bytes(request.parameters[2:4], "little")))]
    return [status(id_, 0, measured(-id_, 10 * id_, 2048 - id_)) for id_ in IDS]


class AnsweringPort:
    """Answers each request with what `answer` gives, read by read; an empty read is a timeout."""

    path = "/dev/answering"

    def __init__(self) -> None:
        self.answer: Callable[[Packet], list[bytes]] = all_motors
        self.reads: deque[bytes] = deque()
        self.heard: list[Packet] = []
        self._reader = PacketReader()

    def write(self, data: bytes) -> None:
        for request in self._reader.feed(data):
            self.heard.append(request)
            self.reads += self.answer(request)

    def read(self, until: float) -> bytes:
        return self.reads.popleft() if self.reads else b""

    def drain(self) -> bytes:
        drained = b"".join(self.reads)
        self.reads.clear()
        return drained

    def close(self) -> None:
        pass


@pytest.fixture
def port() -> AnsweringPort:
    return AnsweringPort()


@pytest.fixture
def bus(port: AnsweringPort) -> MotorBus:
    return MotorBus(port, 1_000_000, IDS, 0.0, lambda: 0.0, lambda _: None)


def test_all_motors_are_read_at_once(port: AnsweringPort, bus: MotorBus) -> None:
    assert bus.present() == EXPECTED
    assert port.heard == [packet.sync_read(126, 10, IDS)]


def test_fragments_and_stray_packets_are_tolerated(port: AnsweringPort, bus: MotorBus) -> None:
    def in_pieces(request: Packet) -> list[bytes]:
        stream = encode_packet(request) + b"\x00\xff\xff" + b"".join(all_motors(request))
        return [status(15, 0, measured(1, 2, 3))] + [stream[i : i + 7] for i in range(0, len(stream), 7)]

    port.answer = in_pieces
    assert bus.present() == EXPECTED
    port.answer = all_motors
    port.reads += [status(id_, 0, measured(1, 1, 1)) for id_ in IDS]
    assert bus.present() == EXPECTED


@pytest.mark.parametrize("missing", [0, 2, 3])
def test_a_missing_answer_is_named(port: AnsweringPort, bus: MotorBus, missing: int) -> None:
    port.answer = lambda request: [part for index, part in enumerate(all_motors(request)) if index != missing]
    with pytest.raises(BadReply, match=rf"^joint {missing + 1} \(id {IDS[missing]}\): its answer was missing or late$"):
        bus.present()


def test_a_garbled_answer_is_named(port: AnsweringPort, bus: MotorBus) -> None:
    def garbled(request: Packet) -> list[bytes]:
        parts = all_motors(request)
        parts[1] = parts[1][:12] + bytes([parts[1][12] ^ 0x10]) + parts[1][13:]
        return parts

    port.answer = garbled
    with pytest.raises(BadReply, match=r"^joint 2 \(id 12\): its answer was garbled$"):
        bus.present()
    port.answer = all_motors
    assert bus.present() == EXPECTED


def test_late_answer_is_not_taken_for_the_next(port: AnsweringPort, bus: MotorBus) -> None:
    """The late answer arrives after the next request, and before the answer of a unique size that ends the wait."""
    old, new = status(11, 0, b"\x01"), status(11, 0, b"\x03")
    port.answer = lambda _: []
    with pytest.raises(BadReply, match="late"):
        bus.read(11, registers.TORQUE_ENABLE)
    answers = iter([[old, status(11, 0, bytes(MARK_SIZES[0]))], [new]])
    port.answer = lambda _: next(answers)
    assert bus.read(11, registers.OPERATING_MODE) == 3


def test_a_refusal_says_what_and_why(port: AnsweringPort, bus: MotorBus) -> None:
    port.answer = lambda request: [status(request.id, packet.DATA_RANGE_ERROR)]
    with pytest.raises(
        HardwareFault, match=r"joint 4 \(id 14\) refuses 9 in register 102: value out of range"
    ) as caught:
        bus.write(14, registers.GOAL_CURRENT, 9)
    assert not isinstance(caught.value, BadReply)


def test_garbled_request_is_a_bad_reply(port: AnsweringPort, bus: MotorBus) -> None:
    port.answer = lambda request: [status(request.id, packet.CRC_ERROR)]
    with pytest.raises(BadReply, match="received a garbled request"):
        bus.write(14, registers.GOAL_CURRENT, 9)


@pytest.mark.parametrize(
    ("bits", "says"),
    [(0x20, "overload"), (0x04, "overheating"), (0x01, "3.1 V"), (0x24, "overheating.*overload")],
)
def test_an_alarm_is_looked_up(port: AnsweringPort, bus: MotorBus, bits: int, says: str) -> None:
    def alarmed(request: Packet) -> list[bytes]:
        if request.instruction == packet.READ:
            if request == packet.read(13, 144, 2):
                return [status(13, ALERT, b"\x1f\x00")]
            assert request == packet.read(13, 70, 1)
            return [status(13, ALERT, bytes([bits]))]
        return [status(id_, ALERT if id_ == 13 else 0, measured(0, 0, 0)) for id_ in IDS]

    port.answer = alarmed
    with pytest.raises(HardwareFault, match=rf"^joint 3 \(id 13\): .*{says}.*") as caught:
        bus.present()
    assert not isinstance(caught.value, BadReply)


@pytest.fixture
def sysfs(tmp_path: Path) -> Path:
    for name, text in (("ttyUSB0", "16\n"), ("ttyUSB1", "1\n"), ("ttyUSB2", "soon\n")):
        (tmp_path / name).mkdir()
        (tmp_path / name / "latency_timer").write_text(text)
    return tmp_path


def test_slow_adapter_advice_contains_the_command(sysfs: Path) -> None:
    assert latency_ms("/dev/ttyUSB0", sysfs) == 16
    advice = latency_advice("/dev/ttyUSB0", sysfs)
    assert advice is not None
    assert "echo 1 | sudo tee /sys/bus/usb-serial/devices/ttyUSB0/latency_timer" in advice
    assert "49-weberlink.rules" in advice
    assert "\n" not in advice


@pytest.mark.parametrize("port", ["/dev/ttyUSB1", "/dev/ttyUSB2", "/dev/ttyUSB3"])
def test_no_advice_without_need(port: str, sysfs: Path) -> None:
    assert latency_advice(port, sysfs) is None
