"""Protocol 2.0 against the vendor's examples, and its laws on any bytes."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from weberlink.arms.dynamixel import packet
from weberlink.arms.dynamixel.packet import (
    HEADER,
    LONGEST,
    Packet,
    PacketReader,
    StatusPacket,
    StatusPacketReader,
    crc16,
    encode_packet,
    encode_status,
)

# Rich in what looks like a header, where stuffing matters.
tricky = st.lists(st.sampled_from([b"\xff", b"\xfd", b"\x00", b"\x55", b"\xff\xff\xfd", b"\x01"]), max_size=40).map(
    b"".join
)
contents = st.one_of(tricky, st.binary(max_size=60))
ids = st.integers(0, packet.HIGHEST_ID)
statuses = st.builds(StatusPacket, ids, st.integers(0, 255), contents)
instructions = st.builds(
    Packet,
    st.one_of(ids, st.just(packet.BROADCAST)),
    st.sampled_from([packet.PING, packet.READ, packet.WRITE, packet.SYNC_READ, packet.SYNC_WRITE]),
    contents,
)


@pytest.mark.parametrize(
    ("request_", "wire"),
    [
        (packet.ping(1), "ff ff fd 00 01 03 00 01 19 4e"),
        (packet.read(1, 132, 4), "ff ff fd 00 01 07 00 02 84 00 04 00 1d 15"),
        (packet.write(1, 116, (512).to_bytes(4, "little")), "ff ff fd 00 01 09 00 03 74 00 00 02 00 00 ca 89"),
    ],
)
def test_requests_are_those_of_the_manual(request_: Packet, wire: str) -> None:
    assert encode_packet(request_) == bytes.fromhex(wire)
    assert PacketReader().feed(bytes.fromhex(wire)) == [request_]


def test_checksum_has_its_catalogued_check_value() -> None:
    assert crc16(b"") == 0
    assert crc16(b"123456789") == 0xFEE8  # the check value of CRC-16/BUYPASS, also called CRC-16/UMTS


@given(instructions)
def test_an_instruction_comes_back_as_it_went(request_: Packet) -> None:
    assert PacketReader().feed(encode_packet(request_)) == [request_]


@given(statuses)
def test_status_round_trip_without_inner_header(status: StatusPacket) -> None:
    wire = encode_status(status)
    assert StatusPacketReader().feed(wire) == [status]
    assert wire.find(HEADER, 1) == -1
    assert int.from_bytes(wire[5:7], "little") == len(wire) - 7


@given(st.lists(statuses, max_size=5), st.data())
def test_stream_may_be_cut_anywhere(sent: list[StatusPacket], data: st.DataObject) -> None:
    stream = b"".join(map(encode_status, sent))
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=8)))
    reader = StatusPacketReader()
    heard = [
        status
        for begin, end in zip([0, *cuts], [*cuts, len(stream)], strict=True)
        for status in reader.feed(stream[begin:end])
    ]
    assert heard == sent
    assert reader.dropped_bytes == reader.bad_crc == 0


@given(statuses, statuses, st.data())
def test_truncated_status_does_not_swallow_the_next(
    cut: StatusPacket, whole: StatusPacket, data: st.DataObject
) -> None:
    wire = encode_status(cut)
    reader = StatusPacketReader()
    kept = wire[: data.draw(st.integers(0, len(wire) - 1))]
    assert reader.feed(kept + encode_status(whole)) == [whole]
    assert reader.dropped_bytes == len(kept)


@given(statuses, st.data())
def test_a_changed_byte_is_noticed(status: StatusPacket, data: st.DataObject) -> None:
    wire = bytearray(encode_status(status))
    where = data.draw(st.integers(0, len(wire) - 1))
    wire[where] ^= data.draw(st.integers(1, 255))
    reader = StatusPacketReader()
    heard = reader.feed(bytes(wire))
    reader.clear()
    assert heard == []
    assert reader.dropped_bytes == len(wire)


@given(
    st.lists(
        st.one_of(st.binary(max_size=300), statuses.map(encode_status), st.just(HEADER + b"\x01\x00\x03")), max_size=5
    )
)
def test_arbitrary_bytes_never_raise(pieces: list[bytes]) -> None:
    reader = StatusPacketReader()
    framed = 0
    for piece in pieces:
        for status in reader.feed(piece):
            framed += len(encode_status(status))
        waiting = sum(map(len, pieces)) - framed - reader.dropped_bytes
        assert waiting >= 0
    reader.clear()
    # A frame that is no status (an echo, or chance) is neither dropped nor given back.
    assert framed + reader.dropped_bytes <= sum(map(len, pieces))


def test_overlong_length_is_rejected() -> None:
    reader = StatusPacketReader()
    assert reader.feed(HEADER + b"\x01\xff\xff" + bytes(20)) == []
    assert reader.dropped_bytes > 20
    reader = StatusPacketReader()
    claim = HEADER + b"\x01" + LONGEST.to_bytes(2, "little")
    status = StatusPacket(3, 0, b"\x01")
    assert reader.feed(claim + encode_status(status)) == [status]
    assert reader.feed(bytes(10 * LONGEST)) == []
    reader.clear()
    assert reader.dropped_bytes == len(claim) + 10 * LONGEST


def test_readers_skip_packets_of_the_other_kind() -> None:
    status, request = StatusPacket(1, 0, b"\x07"), packet.ping(1)
    both = encode_packet(request) + encode_status(status)
    assert StatusPacketReader().feed(both) == [status]
    assert PacketReader().feed(both) == [request]
