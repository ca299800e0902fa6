"""The contract of a security suite, on each of them, and what only the keyed one promises."""

import subprocess
import sys

import pytest

from tests.protocol.harness import KEY, exchanged, suites
from weberlink.protocol.checksum import Checksum
from weberlink.protocol.psk import PresharedKey
from weberlink.protocol.security import Security
from weberlink.protocol.wire import CLEAR_BYTES, Kind, pack, sequence_of

CLEAR = b"\x03\x01\x00\x00"[:CLEAR_BYTES]
DATAGRAM = CLEAR + b"what follows is hidden"


@pytest.mark.parametrize("security", suites())
def test_every_flipped_bit_is_found(security: Security) -> None:
    sealing, opening = exchanged(security)
    sealed = sealing.seal(9, DATAGRAM)
    assert sealed[:CLEAR_BYTES] == CLEAR and len(sealed) == len(DATAGRAM) + security.tag_size
    for bit in range(8 * len(sealed)):
        damaged = bytearray(sealed)
        damaged[bit // 8] ^= 1 << bit % 8
        assert opening.open(9, bytes(damaged)) is None


@pytest.mark.parametrize("security", suites())
@pytest.mark.parametrize("number", [0x1234, 0xFFFF, 0x10000])
def test_a_number_that_was_changed_is_found_under_the_changed_number(security: Security, number: int) -> None:
    sealing, opening = exchanged(security)
    sealed = sealing.seal(number, pack((number & 0xFFFF, 0, 1, 2, (None,)), Kind.PATH, bytes(8)))
    assert opening.open(number, sealed) is not None
    for bit in range(8, 8 * CLEAR_BYTES):
        damaged = bytearray(sealed)
        damaged[bit // 8] ^= 1 << bit % 8
        assert opening.open(number & ~0xFFFF | sequence_of(bytes(damaged)), bytes(damaged)) is None


@pytest.mark.parametrize("security", suites())
def test_wrong_number_direction_and_session_are_found(security: Security) -> None:
    sealing, opening = exchanged(security)
    sealed = sealing.seal(9, DATAGRAM)
    assert opening.open(10, sealed) is None
    assert opening.open(9 + 2**24, sealed) is None
    assert sealing.open(9, sealed) is None
    assert exchanged(security, prologue=b"other")[1].open(9, sealed) is None


@pytest.mark.parametrize("security", suites())
def test_rekeyed_directions_open_under_next_then_previous_keys(security: Security) -> None:
    sealing, opening = exchanged(security)
    before = sealing.seal(1, DATAGRAM)
    sealing.rekey_outgoing()
    after = sealing.seal(2, DATAGRAM)
    for _ in range(2):  # asking changes nothing
        assert opening.open(1, before) == opening.open_next(2, after) == DATAGRAM[CLEAR_BYTES:]
        assert opening.open(2, after) is opening.open_next(1, before) is opening.open_previous(1, before) is None
    opening.rekey_incoming()
    assert opening.open(2, after) == opening.open_previous(1, before) == DATAGRAM[CLEAR_BYTES:]
    assert opening.open(1, before) is opening.open_next(2, after) is opening.open_previous(2, after) is None
    assert sealing.open(3, opening.seal(3, DATAGRAM)) == DATAGRAM[CLEAR_BYTES:], "the other direction keeps its keys"


@pytest.mark.parametrize("security", suites())
def test_every_rekeying_gives_new_keys(security: Security) -> None:
    sealing, opening = exchanged(security)
    sealed = set()
    for phase in range(20):
        datagram = sealing.seal(7, DATAGRAM)
        assert opening.open(7, datagram) == DATAGRAM[CLEAR_BYTES:], phase
        sealed.add(datagram)
        sealing.rekey_outgoing()
        opening.rekey_incoming()
    assert len(sealed) == 20


@pytest.mark.parametrize("security", suites())
def test_handshake_message_is_bound_to_prologue_and_call(security: Security) -> None:
    private = bytes(range(security.private_size))
    (hello, waiting), (_, other) = (
        security.call(b"head", private[:-2] + bytes((number, 0)), b"payload") for number in (1, 2)
    )
    assert len(hello) == len(b"payload") + security.overhead
    heard = security.hear(b"head", hello)
    assert heard is not None and heard[0] == b"payload"
    assert security.hear(b"heat", hello) is None
    assert all(security.hear(b"head", hello[:size]) is None for size in range(len(hello)))
    for bit in range(8 * len(hello)):
        damaged = bytearray(hello)
        damaged[bit // 8] ^= 1 << bit % 8
        assert security.hear(b"head", bytes(damaged)) is None
    answered = security.answer(heard[1], private, b"yes")
    assert answered is not None
    assert len(answered[0]) == len(b"yes") + security.overhead
    assert security.open(other, answered[0]) is None
    assert security.open(waiting, answered[0][:-1]) is None
    assert security.open(waiting, answered[0]) is not None


def test_another_key_or_another_ephemeral_one_opens_nothing_and_reads_nothing() -> None:
    ours, theirs = PresharedKey(KEY), PresharedKey(bytes(32))
    assert theirs.hear(b"", ours.call(b"", KEY, b"")[0]) is None
    sealed = exchanged(ours, seed=1)[0].seal(1, DATAGRAM)
    assert exchanged(theirs, seed=1)[1].open(1, sealed) is exchanged(ours, seed=2)[1].open(1, sealed) is None
    assert b"hidden" not in sealed
    assert b"hidden" in exchanged(Checksum())[0].seal(1, DATAGRAM)


@pytest.mark.parametrize("size", [0, 16, 31, 33])
def test_a_key_has_its_size(size: int) -> None:
    with pytest.raises(ValueError, match="32 bytes"):
        PresharedKey(bytes(size))


def test_no_crypto_library_is_loaded_without_a_key() -> None:
    program = """
import sys
import weberlink.protocol, weberlink.protocol.aio, weberlink.protocol.emulation, weberlink.protocol.keys
from weberlink.protocol.checksum import Checksum
suite = Checksum()
assert suite.hear(b"", suite.call(b"", bytes(suite.private_size), b"")[0]) is not None
assert "cryptography" not in sys.modules
import weberlink.protocol.psk
assert "cryptography" in sys.modules
"""
    subprocess.run([sys.executable, "-c", program], check=True)
