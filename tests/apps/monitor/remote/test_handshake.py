"""Who may look: no answer without the key, no keys for an old message, no message of the daemons' protocol."""

import os

import pytest
from hypothesis import given
from hypothesis import strategies as st

from weberlink.apps.monitor.remote import handshake
from weberlink.apps.monitor.remote.channel import StreamError
from weberlink.apps.monitor.remote.handshake import Call, RefusedError, answer, suite
from weberlink.protocol import DropReason
from weberlink.protocol.dialer import Dialer
from weberlink.protocol.handshake import INSTANCE_BYTES, LocalEnd, pack_agreement
from weberlink.protocol.listener import Listener
from weberlink.protocol.psk import PresharedKey

KEY = bytes(range(32))
OURS = suite(KEY)


def test_another_key_gets_no_answer() -> None:
    call = Call(suite(bytes(32)), os.urandom)
    assert answer(call.hello(), OURS, os.urandom) is None


@given(st.binary(max_size=700))
def test_noise_gets_no_answer(noise: bytes) -> None:
    assert answer(noise, OURS, os.urandom) is None


@given(st.integers(0, 511), st.integers(1, 255))
def test_a_changed_call_gets_no_answer(place: int, bits: int) -> None:
    hello = bytearray(Call(OURS, os.urandom).hello())
    hello[place] ^= bits
    assert answer(bytes(hello), OURS, os.urandom) is None


def test_the_answer_is_shorter_than_the_question() -> None:
    hello = Call(OURS, os.urandom).hello()
    reply = answer(hello, OURS, os.urandom)
    assert reply is not None and len(reply[0]) < len(hello)


def test_an_answer_that_proves_nothing_or_answers_another_call_is_refused() -> None:
    first, second = Call(OURS, os.urandom), Call(OURS, os.urandom)
    reply = answer(first.hello(), OURS, os.urandom)
    assert reply is not None
    with pytest.raises(RefusedError, match="--key-file"):
        second.answered(reply[0])
    with pytest.raises(RefusedError, match="--key-file"):
        first.answered(reply[0][:-1] + bytes((reply[0][-1] ^ 1,)))
    first.answered(reply[0])


def test_a_call_that_is_played_back_opens_nothing() -> None:
    call = Call(OURS, os.urandom)
    hello = call.hello()
    first, again = answer(hello, OURS, os.urandom), answer(hello, OURS, os.urandom)
    assert first is not None and again is not None and again[1] is not None
    recorded = call.answered(first[0]).seal(1, b"")
    with pytest.raises(StreamError):
        again[1].open(recorded)


def test_releases_that_differ_are_told_so(monkeypatch: pytest.MonkeyPatch) -> None:
    call = Call(OURS, os.urandom)
    monkeypatch.setattr(handshake, "SCHEMA", handshake.SCHEMA ^ 1)
    reply = answer(call.hello(), OURS, os.urandom)
    assert reply is not None and reply[1] is None
    with pytest.raises(RefusedError, match="the same one on both"):
        call.answered(reply[0])


def test_no_message_of_the_one_protocol_is_one_of_the_other() -> None:
    """The daemons prove the same key."""
    daemons = PresharedKey(KEY)
    agreement = pack_agreement({"rate_hz": 1000})
    master, slave = (LocalEnd(daemons, os.urandom, agreement, 2, 0.0, name, "") for name in ("master", "slave"))
    dialer = Dialer(master, bytes(INSTANCE_BYTES), stamp=lambda now: 1)
    dialer.start(0.0)
    assert answer(dialer.hello(0.0), OURS, os.urandom) is None
    listener = Listener(slave, lambda *_: None)  # type: ignore[arg-type]
    assert listener.receive(Call(OURS, os.urandom).hello(), ("192.0.2.1", 1), 0.0) is DropReason.UNPROVEN
