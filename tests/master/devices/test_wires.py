"""What every message of a device keeps: it is read as it was sent, and what is no message is refused in one line."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from math import inf, nan, tau
from struct import pack as packed
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.examples import examples
from weberlink.hardware.fault import BadReply
from weberlink.master.devices import pointer_link
from weberlink.master.devices.haply.linkage import VERSIONS
from weberlink.master.devices.inverse3.protocol import decode as decode_json
from weberlink.master.devices.polhem.hid_protocol import (
    LONG,
    SHORT,
    Sensors,
    SetCounters,
    decode_command,
    decode_sensors,
    encode_command,
    encode_sensors,
)
from weberlink.master.devices.polhem.serial_protocol import (
    LONGEST,
    SerialStatus,
    SerialStatusReader,
    decode_currents,
    encode_currents,
    encode_status,
)
from weberlink.master.devices.spacemouse.reports import PuckState

BOARD = VERSIONS["v3"].board
COUNT_DEG = 360.0 / 4880.0
HERE = (0.01, -0.02, 0.03)


@dataclass
class Wire:
    """A kind of message.

    Args:
        values: that can be sent.
        encode: gives the bytes of a value.
        decode: gives the value in bytes.
        refuses: with what it refuses bytes that are no message.
        refused: bytes that look like one, besides every truncation.
        unsendable: values that `encode` refuses with ValueError.
        padded: bytes more behind it are refused too.
    """

    values: st.SearchStrategy[Any]
    encode: Callable[[Any], bytes]
    decode: Callable[[bytes], Any]
    refuses: type[Exception] = ValueError
    refused: tuple[bytes, ...] = ()
    unsendable: tuple[Any, ...] = ()
    padded: bool = True


def integers(bits: int) -> st.SearchStrategy[int]:
    edge = 1 << (bits - 1)
    return st.integers(-edge, edge - 1)


def haply_reply(angles: tuple[int, int]) -> bytes:
    """Ports in the order of the board: encoder 1 hangs on port 2."""
    return BOARD.bare_reply + packed("<2f", angles[1] * COUNT_DEG, angles[0] * COUNT_DEG)


def haply_counts(reply: bytes) -> tuple[int, int]:
    first, second = BOARD.angles(reply)
    return round(first / COUNT_DEG), round(second / COUNT_DEG)


def status(line: bytes) -> SerialStatus:
    (only,) = SerialStatusReader().feed(line)
    return only


def three(each: st.SearchStrategy[Any]) -> st.SearchStrategy[tuple[Any, ...]]:
    return st.tuples(each, each, each)


finite = st.floats(allow_nan=False, allow_infinity=False)
statuses = st.builds(SerialStatus, st.integers(1, 3), st.tuples(*[integers(32)] * 6), st.integers(0, 2047))
long_sensors = st.builds(
    lambda main, gimbal, *flags: Sensors((*main, *gimbal), *flags),
    three(integers(16)),
    st.tuples(st.integers(-4000, 4000), integers(16), integers(16)),
    st.booleans(),
    st.booleans(),
)
targets = st.builds(
    pointer_link.PointerTarget, three(finite), st.booleans(), st.integers(0, 2**64 - 1), three(st.floats(-3.6, 3.6))
)
mark = pointer_link.MARK
datagram = pointer_link.LAYOUT.pack

WIRES = {
    "haply reply": Wire(
        st.tuples(*[st.integers(-20_000, 20_000)] * 2),
        haply_reply,
        haply_counts,
        BadReply,
        refused=(
            bytes((BOARD.id + 1,)) + bytes(8),
            BOARD.bare_reply + packed("<2f", nan, 1.0),
            BOARD.bare_reply + packed("<2f", COUNT_DEG, -inf),
            BOARD.bare_reply + packed("<2f", 10.0 * COUNT_DEG, 1.0),  # between two counts
            BOARD.bare_reply + packed("<2f", 1e-30, 0.0),
            BOARD.bare_reply + packed("<2f", COUNT_DEG * (1.0 + 4e-6), 0.0),
        ),
    ),
    "polhem currents": Wire(
        three(st.integers(-6000, 6000)),
        encode_currents,
        lambda data: decode_currents(data.rstrip(b"\0")),
        refused=(b"[1,2]\n", b"[1,2,3,4]\n", b"1,2,3]\n", b"[1,2,x]\n", b"[1,2,3]\n[1,2,3]\n"),
        unsendable=((6001, 0, 0), (0, -6001, 0)),
        padded=False,
    ),
    "polhem status": Wire(
        statuses, encode_status, status, refused=(b"[1,2,x,4,5,6,7,0]\n", b"[1,2,3]\n"), padded=False
    ),
    "polhem sensors": Wire(long_sensors, encode_sensors, decode_sensors),
    "polhem report": Wire(three(integers(16)), lambda value: encode_command(value, LONG), decode_command),
    "polhem counters": Wire(
        st.builds(SetCounters, st.tuples(*[integers(16)] * 6)),
        lambda value: encode_command(value, LONG),
        decode_command,
    ),
    "pointer": Wire(
        targets,
        lambda target: pointer_link.pack(*target),
        pointer_link.unpack,
        refused=(
            b"WLP1" + datagram(mark, 3, True, *HERE, *HERE)[4:],
            datagram(mark, 3, True, nan, 0.0, 0.0, *HERE),
            datagram(mark, 3, True, 0.0, 0.0, inf, *HERE),
            datagram(mark, 3, True, *HERE, 0.0, nan, 0.0),
            datagram(mark, 3, True, *HERE, 0.0, tau * 1.0001, 0.0),
        ),
        unsendable=(
            ((nan, 0.0, 0.0), True, 1),
            (HERE, True, -1),
            (HERE, True, 2**64),
            (HERE, True, 1, (nan, 0.0, 0.0)),
            (HERE, True, 1, (0.0, tau * 1.0001, 0.0)),
        ),
    ),
    "inverse3": Wire(
        st.dictionaries(st.text(max_size=5), finite, max_size=3),
        lambda value: json.dumps(value).encode(),
        decode_json,
        BadReply,
        refused=(b"[]", b"7", b"\xff\xfe", b"[" * 100_000),
    ),
}
every_wire = pytest.mark.parametrize("wire", WIRES.values(), ids=WIRES)


@every_wire
@given(data=st.data(), noise=st.binary(max_size=90), at=st.integers(0, 90), flip=st.integers(1, 255))
def test_what_is_sent_is_read_and_no_bytes_break_the_reader(
    wire: Wire, data: st.DataObject, noise: bytes, at: int, flip: int
) -> None:
    value = data.draw(wire.values)
    whole = wire.encode(value)
    assert wire.decode(whole) == value
    torn = bytearray(whole)
    torn[at % len(torn)] ^= flip
    for each in (noise, bytes(torn)):
        try:
            found = wire.decode(each)
        except wire.refuses as refusal:
            assert "\n" not in str(refusal)
        else:
            assert wire.decode(wire.encode(found)) == found


@every_wire
@examples(5)
@given(data=st.data())
def test_a_part_of_a_message_and_what_looks_like_one_is_none(wire: Wire, data: st.DataObject) -> None:
    whole = wire.encode(data.draw(wire.values))
    body = whole if wire.padded else whole.rstrip(b"\0\n")
    of_the_other_board = (SHORT, LONG) if wire.decode in (decode_sensors, decode_command) else ()
    parts = [whole[:length] for length in range(len(body)) if length not in of_the_other_board]
    for each in (*parts, *([whole + b"x"] if wire.padded else []), b"", *wire.refused):
        with pytest.raises(wire.refuses):
            wire.decode(each)


@pytest.mark.parametrize(("wire", "value"), [(wire, each) for wire in WIRES.values() for each in wire.unsendable])
def test_what_cannot_be_said_is_refused(wire: Wire, value: Any) -> None:
    with pytest.raises(ValueError, match=r"\S"):
        wire.encode(value)


# --- a stream of messages: the status of the Polhem's serial board


@given(st.lists(statuses, max_size=4), st.data())
def test_answers_come_whole_however_the_stream_is_cut(said: list[SerialStatus], data: st.DataObject) -> None:
    stream = b"".join(map(encode_status, said))
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=6)))
    reader, heard = SerialStatusReader(), list[SerialStatus]()
    for start, end in zip([0, *cuts], [*cuts, len(stream)], strict=True):
        heard += reader.feed(stream[start:end])
    assert (heard, reader.malformed) == (said, 0)


@given(st.lists(st.binary(max_size=300), max_size=5), statuses)
def test_noise_ends_at_the_next_answer(noise: list[bytes], wanted: SerialStatus) -> None:
    reader = SerialStatusReader()
    for part in noise:
        reader.feed(part)
        assert reader.kept <= LONGEST
    assert reader.feed(encode_status(wanted))[-1:] == [wanted]
    before = reader.malformed
    assert reader.feed(b"[1,2,x,4,5,6,7,0]\n" + encode_status(wanted) + b"[1,2,3]\n") == [wanted]
    assert reader.malformed == before + 2


# --- the state of a SpaceMouse: each report says a part of it


@examples(20)
@given(
    st.builds(PuckState, three(integers(16)), three(integers(16)), st.integers(0, 0xFFFF)),
    st.booleans(),
    st.binary(min_size=1, max_size=64),
)
def test_puck_survives_its_reports_and_any_other(state: PuckState, joint: bool, noise: bytes) -> None:
    heard = PuckState().updated(noise)
    reports = state.reports(joint=joint, button_bytes=2)
    for report in reports:
        heard = heard.updated(report)
    assert heard == state
    for report in reports[:-1]:
        assert heard.updated(report[:-1]) == state, "a part of the values says nothing"


# --- bytes as published


def test_bytes_are_those_of_the_makers() -> None:
    assert encode_currents((1, -20, 300)) == b"[1,-20,300]\n\0\0\0\0", "at least 16 bytes"
    assert encode_currents((-6000, 6000, -6000)) == b"[-6000,6000,-6000]\n"
    assert encode_status(SerialStatus(3, (1, -2, 3, 0, 0, 0), 8)) == b"[3,1,-2,3,0,0,0,8]\n"
    assert (LONG, SHORT) == (14, 8)
    assert encode_command((1, -2, 3), LONG) == bytes.fromhex("0100 feff 0300 0000 0000 0000 0000")
    assert encode_command((1, -2, 3), SHORT, 0x10005) == bytes.fromhex("0100 feff 0300 0500")
    # Command 1: the first three counters in the attributes, the other three where the currents were.
    assert encode_command(SetCounters((1, 2, 3, 4, 5, 6)), LONG) == bytes.fromhex("0400 0500 0600 0100 0100 0200 0300")
    six = bytes.fromhex("0100 0200 0300 0400 0500 0600 0100")
    assert decode_sensors(six) == Sensors((1, 2, 3, 4, 5, 6), calibrate=True)
    assert decode_sensors(bytes.fromhex("0100 feff 0300 ffff")) == Sensors((1, -2, 3), number=65535)
    assert not decode_sensors(encode_sensors(Sensors((0, 0, 0, 4999, 0, 0)))).button, "it hides in the fourth counter"


@pytest.mark.parametrize(
    ("report", "state"),
    [
        ("01 5e01 0000 a2fe", PuckState(translation=(350, 0, -350))),
        ("02 0000 e2ff 0000", PuckState(rotation=(0, -30, 0))),
        ("03 02 00", PuckState(buttons=2)),
        ("03 01 00 00 80", PuckState(buttons=0x80000001)),
        ("01 0100 0200 0300 0400 0500 0600", PuckState((1, 2, 3), (4, 5, 6))),
        ("17 64", PuckState()),
        ("01 0100", PuckState()),
    ],
)
def test_published_reports_of_a_puck_are_understood(report: str, state: PuckState) -> None:
    assert PuckState().updated(bytes.fromhex(report)) == state
