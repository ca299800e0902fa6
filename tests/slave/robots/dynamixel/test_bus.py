"""Requests and answers over a real pseudo terminal, with a peer that answers as the test says."""

import os
import tty
from collections.abc import Callable, Iterator
from contextlib import suppress
from select import select
from threading import Event, Thread

import pytest

from weberlink.hardware.fault import BadReply, HardwareFault
from weberlink.hardware.serial_port import SerialPort
from weberlink.slave.robots.dynamixel import packet, registers
from weberlink.slave.robots.dynamixel.bus import MARK_SIZES, MotorBus, MotorReading
from weberlink.slave.robots.dynamixel.packet import (
    ALERT,
    Packet,
    PacketReader,
    StatusPacket,
    encode_packet,
    encode_status,
)

IDS = (11, 12, 13, 14)
PATIENCE = 10.0
Answer = Callable[[Packet], list[bytes]]


def measured(current: int, velocity: int, position: int) -> bytes:
    return b"".join(
        register.encode(value)
        for register, value in (
            (registers.PRESENT_CURRENT, current),
            (registers.PRESENT_VELOCITY, velocity),
            (registers.PRESENT_POSITION, position),
        )
    )


def all_motors(request: Packet) -> list[bytes]:
    """What they measure; to a read of one of them, as many bytes as were asked for."""
    if request.instruction == packet.READ:
        size = int.from_bytes(request.parameters[2:4], "little")
        return [encode_status(StatusPacket(request.id, 0, bytes(size)))]
    return [encode_status(StatusPacket(id_, 0, measured(-id_, 10 * id_, 2048 - id_))) for id_ in IDS]


EXPECTED = [MotorReading(-id_, 10 * id_, 2048 - id_) for id_ in IDS]


class Peer:
    """Motors that say what `answer` makes of each request; what it does not make, they do not say."""

    def __init__(self) -> None:
        self.near, self.far = os.openpty()
        tty.setraw(self.far)
        self.path = os.ttyname(self.far)
        self.answer: Answer = all_motors
        self.heard: list[Packet] = []
        self._reader = PacketReader()
        self._stopping = Event()
        self._thread = Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        while not self._stopping.is_set():
            ready, _, _ = select((self.near,), (), (), 0.01)
            if not ready:
                continue
            for request in self._reader.feed(os.read(self.near, 4096)):
                self.heard.append(request)
                for part in self.answer(request):
                    os.write(self.near, part)

    def stop(self) -> None:
        self._stopping.set()
        self._thread.join()
        for descriptor in (self.near, self.far):
            with suppress(OSError):
                os.close(descriptor)


@pytest.fixture
def peer() -> Iterator[Peer]:
    peer = Peer()
    yield peer
    peer.stop()


@pytest.fixture
def bus(peer: Peer) -> Iterator[MotorBus]:
    port = SerialPort(peer.path, 1_000_000)
    # The longest patience that a test has to sit out; far more than an answer needs.
    yield MotorBus(port, 1_000_000, IDS, margin=0.25)
    port.close()


def test_a_motor_says_what_it_is(peer: Peer, bus: MotorBus) -> None:
    peer.answer = lambda request: [encode_status(StatusPacket(request.id, 0, b"\xfc\x03\x2d"))]
    assert bus.ping(12) == 1020
    assert peer.heard == [packet.ping(12)]


def test_a_register_is_read_with_its_sign(peer: Peer, bus: MotorBus) -> None:
    peer.answer = lambda request: [encode_status(StatusPacket(request.id, 0, b"\xff"))]
    assert bus.read(11, registers.BUS_WATCHDOG) == -1
    assert peer.heard == [packet.read(11, 98, 1)]


def test_a_register_is_written_and_the_motor_heard_it(peer: Peer, bus: MotorBus) -> None:
    peer.answer = lambda request: [encode_status(StatusPacket(request.id, 0))]
    bus.write(13, registers.GOAL_CURRENT, -300)
    assert peer.heard == [packet.write(13, 102, b"\xd4\xfe")]


def test_all_motors_are_read_at_once(peer: Peer, bus: MotorBus) -> None:
    assert bus.present() == EXPECTED
    assert peer.heard == [packet.sync_read(126, 10, IDS)]


def test_goals_go_to_all_and_nobody_answers(peer: Peer, bus: MotorBus) -> None:
    bus.sync_write(registers.GOAL_CURRENT, [(11, 5), (12, -5)])
    assert bus.present() == EXPECTED
    assert peer.heard[0] == packet.sync_write(102, 2, [(11, b"\x05\x00"), (12, b"\xfb\xff")])


def test_it_does_not_matter_how_answers_come_nor_what_strays_between(peer: Peer, bus: MotorBus) -> None:
    def in_pieces(request: Packet) -> list[bytes]:
        stream = encode_packet(request) + b"\x00\xff\xff" + b"".join(all_motors(request))
        stray = encode_status(StatusPacket(15, 0, measured(1, 2, 3)))
        return [stray] + [stream[i : i + 7] for i in range(0, len(stream), 7)]

    peer.answer = in_pieces
    assert bus.present() == EXPECTED


@pytest.mark.parametrize("missing", [0, 2, 3])
def test_a_missing_answer_is_named(peer: Peer, bus: MotorBus, missing: int) -> None:
    peer.answer = lambda request: [part for index, part in enumerate(all_motors(request)) if index != missing]
    with pytest.raises(BadReply, match=rf"^joint {missing + 1} \(id {IDS[missing]}\): its answer was missing or late$"):
        bus.present()


def test_a_garbled_answer_is_named(peer: Peer, bus: MotorBus) -> None:
    def garbled(request: Packet) -> list[bytes]:
        parts = all_motors(request)
        parts[1] = parts[1][:12] + bytes([parts[1][12] ^ 0x10]) + parts[1][13:]
        return parts

    peer.answer = garbled
    with pytest.raises(BadReply, match=r"^joint 2 \(id 12\): its answer was garbled$"):
        bus.present()
    peer.answer = all_motors
    assert bus.present() == EXPECTED


def test_an_answer_that_came_too_late_is_not_taken_for_the_next(peer: Peer, bus: MotorBus) -> None:
    released, said = Event(), Event()

    def late(_request: Packet) -> list[bytes]:
        released.wait(PATIENCE)
        os.write(peer.near, b"".join(encode_status(StatusPacket(id_, 0, measured(1, 1, 1))) for id_ in IDS))
        said.set()
        return []

    peer.answer = late
    with pytest.raises(BadReply, match="late"):
        bus.present()
    released.set()
    assert said.wait(PATIENCE)
    peer.answer = all_motors
    assert bus.present() == EXPECTED


def test_what_strays_in_between_requests_is_not_taken_for_an_answer(peer: Peer, bus: MotorBus) -> None:
    assert bus.present() == EXPECTED
    os.write(peer.near, b"".join(encode_status(StatusPacket(id_, 0, measured(1, 1, 1))) for id_ in IDS))
    select((peer.far,), (), (), PATIENCE)
    assert bus.present() == EXPECTED


class ScriptedPort:
    """That gives what it is told to, read by read."""

    path = "/dev/scripted"

    def __init__(self, *reads: bytes) -> None:
        self._reads = iter(reads)

    def write(self, data: bytes) -> None:
        pass

    def read(self, until: float) -> bytes:
        return next(self._reads)

    def drain(self) -> bytes:
        return b""

    def close(self) -> None:
        pass


def test_an_answer_that_is_still_under_way_is_awaited_before_the_next_request() -> None:
    old, new = (encode_status(StatusPacket(11, 0, bytes([value]))) for value in (1, 3))
    mark = encode_status(StatusPacket(11, 0, bytes(MARK_SIZES[0])))
    bus = MotorBus(ScriptedPort(b"", old, b"", mark, new), 1_000_000, IDS, 0.0, lambda: 0.0, lambda _: None)
    with pytest.raises(BadReply, match="late"):
        bus.read(11, registers.TORQUE_ENABLE)
    assert bus.read(11, registers.OPERATING_MODE) == 3


def test_an_answer_of_the_wrong_length_is_bad(peer: Peer, bus: MotorBus) -> None:
    peer.answer = lambda request: [encode_status(StatusPacket(request.id, 0, b"\x01\x02"))]
    with pytest.raises(BadReply, match="answered 2 bytes instead of 1"):
        bus.read(11, registers.TORQUE_ENABLE)


def test_a_refusal_says_what_and_why(peer: Peer, bus: MotorBus) -> None:
    peer.answer = lambda request: [encode_status(StatusPacket(request.id, packet.DATA_RANGE_ERROR))]
    with pytest.raises(
        HardwareFault, match=r"joint 4 \(id 14\) refuses 9 in register 102: value out of range"
    ) as caught:
        bus.write(14, registers.GOAL_CURRENT, 9)
    assert not isinstance(caught.value, BadReply)


def test_a_request_that_arrived_garbled_may_be_made_again(peer: Peer, bus: MotorBus) -> None:
    peer.answer = lambda request: [encode_status(StatusPacket(request.id, packet.CRC_ERROR))]
    with pytest.raises(BadReply, match="arrived there garbled"):
        bus.write(14, registers.GOAL_CURRENT, 9)


@pytest.mark.parametrize(
    ("bits", "says"), [(0x20, "overload"), (0x04, "overheating"), (0x01, "voltage"), (0x24, "overheating.*overload")]
)
def test_an_alarm_is_looked_up(peer: Peer, bus: MotorBus, bits: int, says: str) -> None:
    def alarmed(request: Packet) -> list[bytes]:
        if request.instruction == packet.READ:
            assert request == packet.read(13, 70, 1)
            return [encode_status(StatusPacket(13, ALERT, bytes([bits])))]
        return [encode_status(StatusPacket(id_, ALERT if id_ == 13 else 0, measured(0, 0, 0))) for id_ in IDS]

    peer.answer = alarmed
    with pytest.raises(HardwareFault, match=rf"^joint 3 \(id 13\): .*{says}.*") as caught:
        bus.present()
    assert not isinstance(caught.value, BadReply)


def test_a_port_that_is_gone_is_no_bad_reply(peer: Peer, bus: MotorBus) -> None:
    peer.answer = lambda _: []
    peer.stop()
    with pytest.raises(HardwareFault, match="unplugged") as caught:
        bus.present()
    assert not isinstance(caught.value, BadReply)
