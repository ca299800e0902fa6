"""The wires of both kinds of servos: frames of any bytes, cut anywhere, spoilt anywhere."""

from collections.abc import Callable
from typing import Any, NamedTuple

import pytest
from hypothesis import example, given, strategies as st

from weberlink_arms.dynamixel import packet as of_dynamixel
from weberlink_arms.dynamixel.packet import FRAMING as DYNAMIXEL, crc16
from weberlink_arms.feetech import packet as of_feetech
from weberlink_arms.feetech.packet import FRAMING as FEETECH
from weberlink_arms.servo.packet import Framing, Packet, Status


class Wire(NamedTuple):
    """A protocol, in one direction."""

    framing: Framing
    reader: Callable[[], Any]  # of a stream
    frame: Callable[..., Any]  # of an id, a code and parameters
    header: bytes
    width: int  # of the length field
    lengths: tuple[int, int]  # the least and the largest that a reader waits for

    def encode(self, frame: Any) -> bytes:
        return self.framing.encode(frame)

    def claim(self, length: int) -> bytes:
        """The beginning of a frame with this length."""
        return self.header + b"\x01" + length.to_bytes(self.width, "little")


LENGTHS = {2: (3, of_dynamixel.LONGEST - 7), 1: (2, of_feetech.LONGEST_LENGTH)}
WIRES = {
    f"{name} {kind.__name__}": Wire(framing, reader, kind, header, width, LENGTHS[width])
    for name, framing, header, width in (
        ("dynamixel", DYNAMIXEL, of_dynamixel.HEADER, 2),
        ("feetech", FEETECH, of_feetech.HEADER, 1),
    )
    for kind, reader in ((Packet, framing.requests), (Status, framing.answers))
}
every_wire = pytest.mark.parametrize("wire", WIRES.values(), ids=WIRES)
# Rich in what looks like a header, where stuffing matters.
tricky = st.lists(st.sampled_from([b"\xff", b"\xfd", b"\x00", b"\xff\xff\xfd", b"\x01"]), max_size=40).map(b"".join)
contents = st.tuples(st.integers(0, 252), st.sampled_from([1, 2, 3, 8, 0x82, 0x83]), tricky | st.binary(max_size=60))


@every_wire
@given(st.lists(contents, max_size=5), st.lists(st.integers(0, 250), max_size=8))
@example([(1, 1, b"")] * 2, list(range(30)))
@example([(0, 1, bytes(range(200))), (252, 2, b"\xff\xff\xfd")], [3, 4, 5, 6, 7, 8])
def test_frames_come_back_however_the_stream_is_cut(
    wire: Wire, sent: list[tuple[int, int, bytes]], cuts: list[int]
) -> None:
    frames = [wire.frame(*each) for each in sent]
    stream = b"".join(map(wire.encode, frames))
    reader, ends = wire.reader(), sorted(min(cut, len(stream)) for cut in cuts)
    heard = [
        frame
        for begin, end in zip([0, *ends], [*ends, len(stream)], strict=True)
        for frame in reader.feed(stream[begin:end])
    ]
    assert heard == frames
    assert reader.bad == 0


@every_wire
@given(contents, st.data())
@example((3, 1, b"\x01\x02"), None)
def test_a_changed_byte_is_noticed(wire: Wire, content: tuple[int, int, bytes], data: st.DataObject | None) -> None:
    frame = wire.frame(*content)
    whole = wire.encode(frame)
    changes = [(at, 1) for at in range(len(whole))]
    if data is not None:
        changes = [(data.draw(st.integers(0, len(whole) - 1)), data.draw(st.integers(1, 255)))]
    for at, change in changes:
        assert frame not in wire.reader().feed(whole[:at] + bytes((whole[at] ^ change,)) + whole[at + 1 :])


@every_wire
@given(st.binary(max_size=200) | tricky)
def test_no_noise_keeps_a_frame_from_being_heard(wire: Wire, noise: bytes) -> None:
    """After as many zeros as the longest frame has bytes."""
    reader, frame = wire.reader(), wire.frame(3, 1, b"ok")
    reader.feed(noise)
    assert reader.feed(bytes(1100) + wire.encode(frame))[-1] == frame


@every_wire
def test_what_waits_is_forgotten(wire: Wire) -> None:
    reader, whole = wire.reader(), wire.encode(wire.frame(3, 1, b"ok"))
    reader.feed(whole[:-1])
    reader.clear()
    assert reader.feed(whole[-1:]) == []
    assert reader.feed(whole) == [wire.frame(3, 1, b"ok")]


@every_wire
@pytest.mark.parametrize(("end", "beyond"), [(0, -1), (0, 0), (1, 0), (1, 1)])
def test_only_a_length_that_can_be_is_waited_for(wire: Wire, end: int, beyond: int) -> None:
    """A frame with another length is passed over at once."""
    reader, frame = wire.reader(), wire.frame(3, 1, b"ok")
    length = wire.lengths[end] + beyond
    heard = reader.feed(wire.claim(length) + (wire.encode(frame) if beyond else bytes(length - 1)))
    assert heard == ([frame] if beyond else [])
    if not beyond:  # the last byte of the frame is still missing: it is judged with that
        reader.feed(b"\xee")
        assert reader.bad == 1


def test_checksum_has_its_catalogued_check_value() -> None:
    assert crc16(b"") == 0
    assert crc16(b"123456789") == 0xFEE8  # the check value of CRC-16/BUYPASS, also called CRC-16/UMTS


@given(contents)
def test_stuffing_keeps_headers_out_of_frames(content: tuple[int, int, bytes]) -> None:
    wire = DYNAMIXEL.encode(Status(*content))
    assert wire.find(of_dynamixel.HEADER, 1) == -1
    assert int.from_bytes(wire[5:7], "little") == len(wire) - 7


@given(contents, contents, st.data())
@example((1, 0, b"\x07"), (2, 0, b""), None)
def test_a_frame_cut_short_does_not_swallow_the_next(
    cut: tuple[int, int, bytes], whole: tuple[int, int, bytes], data: st.DataObject | None
) -> None:
    """Of Dynamixel motors, whose headers are unique."""
    wire, next_ = DYNAMIXEL.encode(Status(*cut)), Status(*whole)
    lengths = range(len(wire)) if data is None else [data.draw(st.integers(0, len(wire) - 1))]
    for kept in lengths:
        reader = DYNAMIXEL.answers()
        assert reader.feed(wire[:kept] + DYNAMIXEL.encode(next_)) == [next_]


def test_readers_skip_packets_of_the_other_kind() -> None:
    status, request = Status(1, 0, b"\x07"), Packet(1, 1)
    both = DYNAMIXEL.encode(request) + DYNAMIXEL.encode(status)
    assert DYNAMIXEL.answers().feed(both) == [status]
    assert DYNAMIXEL.requests().feed(both) == [request]
    headless = Packet(1, of_dynamixel.STATUS)  # without an error byte
    assert DYNAMIXEL.answers().feed(DYNAMIXEL.encode(headless)) == []
