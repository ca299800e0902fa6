"""The handshake against an independent implementation of the Noise Protocol Framework."""

from random import Random

import pytest
from noise.connection import Keypair, NoiseConnection

from weberlink.protocol.noise import NAME, OVERHEAD, PRIVATE_BYTES, PSK_BYTES, Initiator, Responder, Secrets, SharedKey

PSK = SharedKey(bytes(range(PSK_BYTES)))
PROLOGUE = b"\x01\x02 who and when"


def as_they_are(secrets: Secrets) -> Secrets:
    return secrets


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


def keys(connection: NoiseConnection) -> set[bytes]:
    protocol = connection.noise_protocol
    return {protocol.cipher_state_encrypt.k, protocol.cipher_state_decrypt.k}


def agrees(connection: NoiseConnection, secrets: Secrets) -> bool:
    return keys(connection) == {secrets.forward, secrets.backward} and (
        connection.get_handshake_hash() == secrets.handshake_hash
    )


@pytest.mark.filterwarnings("ignore:One of ephemeral keypairs:UserWarning")
@pytest.mark.parametrize("seed", range(8))
def test_both_roles_interoperate_byte_for_byte(seed: int) -> None:
    random = Random(seed)
    psk, prologue, first, second = (random.randbytes(size) for size in (32, seed * 9, 32, 32))
    payloads = random.randbytes(seed * 40), random.randbytes(seed * 7)
    ours = Initiator(SharedKey(psk), prologue, first, as_they_are)
    theirs = judge(initiates=True, psk=psk, prologue=prologue, private=first)
    hello = ours.hello(payloads[0])
    assert hello == theirs.write_message(payloads[0])
    answering = Responder.read(SharedKey(psk), prologue, hello, as_they_are)
    their_answering = judge(initiates=False, psk=psk, prologue=prologue, private=second)
    assert answering is not None
    assert answering.payload == payloads[0] == their_answering.read_message(hello)
    written = answering.answer(payloads[1], second)
    assert written is not None
    welcome, secrets = written
    assert welcome == their_answering.write_message(payloads[1])
    assert len(welcome) == OVERHEAD + len(payloads[1])
    assert ours.open(welcome) == (payloads[1], secrets)
    assert theirs.read_message(welcome) == payloads[1]
    assert agrees(theirs, secrets) and agrees(their_answering, secrets)
    assert theirs.encrypt(b"first") == their_answering.noise_protocol.cipher_state_decrypt.cipher.encrypt(
        secrets.forward, 0, b"", b"first"
    ), "forward is the key from the initiator"


@pytest.mark.parametrize("public", [bytes(32), b"\x01" + bytes(31)])
def test_another_key_or_prologue_or_a_public_key_of_low_order_makes_no_session(public: bytes) -> None:
    ours = Initiator(PSK, PROLOGUE, bytes([7] * PRIVATE_BYTES), as_they_are)
    hello = ours.hello(b"payload")
    assert Responder.read(PSK, b"other", hello, as_they_are) is None
    assert Responder.read(SharedKey(bytes(PSK_BYTES)), PROLOGUE, hello, as_they_are) is None
    answering = Responder.read(PSK, PROLOGUE, hello, as_they_are)
    assert answering is not None
    assert ours.open(public + bytes(30)) is None
    answering._peer = public
    assert answering.answer(b"", bytes([8] * PRIVATE_BYTES)) is None
