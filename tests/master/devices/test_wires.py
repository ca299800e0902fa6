"""What every message of a device keeps: it is read as it was sent, and what is no message is refused in one line."""

from struct import error as StructError  # noqa: N812 - as of an exception
from typing import Any

import pytest
from hypothesis import given, strategies as st

from weberlink.master.devices.polhem.protocol import (
    LONG,
    LONGEST,
    SHORT,
    Sensors,
    SetCounters,
    StatusReader,
    decode_command,
    decode_sensors,
    encode_command,
    encode_currents,
    encode_sensors,
    encode_status,
)
from weberlink.testing.messages import Message, MessageContract


def integers(bits: int) -> st.SearchStrategy[int]:
    edge = 1 << (bits - 1)
    return st.integers(-edge, edge - 1)


def status(line: bytes) -> Sensors:
    (only,) = filter(None, StatusReader().feed(line))
    return only


def three(each: st.SearchStrategy[Any]) -> st.SearchStrategy[tuple[Any, ...]]:
    return st.tuples(each, each, each)


statuses = st.builds(
    lambda counts, model, error: Sensors(counts, model=model, error=error),
    st.tuples(*[integers(32)] * 6),
    st.integers(1, 3),
    st.integers(0, 2047),
)
long_sensors = st.builds(
    lambda main, gimbal, *flags: Sensors((*main, *gimbal), *flags),
    three(integers(16)),
    st.tuples(st.integers(-4000, 4000), integers(16), integers(16)),
    st.booleans(),
    st.booleans(),
)
short_sensors = st.builds(
    lambda counts, number: Sensors(counts, number=number), three(integers(16)), st.integers(0, 0xFFFF)
)

MESSAGES = {
    "polhem status": Message(
        statuses, encode_status, status, refused=(b"[1,2,x,4,5,6,7,0]\n", b"[1,2,3]\n"), padded=False
    ),
    "polhem sensors": Message(long_sensors, encode_sensors, decode_sensors, StructError, lengths=(SHORT,)),
    "polhem short sensors": Message(short_sensors, encode_sensors, decode_sensors, StructError),
    "polhem report": Message(
        three(integers(16)), lambda value: encode_command(value, LONG), decode_command, StructError, lengths=(SHORT,)
    ),
    "polhem counters": Message(
        st.builds(SetCounters, st.tuples(*[integers(16)] * 6)),
        lambda value: encode_command(value, LONG),
        decode_command,
        StructError,
        lengths=(SHORT,),
    ),
}


class TestMessages(MessageContract):
    MESSAGES = MESSAGES


# --- the Polhem's serial board: its commands, and its answers in a stream


@pytest.mark.parametrize("currents", [(6001, 0, 0), (0, -6001, 0)])
def test_currents_that_the_board_would_take_for_zero_are_not_sent(currents: Any) -> None:
    with pytest.raises(ValueError, match="within"):
        encode_currents(currents)


@given(st.lists(statuses, max_size=4), st.data())
def test_answers_come_whole_however_the_stream_is_cut(said: list[Sensors], data: st.DataObject) -> None:
    stream = b"".join(map(encode_status, said))
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=6)))
    reader, heard = StatusReader(), list[Sensors | None]()
    for start, end in zip([0, *cuts], [*cuts, len(stream)], strict=True):
        heard += reader.feed(stream[start:end])
    assert heard == said


@given(st.lists(st.binary(max_size=300), max_size=5), statuses)
def test_noise_ends_at_the_next_answer(noise: list[bytes], wanted: Sensors) -> None:
    reader = StatusReader()
    for part in noise:
        reader.feed(part)
        assert len(reader._rest) <= LONGEST
    assert reader.feed(encode_status(wanted))[-1:] == [wanted]
    assert reader.feed(b"[1,2,x,4,5,6,7,0]\n" + encode_status(wanted) + b"[1,2,3]\n") == [None, wanted, None]


# --- bytes as published


def test_bytes_are_those_of_the_makers() -> None:
    assert encode_currents((1, -20, 300)) == b"[1,-20,300]\n\0\0\0\0", "at least 16 bytes"
    assert encode_currents((-6000, 6000, -6000)) == b"[-6000,6000,-6000]\n"
    assert encode_status(Sensors((1, -2, 3, 0, 0, 0), model=3, error=8)) == b"[3,1,-2,3,0,0,0,8]\n"
    assert (LONG, SHORT) == (14, 8)
    assert encode_command((1, -2, 3), LONG) == bytes.fromhex("0100 feff 0300 0000 0000 0000 0000")
    assert encode_command((1, -2, 3), SHORT, 0x10005) == bytes.fromhex("0100 feff 0300 0500")
    # Command 1: the first three counters in the attributes, the other three where the currents were.
    assert encode_command(SetCounters((1, 2, 3, 4, 5, 6)), LONG) == bytes.fromhex("0400 0500 0600 0100 0100 0200 0300")
    six = bytes.fromhex("0100 0200 0300 0400 0500 0600 0100")
    assert decode_sensors(six) == Sensors((1, 2, 3, 4, 5, 6), calibrate=True)
    assert decode_sensors(bytes.fromhex("0100 feff 0300 ffff")) == Sensors((1, -2, 3), number=65535)
    assert not decode_sensors(encode_sensors(Sensors((0, 0, 0, 4999, 0, 0)))).button, "it hides in the fourth counter"
