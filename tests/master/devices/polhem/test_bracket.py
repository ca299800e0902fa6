"""The text protocol, any way it may be cut up or spoilt."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.examples import examples
from weberlink.master.devices.polhem.bracket import (
    ERRORS,
    LONGEST,
    Status,
    StatusReader,
    complaint,
    decode_currents,
    encode_currents,
    encode_status,
)

int32 = st.integers(-(2**31), 2**31 - 1)
statuses = st.builds(
    Status, st.integers(1, 3), st.tuples(int32, int32, int32, int32, int32, int32), st.integers(0, 2047)
)

modest = examples(60)
currents = st.tuples(*[st.integers(-6000, 6000)] * 3)


def test_messages_as_published() -> None:
    assert encode_currents((1, -20, 300)) == b"[1,-20,300]\n\0\0\0\0"
    assert encode_currents((-6000, 6000, -6000)) == b"[-6000,6000,-6000]\n"
    assert encode_status(Status(3, (1, -2, 3, 0, 0, 0), 8)) == b"[3,1,-2,3,0,0,0,8]\n"


@modest
@given(currents)
def test_currents_come_back(ma: tuple[int, int, int]) -> None:
    message = encode_currents(ma)
    assert len(message) >= 16
    assert decode_currents(message) == ma


@pytest.mark.parametrize("ma", [(6001, 0, 0), (0, -6001, 0)])
def test_a_current_that_would_be_taken_for_zero_is_our_own_fault(ma: tuple[int, int, int]) -> None:
    with pytest.raises(ValueError, match="6000"):
        encode_currents(ma)


@pytest.mark.parametrize("message", [b"", b"[1,2]\n", b"[1,2,3,4]\n", b"1,2,3]\n", b"[1,2,x]\n", b"[1,2,3]\n[1,2,3]\n"])
def test_what_is_no_command_is_refused(message: bytes) -> None:
    with pytest.raises(ValueError, match="expected"):
        decode_currents(message)


@modest
@given(st.lists(statuses, max_size=4), st.data())
def test_answers_come_whole_however_the_stream_is_cut(said: list[Status], data: st.DataObject) -> None:
    stream = b"".join(map(encode_status, said))
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=6)))
    reader, heard = StatusReader(), []
    for start, end in zip([0, *cuts], [*cuts, len(stream)], strict=True):
        heard += reader.feed(stream[start:end])
    assert heard == said
    assert reader.malformed == 0


@modest
@given(st.lists(st.binary(max_size=300), max_size=5), statuses)
def test_garbage_never_raises_and_is_over_at_the_next_answer(garbage: list[bytes], status: Status) -> None:
    reader = StatusReader()
    for part in garbage:
        reader.feed(part)
        assert reader.kept <= LONGEST
    assert reader.feed(encode_status(status))[-1:] == [status]


def test_a_spoilt_answer_is_counted_and_the_next_is_heard() -> None:
    reader = StatusReader()
    good = encode_status(Status(1, (1, 2, 3, 4, 5, 6)))
    assert len(reader.feed(b"[1,2,x,4,5,6,7,0]\n" + good + b"[1,2,3]\n")) == 1
    assert reader.malformed == 2


def test_what_never_ends_is_not_kept() -> None:
    reader = StatusReader()
    reader.feed(b"[" + b"1," * 10_000)
    assert reader.kept <= LONGEST


def test_errors_in_words() -> None:
    assert complaint(0) == ""
    assert complaint(8 | 512) == f"{ERRORS[8]}, {ERRORS[512]}"
    assert complaint(1 | 16384) == f"{ERRORS[1]}, error 16384"
