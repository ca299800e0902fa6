"""Sealed streams: who can open one, and which messages open."""

from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.protocol.harness import KEY
from weberlink.protocol.psk import PresharedKey
from weberlink.protocol.sealed_stream import (
    LONGEST_PAYLOAD,
    RefusedError,
    SealedStream,
    StreamCall,
    StreamError,
    StreamTerms,
    answer_call,
)

TERMS = StreamTerms(PresharedKey(KEY), 2, {"records": 7}, "use the same release")
ENTROPY = Random(1).randbytes


def opened(call: StreamCall | None = None) -> tuple[SealedStream, SealedStream]:
    """Both ends of a stream, the caller's first."""
    call = call or StreamCall(TERMS, ENTROPY)
    reply = answer_call(call.hello(), TERMS, ENTROPY)
    assert reply is not None and reply[1] is not None
    return call.answered(reply[0]), reply[1]


def test_messages_open_once_unchanged_and_in_order() -> None:
    for sealing, opening in (opened(), opened()[::-1]):
        first, second = sealing.seal(1, b"first"), sealing.seal(255, b"")
        for wrong in (second, first[:-1], first[:-1] + bytes((first[-1] ^ 1,)), b""):
            with pytest.raises(StreamError):
                opening.open(wrong)
        assert opening.open(first) == (1, b"first")
        with pytest.raises(StreamError):
            opening.open(first)
        assert opening.open(second) == (255, b"")
        with pytest.raises(ValueError, match="at most"):
            sealing.seal(1, bytes(LONGEST_PAYLOAD + 1))


@given(st.one_of(st.binary(max_size=700), st.integers(0, 511)))
def test_no_answer_without_proof_of_the_key(noise: bytes | int) -> None:
    hello = bytearray(StreamCall(TERMS, ENTROPY).hello())
    if isinstance(noise, bytes):
        hello[:] = noise
    else:
        hello[noise] ^= 0x41
    assert answer_call(bytes(hello), TERMS, ENTROPY) is None
    other = StreamCall(TERMS._replace(security=PresharedKey(bytes(32))), ENTROPY)
    assert answer_call(other.hello(), TERMS, ENTROPY) is None


@pytest.mark.parametrize("changes", [{"agreement": {"records": 8}}, {"version": 3}])
def test_different_ends_are_refused_with_a_shorter_answer(changes: dict[str, object]) -> None:
    call = StreamCall(TERMS._replace(**changes), ENTROPY)  # type: ignore[arg-type]
    hello = call.hello()
    reply = answer_call(hello, TERMS, ENTROPY)
    assert reply is not None and reply[1] is None and len(reply[0]) < len(hello)
    with pytest.raises(RefusedError, match="use the same release"):
        call.answered(reply[0])


def test_foreign_answers_and_replays_open_nothing() -> None:
    call, other = StreamCall(TERMS, ENTROPY), StreamCall(TERMS, ENTROPY)
    hello = call.hello()
    first, again = answer_call(hello, TERMS, ENTROPY), answer_call(hello, TERMS, ENTROPY)
    assert first is not None and again is not None and again[1] is not None
    with pytest.raises(RefusedError, match="--key-file"):
        other.answered(first[0])
    with pytest.raises(StreamError):
        again[1].open(call.answered(first[0]).seal(1, b""))
