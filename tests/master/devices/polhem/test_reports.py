"""HID reports of both kinds, byte by byte and both ways."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.examples import examples
from weberlink.master.devices.polhem.reports import (
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

modest = examples(60)

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


@modest
@given(triples, st.tuples(st.integers(-4000, 4000), int16, int16), st.booleans(), st.booleans())
def test_long_reports_come_back(
    main: tuple[int, int, int], gimbal: tuple[int, int, int], button: bool, calibrate: bool
) -> None:
    sensors = Sensors((*main, *gimbal), button, calibrate)
    assert decode_sensors(encode_sensors(sensors)) == sensors


@modest
@given(triples, st.integers(0, 65535))
def test_short_reports_come_back(main: tuple[int, int, int], number: int) -> None:
    sensors = Sensors(main, number=number)
    assert decode_sensors(encode_sensors(sensors)) == sensors


@modest
@given(triples, st.sampled_from([LONG, SHORT]))
def test_currents_come_back(ma: tuple[int, int, int], size: int) -> None:
    report = encode_command(ma, size)
    assert len(report) == size
    assert decode_command(report) == ma


@modest
@given(st.tuples(*[int16] * 6))
def test_counters_come_back(counts: tuple[int, int, int, int, int, int]) -> None:
    assert decode_command(encode_command(SetCounters(counts), LONG)) == SetCounters(counts)


@modest
@given(st.binary(max_size=20).filter(lambda report: len(report) not in (LONG, SHORT)))
def test_another_length_is_refused(report: bytes) -> None:
    with pytest.raises(ValueError, match=f"got {len(report)}"):
        decode_sensors(report)
    with pytest.raises(ValueError, match=f"got {len(report)}"):
        decode_command(report)


def test_the_older_kind_sets_no_counters() -> None:
    with pytest.raises(ValueError, match="14 bytes"):
        encode_command(SetCounters((0,) * 6), SHORT)


def test_the_button_hides_in_the_fourth_counter() -> None:
    pressed = decode_sensors(encode_sensors(Sensors((0, 0, 0, -321, 0, 0), button=True)))
    assert (pressed.button, pressed.counts[3]) == (True, -321)
    assert not decode_sensors(encode_sensors(Sensors((0, 0, 0, 4999, 0, 0)))).button


@modest
@given(st.integers(-(10**6), 10**6), st.lists(st.integers(-32767, 32767), max_size=30))
def test_counts_beyond_16_bits_are_followed(start: int, steps: list[int]) -> None:
    unwrapper, count = Unwrapper(), start
    offset = count - unwrapper.unwrap((wrapped(count),))[0]
    for step in steps:
        count += step
        assert unwrapper.unwrap((wrapped(count),)) == (count - offset,)
    unwrapper.reset()
    assert unwrapper.unwrap((5,)) == (5,)
