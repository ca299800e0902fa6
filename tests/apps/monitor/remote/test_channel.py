"""The sealed stream: the very next message, unchanged, or nothing."""

import os

import pytest
from hypothesis import given
from hypothesis import strategies as st

from weberlink.apps.monitor.remote.channel import LONGEST_FRAME, LONGEST_PAYLOAD, Channel, StreamError
from weberlink.apps.monitor.remote.handshake import Call, answer, suite


def pair() -> tuple[Channel, Channel]:
    """Both ends of a connection: caller, and who answers."""
    security = suite(bytes(32))
    call = Call(security, os.urandom)
    reply = answer(call.hello(), security, os.urandom)
    assert reply is not None and reply[1] is not None
    return call.answered(reply[0]), reply[1]


@given(st.lists(st.tuples(st.integers(0, 255), st.binary(max_size=200)), max_size=20))
def test_what_is_sealed_in_order_opens_in_order(messages: list[tuple[int, bytes]]) -> None:
    one, other = pair()
    frames = [one.seal(*message) for message in messages]
    assert [other.open(frame) for frame in frames] == messages
    assert [one.open(other.seal(*message)) for message in messages] == messages


def test_a_changed_message_ends_it() -> None:
    one, other = pair()
    frame = one.seal(3, b"telemetry")
    for place in range(len(frame)):
        changed = bytearray(frame)
        changed[place] ^= 1
        with pytest.raises(StreamError):
            other.open(bytes(changed))
    for length in range(len(frame)):
        with pytest.raises(StreamError):
            other.open(frame[:length])
    assert other.open(frame) == (3, b"telemetry")


def test_a_message_out_of_its_place_ends_it() -> None:
    one, other = pair()
    first, second, third = (one.seal(1, bytes((number,))) for number in range(3))
    with pytest.raises(StreamError, match="not in its place"):
        other.open(second)
    other.open(first)
    with pytest.raises(StreamError, match="not in its place"):
        other.open(first)  # played back
    with pytest.raises(StreamError, match="not in its place"):
        other.open(third)  # one left out
    renumbered = third[:1] + second[1:4] + third[4:]
    with pytest.raises(StreamError, match="changed"):
        other.open(renumbered)
    with pytest.raises(StreamError):
        one.open(second)  # back to its sender
    other.open(second)


def test_a_connection_has_keys_of_its_own() -> None:
    with pytest.raises(StreamError, match="changed"):
        pair()[1].open(pair()[0].seal(1, b""))


def test_the_longest_message_fits_and_no_longer_one() -> None:
    one, other = pair()
    frame = one.seal(1, bytes(LONGEST_PAYLOAD))
    assert len(frame) <= LONGEST_FRAME < 65_536
    assert other.open(frame)[1] == bytes(LONGEST_PAYLOAD)
    with pytest.raises(ValueError, match="at most"):
        one.seal(1, bytes(LONGEST_PAYLOAD + 1))
