"""The bracket protocol and the HID reports, both ways and with errors."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.examples import examples
from weberlink.master.devices.polhem.hid_protocol import (
    LONG,
    SHORT,
    Sensors,
    SetCounters,
    Unwrapper,
    decode_command,
    decode_sensors,
    encode_command,
    encode_sensors,
    wrapped,
)
from weberlink.master.devices.polhem.serial_protocol import (
    ERRORS,
    LONGEST,
    SerialStatus,
    SerialStatusReader,
    complaint,
    decode_currents,
    encode_currents,
    encode_status,
)

int32 = st.integers(-(2**31), 2**31 - 1)
statuses = st.builds(
    SerialStatus, st.integers(1, 3), st.tuples(int32, int32, int32, int32, int32, int32), st.integers(0, 2047)
)

currents = st.tuples(*[st.integers(-6000, 6000)] * 3)


def test_messages_as_published() -> None:
    assert encode_currents((1, -20, 300)) == b"[1,-20,300]\n\0\0\0\0"
    assert encode_currents((-6000, 6000, -6000)) == b"[-6000,6000,-6000]\n"
    assert encode_status(SerialStatus(3, (1, -2, 3, 0, 0, 0), 8)) == b"[3,1,-2,3,0,0,0,8]\n"


@examples(40)
@given(currents)
def test_bracket_currents_come_back(ma: tuple[int, int, int]) -> None:
    message = encode_currents(ma)
    assert len(message) >= 16
    assert decode_currents(message) == ma


@pytest.mark.parametrize("ma", [(6001, 0, 0), (0, -6001, 0)])
def test_current_beyond_firmware_limit_raises(ma: tuple[int, int, int]) -> None:
    with pytest.raises(ValueError, match="6000"):
        encode_currents(ma)


@pytest.mark.parametrize("message", [b"", b"[1,2]\n", b"[1,2,3,4]\n", b"1,2,3]\n", b"[1,2,x]\n", b"[1,2,3]\n[1,2,3]\n"])
def test_what_is_no_command_is_refused(message: bytes) -> None:
    with pytest.raises(ValueError, match="expected"):
        decode_currents(message)


@examples(40)
@given(st.lists(statuses, max_size=4), st.data())
def test_answers_come_whole_however_the_stream_is_cut(said: list[SerialStatus], data: st.DataObject) -> None:
    stream = b"".join(map(encode_status, said))
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=6)))
    reader, heard = SerialStatusReader(), []
    for start, end in zip([0, *cuts], [*cuts, len(stream)], strict=True):
        heard += reader.feed(stream[start:end])
    assert heard == said
    assert reader.malformed == 0


@examples(40)
@given(st.lists(st.binary(max_size=300), max_size=5), statuses)
def test_garbage_ends_at_the_next_answer(garbage: list[bytes], status: SerialStatus) -> None:
    reader = SerialStatusReader()
    for part in garbage:
        reader.feed(part)
        assert reader.kept <= LONGEST
    assert reader.feed(encode_status(status))[-1:] == [status]


def test_malformed_answer_is_counted_and_next_heard() -> None:
    reader = SerialStatusReader()
    good = encode_status(SerialStatus(1, (1, 2, 3, 4, 5, 6)))
    assert len(reader.feed(b"[1,2,x,4,5,6,7,0]\n" + good + b"[1,2,3]\n")) == 1
    assert reader.malformed == 2


def test_errors_in_words() -> None:
    assert complaint(0) == ""
    assert complaint(8 | 512) == f"{ERRORS[8]}, {ERRORS[512]}"
    assert complaint(1 | 16384) == f"{ERRORS[1]}, error 16384"


int16 = st.integers(-(2**15), 2**15 - 1)
triples = st.tuples(int16, int16, int16)


def test_reports_as_published() -> None:
    assert (LONG, SHORT) == (14, 8)
    assert encode_command((1, -2, 3), LONG) == bytes.fromhex("0100 feff 0300 0000 0000 0000 0000")
    assert encode_command((1, -2, 3), SHORT, 0x10005) == bytes.fromhex("0100 feff 0300 0500")
    # Command 1: the first three counters in the attributes, the other three where the currents were.
    assert encode_command(SetCounters((1, 2, 3, 4, 5, 6)), LONG) == bytes.fromhex("0400 0500 0600 0100 0100 0200 0300")
    assert decode_sensors(bytes.fromhex("0100 0200 0300 0400 0500 0600 0100")) == Sensors(
        (1, 2, 3, 4, 5, 6), calibrate=True
    )
    assert decode_sensors(bytes.fromhex("0100 feff 0300 ffff")) == Sensors((1, -2, 3), number=65535)


@examples(40)
@given(triples, st.tuples(st.integers(-4000, 4000), int16, int16), st.booleans(), st.booleans())
def test_long_reports_come_back(
    main: tuple[int, int, int], gimbal: tuple[int, int, int], button: bool, calibrate: bool
) -> None:
    sensors = Sensors((*main, *gimbal), button, calibrate)
    assert decode_sensors(encode_sensors(sensors)) == sensors


@examples(40)
@given(st.binary(max_size=20).filter(lambda report: len(report) not in (LONG, SHORT)))
def test_another_length_is_refused(report: bytes) -> None:
    with pytest.raises(ValueError, match=f"got {len(report)}"):
        decode_sensors(report)
    with pytest.raises(ValueError, match=f"got {len(report)}"):
        decode_command(report)


def test_the_button_hides_in_the_fourth_counter() -> None:
    pressed = decode_sensors(encode_sensors(Sensors((0, 0, 0, -321, 0, 0), button=True)))
    assert (pressed.button, pressed.counts[3]) == (True, -321)
    assert not decode_sensors(encode_sensors(Sensors((0, 0, 0, 4999, 0, 0)))).button


@examples(40)
@given(st.integers(-(10**6), 10**6), st.lists(st.integers(-32767, 32767), max_size=30))
def test_counts_beyond_16_bits_are_followed(start: int, steps: list[int]) -> None:
    unwrapper, count = Unwrapper(), start
    offset = count - unwrapper.unwrap((wrapped(count),))[0]
    for step in steps:
        count += step
        assert unwrapper.unwrap((wrapped(count),)) == (count - offset,)
    unwrapper.reset()
    assert unwrapper.unwrap((5,)) == (5,)
