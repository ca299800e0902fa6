"""The handshake against an independent implementation of the Noise Protocol Framework."""

from random import Random

import pytest
from noise.connection import Keypair, NoiseConnection

from weberlink.protocol import noise
from weberlink.protocol.noise import NAME, OVERHEAD, PRIVATE_BYTES, PSK_BYTES, Secrets, shared_key

PSK = shared_key(bytes(range(PSK_BYTES)))
PROLOGUE = b"\x01\x02 who and when"


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


def agrees(connection: NoiseConnection, secrets: Secrets) -> bool:
    ciphers = connection.noise_protocol
    keys = {ciphers.cipher_state_encrypt.k, ciphers.cipher_state_decrypt.k}
    return (keys, connection.get_handshake_hash()) == ({secrets.forward, secrets.backward}, secrets.handshake_hash)


@pytest.mark.filterwarnings("ignore:One of ephemeral keypairs:UserWarning")
@pytest.mark.parametrize("seed", range(8))
def test_both_roles_interoperate_byte_for_byte(seed: int) -> None:
    random = Random(seed)
    psk, prologue, first, second = (random.randbytes(size) for size in (32, seed * 9, 32, 32))
    payloads = random.randbytes(seed * 40), random.randbytes(seed * 7)
    theirs = judge(initiates=True, psk=psk, prologue=prologue, private=first)
    hello, waiting = noise.call(shared_key(psk), prologue, first, payloads[0])
    assert hello == theirs.write_message(payloads[0])
    heard = noise.hear(shared_key(psk), prologue, hello)
    their_answering = judge(initiates=False, psk=psk, prologue=prologue, private=second)
    assert heard is not None
    assert heard[0] == payloads[0] == their_answering.read_message(hello)
    answered = noise.answer(heard[1], second, payloads[1])
    assert answered is not None
    welcome, secrets = answered
    assert welcome == their_answering.write_message(payloads[1])
    assert len(welcome) == OVERHEAD + len(payloads[1])
    assert noise.open_answer(waiting, welcome) == (payloads[1], secrets)
    assert theirs.read_message(welcome) == payloads[1]
    assert agrees(theirs, secrets) and agrees(their_answering, secrets)
    assert theirs.encrypt(b"first") == their_answering.noise_protocol.cipher_state_decrypt.cipher.encrypt(
        secrets.forward, 0, b"", b"first"
    ), "forward is the key from the initiator"


@pytest.mark.parametrize("public", [bytes(32), b"\x01" + bytes(31)])
def test_a_public_key_of_low_order_makes_no_session(public: bytes) -> None:
    hello, waiting = noise.call(PSK, PROLOGUE, bytes([7] * PRIVATE_BYTES), b"payload")
    heard = noise.hear(PSK, PROLOGUE, hello)
    assert heard is not None
    assert noise.open_answer(waiting, public + bytes(30)) is None
    assert noise.answer((heard[1][0], public), bytes([8] * PRIVATE_BYTES), b"") is None
