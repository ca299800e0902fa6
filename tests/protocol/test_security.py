"""The contract of a security suite, on each of them, and what only the keyed ones promise."""

import os
import subprocess
import sys
from hmac import digest
from random import Random

import pytest
from noise.connection import Keypair, NoiseConnection

from tests.protocol.harness import KEY, by_suite, exchanged
from weberlink.protocol.psk import NAME, CcmCipher, PresharedKey
from weberlink.protocol.security import Checksum, Security
from weberlink.protocol.wire import CLEAR_BYTES, PHASE, Kind, pack, sequence_of

CLEAR = b"\x03\x01\x00\x00"[:CLEAR_BYTES]
DATAGRAM = CLEAR + b"what follows is hidden"
SAID = DATAGRAM[:1] + DATAGRAM[CLEAR_BYTES:]


def flipped(data: bytes, first: int = 0, last: int | None = None) -> list[bytes]:
    """The same with each bit of some bytes changed."""
    bits = range(8 * first, 8 * (len(data) if last is None else last))
    return [data[: bit // 8] + bytes([data[bit // 8] ^ 1 << bit % 8]) + data[bit // 8 + 1 :] for bit in bits]


def said(opened: bytes | None) -> bytes:
    """What was opened, without the phase."""
    assert opened is not None
    return bytes((opened[0] & ~PHASE,)) + opened[1:]


@by_suite
@pytest.mark.parametrize("number", [0x1234, 0xFFFF, 0x10000])
def test_every_flipped_bit_and_every_other_number_direction_and_session_is_found(
    security: Security, number: int
) -> None:
    sealing, opening = exchanged(security)
    sealed = sealing.seal(number, DATAGRAM, 0.0)
    assert sealed[1:CLEAR_BYTES] == CLEAR[1:] and len(sealed) == len(DATAGRAM) + security.tag_size
    assert opening.open(number, sealed, 0) == SAID
    shortest = CLEAR_BYTES + security.tag_size  # a shorter one is not asked for
    others = [*flipped(sealed), *(sealed[:size] for size in range(shortest, len(sealed))), sealed + b"\0"]
    assert all(opening.open(number, damaged, 0) is None for damaged in others)
    assert opening.open(number + 1, sealed, 0) is opening.open(number + 2**24, sealed, 0) is None
    assert sealing.open(number, sealed, 0) is exchanged(security, prologue=b"other")[1].open(number, sealed, 0) is None
    sealed = sealing.seal(number, pack((number & 0xFFFF, 0, 1, 2, (None,)), Kind.PATH, bytes(8)), 0.0)
    for damaged in flipped(sealed, 1, CLEAR_BYTES):  # under the number that it then seems to have
        assert opening.open(number & ~0xFFFF | sequence_of(damaged), damaged, 0) is None


def test_a_key_hides_the_kind_of_a_datagram_among_those_of_a_session() -> None:
    sealing, opening = exchanged(PresharedKey(KEY))
    packed = [first for first in range(128) if first & 7 not in (Kind.HELLO, Kind.WELCOME)]
    shown: dict[int, set[int]] = {}
    for number, first in enumerate(packed * 40):
        sealed = sealing.seal(number, bytes((first,)) + DATAGRAM[1:], 0.0)
        assert opening.open(number, sealed, 0) == bytes((first,)) + SAID[1:]
        shown.setdefault(first, set()).add(sealed[0])
    assert set().union(*shown.values()) == {0, *range(3, 128)}, "no handshake"
    assert min(map(len, shown.values())) > 20, "any kind looks like any other"
    sealing.begin(0.0, 4096, 1)
    assert {sealing.seal(number, DATAGRAM, 0.0)[0] & PHASE for number in range(4097, 4100)} == {0, PHASE}


def test_a_copied_process_seals_nothing_also_under_the_next_keys() -> None:
    security = PresharedKey(KEY)
    (sealing, _), (rekeying, _) = exchanged(security), exchanged(security)
    rekeying.begin(0.0, 0, 1)
    told, tells = os.pipe()
    if (child := os.fork()) == 0:  # in which nothing of pytest may run
        for one in (sealing, rekeying):
            try:
                one.seal(7, DATAGRAM, 0.0)
            except RuntimeError:
                os.write(tells, b"refused ")
        os.write(tells, b"fresh" if exchanged(security)[0].seal(7, DATAGRAM, 0.0) else b"")
        os._exit(0)
    os.waitpid(child, 0)
    os.close(tells)
    assert os.read(told, 100) == b"refused refused fresh"
    os.close(told)
    assert sealing.seal(7, DATAGRAM, 0.0)


@by_suite
def test_a_datagram_opens_under_the_keys_of_its_phase_the_former_ones_for_what_was_overtaken(
    security: Security,
) -> None:
    """One key for each datagram; each arrives before the one that left before it, and once as if it were another."""
    sealing, opening = exchanged(security)
    sealing.begin(0.0, 0, 1)
    sealed = [sealing.seal(number, DATAGRAM, 0.0) for number in range(20)]
    assert len(set(sealed)) == 20
    opening.accept(sealed[0][0])
    for number in range(1, 20):
        newest = number - 1
        for _ in range(2):  # asking changes nothing
            assert said(opening.open(number, sealed[number], newest)) == SAID
            assert said(opening.open(newest, sealed[newest], newest)) == SAID
            assert opening.open(newest, sealed[number], newest) is opening.open(number, sealed[newest], newest) is None
        opening.accept(sealed[number][0])
        assert said(opening.open(newest, sealed[newest], number)) == SAID
    assert said(sealing.open(3, opening.seal(3, DATAGRAM, 0.0), 0)) == SAID, "the other way keeps its keys"


@by_suite
def test_a_handshake_message_is_bound_to_prologue_and_call(security: Security) -> None:
    private = bytes(range(security.private_size))
    (hello, waiting), (_, other) = (
        security.call(b"head", private[:-2] + bytes((number, 0)), b"payload") for number in (1, 2)
    )
    assert len(hello) == len(b"payload") + security.overhead
    heard = security.hear(b"head", hello)
    assert heard is not None and heard[0] == b"payload"
    assert security.hear(b"heat", hello) is None
    for damaged in [*flipped(hello), *(hello[:size] for size in range(len(hello)))]:
        assert security.hear(b"head", damaged) is None
    answered = security.answer(heard[1], private, b"yes")
    assert answered is not None and len(answered[0]) == len(b"yes") + security.overhead
    assert security.open(other, answered[0]) is security.open(waiting, answered[0][:-1]) is None
    assert security.open(waiting, answered[0]) is not None


def test_another_key_or_another_ephemeral_one_opens_nothing_and_reads_nothing() -> None:
    ours, theirs = PresharedKey(KEY), PresharedKey(bytes(32))
    assert theirs.hear(b"", ours.call(b"", KEY, b"")[0]) is None
    sealed = exchanged(ours, seed=1)[0].seal(1, DATAGRAM, 0.0)
    assert exchanged(theirs, seed=1)[1].open(1, sealed, 0) is exchanged(ours, seed=2)[1].open(1, sealed, 0) is None
    assert b"hidden" not in sealed
    assert b"hidden" in exchanged(Checksum())[0].seal(1, DATAGRAM, 0.0)
    for size in (0, 16, 31, 33):
        with pytest.raises(ValueError, match="32 bytes"):
            PresharedKey(bytes(size))


def judge(*, initiates: bool, psk: bytes, prologue: bytes, private: bytes) -> NoiseConnection:
    """The other end, by the other implementation, with an ephemeral key that is known."""
    connection = NoiseConnection.from_name(NAME)
    connection.set_psks(psk)
    connection.set_prologue(prologue)
    if initiates:
        connection.set_as_initiator()
    else:
        connection.set_as_responder()
    connection.set_keypair_from_private_bytes(Keypair.EPHEMERAL, private)
    connection.start_handshake()
    return connection


def sealed(connection: NoiseConnection, *, sends: bool) -> bytes:
    """What an end with these secrets seals, or what its peer does."""
    states = connection.noise_protocol
    key = (states.cipher_state_encrypt if sends else states.cipher_state_decrypt).k
    return CcmCipher(digest(connection.get_handshake_hash(), key, "sha256")).seal(7, DATAGRAM)


@pytest.mark.filterwarnings("ignore:One of ephemeral keypairs:UserWarning")
@pytest.mark.parametrize("seed", range(8))
def test_both_roles_interoperate_byte_for_byte_with_another_implementation_of_noise(seed: int) -> None:
    random = Random(seed)
    psk, prologue, first, second = (random.randbytes(size) for size in (32, seed * 9, 32, 32))
    payloads = random.randbytes(seed * 40), random.randbytes(seed * 7)
    security = PresharedKey(psk)
    theirs = judge(initiates=True, psk=psk, prologue=prologue, private=first)
    hello, waiting = security.call(prologue, first, payloads[0])
    assert hello == theirs.write_message(payloads[0])
    heard = security.hear(prologue, hello)
    their_answering = judge(initiates=False, psk=psk, prologue=prologue, private=second)
    assert heard is not None
    assert heard[0] == payloads[0] == their_answering.read_message(hello)
    answered = security.answer(heard[1], second, payloads[1])
    assert answered is not None
    welcome, answering = answered
    assert welcome == their_answering.write_message(payloads[1])
    opened = security.open(waiting, welcome)
    assert opened is not None and opened[0] == payloads[1] == theirs.read_message(welcome)
    for protection, their in ((opened[1], theirs), (answering, their_answering)):
        assert protection.seal(7, DATAGRAM, 0.0) == sealed(their, sends=True)
        assert said(protection.open(7, sealed(their, sends=False), 0)) == SAID


@pytest.mark.parametrize("public", [bytes(32), b"\x01" + bytes(31)])
def test_a_public_key_of_low_order_makes_no_session(public: bytes) -> None:
    security = PresharedKey(KEY)
    hello, waiting = security.call(b"when", bytes([7] * 32), b"payload")
    heard = security.hear(b"when", hello)
    assert heard is not None
    assert security.open(waiting, public + bytes(30)) is None
    assert security.answer((heard[1][0], public), bytes([8] * 32), b"") is None


def test_no_crypto_library_is_loaded_without_a_key() -> None:
    program = """
import sys
import weberlink.protocol, weberlink.protocol.aio, weberlink.protocol.emulation, weberlink.protocol.keys
from weberlink.protocol.security import Checksum
suite = Checksum()
assert suite.hear(b"", suite.call(b"", bytes(suite.private_size), b"")[0]) is not None
assert "cryptography" not in sys.modules
import weberlink.protocol.psk
assert "cryptography" in sys.modules
"""
    subprocess.run([sys.executable, "-c", program], check=True)
