"""Key exchange Noise_NNpsk0_25519_AESGCM_SHA256: two messages that derive fresh keys from a pre-shared one.

Section numbers are those of the Noise Protocol Framework, revision 34. The pattern (sections 7.4 and 9.4):

    -> psk, e       `call`, `hear`
    <- e, ee        `open_answer`, `answer`

Both messages carry an encrypted payload. The first one proves that its sender held the key at some time; it may be a
recording. Only the two ends know the derived keys, even if the pre-shared key becomes known later. An ephemeral key
must never be used for two messages: the payload is encrypted under a key derived from it.
"""

from hashlib import sha256
from hmac import digest
from typing import Final, NamedTuple

from cryptography.exceptions import InvalidTag
from cryptography.hazmat.primitives.asymmetric.x25519 import X25519PrivateKey, X25519PublicKey
from cryptography.hazmat.primitives.ciphers.aead import AESGCM

NAME: Final = b"Noise_NNpsk0_25519_AESGCM_SHA256"
# InitializeSymmetric: a name of up to 32 bytes is its own hash, padded with zeros.
_FIRST: Final = NAME.ljust(32, b"\0")
PSK_BYTES: Final = 32
PRIVATE_BYTES: Final = 32
PUBLIC_BYTES: Final = 32
OVERHEAD: Final = PUBLIC_BYTES + 16  # bytes that each message adds to its payload: the public key and the tag
_NONCE: Final = bytes(12)  # section 12.3; each key encrypts one payload, so the counter is always 0


class Secrets(NamedTuple):
    """The secrets that both ends share after both messages."""

    forward: bytes  # key from initiator to responder, of 32 bytes
    backward: bytes
    handshake_hash: bytes
    """Hash of both messages (section 11.2)."""


State = tuple[bytes, bytes]  # the SymmetricState of section 5.2 between two messages: chaining key and hash
Waiting = tuple[State, X25519PrivateKey]  # what the initiator holds until the answer comes
Heard = tuple[State, bytes]  # what the responder holds until it answers: with the public key of the initiator


def hkdf(chaining_key: bytes, material: bytes, count: int) -> list[bytes]:
    """Two or three keys of 32 bytes (section 4.3)."""
    temporary = digest(chaining_key, material, "sha256")
    outputs: list[bytes] = []
    for number in range(1, count + 1):
        previous = outputs[-1] if outputs else b""
        outputs.append(digest(temporary, previous + bytes((number,)), "sha256"))
    return outputs


def shared_key(psk: bytes) -> tuple[bytes, bytes]:
    """A pre-shared key after the token `psk` (section 9.2), which comes first and so is the same in every handshake."""
    chaining_key, mixed, _ = hkdf(_FIRST, psk, 3)
    return chaining_key, mixed


def _begin(shared: tuple[bytes, bytes], prologue: bytes) -> State:
    chaining_key, mixed = shared
    return chaining_key, _mix_hash(sha256(_FIRST + prologue).digest(), mixed)


def _mix_hash(former: bytes, data: bytes) -> bytes:
    return sha256(former + data).digest()


def _mix_keys(state: State, public: bytes, secret: bytes = b"") -> tuple[bytes, bytes, AESGCM]:
    """The tokens `e` of a pattern with a pre-shared key (section 9.2) and, with a secret, `ee`: chaining key, hash, and
    cipher of the payload."""
    chaining_key, mixed = state
    chaining_key, key = hkdf(chaining_key, public, 2)
    if secret:
        chaining_key, key = hkdf(chaining_key, secret, 2)
    return chaining_key, _mix_hash(mixed, public), AESGCM(key)


def _split(chaining_key: bytes, mixed: bytes) -> Secrets:
    forward, backward = hkdf(chaining_key, b"", 2)
    return Secrets(forward, backward, mixed)


def call(shared: tuple[bytes, bytes], prologue: bytes, private: bytes, payload: bytes) -> tuple[bytes, Waiting]:
    """The message `psk, e`. Both ends must have the same prologue, which is not part of the messages; `private` are
    `PRIVATE_BYTES` random bytes that serve for this message alone."""
    own = X25519PrivateKey.from_private_bytes(private)
    public = own.public_key().public_bytes_raw()
    chaining_key, mixed, cipher = _mix_keys(_begin(shared, prologue), public)
    sealed = cipher.encrypt(_NONCE, payload, mixed)
    return public + sealed, ((chaining_key, _mix_hash(mixed, sealed)), own)


def hear(shared: tuple[bytes, bytes], prologue: bytes, message: bytes) -> tuple[bytes, Heard] | None:
    """The payload of the message `psk, e`; None if it is not authentic. Needs no X25519."""
    public, sealed = message[:PUBLIC_BYTES], message[PUBLIC_BYTES:]
    chaining_key, mixed, cipher = _mix_keys(_begin(shared, prologue), public)
    try:
        payload = cipher.decrypt(_NONCE, sealed, mixed)
    except InvalidTag:
        return None
    return payload, ((chaining_key, _mix_hash(mixed, sealed)), public)


def answer(heard: Heard, private: bytes, payload: bytes) -> tuple[bytes, Secrets] | None:
    """The message `e, ee` and the secrets; only once. None if the peer's public key is invalid."""
    state, peer = heard
    own = X25519PrivateKey.from_private_bytes(private)
    secret = _exchange(own, peer)
    if secret is None:
        return None
    public = own.public_key().public_bytes_raw()
    chaining_key, mixed, cipher = _mix_keys(state, public, secret)
    sealed = cipher.encrypt(_NONCE, payload, mixed)
    return public + sealed, _split(chaining_key, _mix_hash(mixed, sealed))


def open_answer(waiting: Waiting, message: bytes) -> tuple[bytes, Secrets] | None:
    """Payload of the message `e, ee`, and the secrets; None if it is not authentic. May be tried again."""
    state, own = waiting
    public, sealed = message[:PUBLIC_BYTES], message[PUBLIC_BYTES:]
    secret = _exchange(own, public)
    if secret is None:
        return None
    chaining_key, mixed, cipher = _mix_keys(state, public, secret)
    try:
        payload = cipher.decrypt(_NONCE, sealed, mixed)
    except InvalidTag:
        return None
    return payload, _split(chaining_key, _mix_hash(mixed, sealed))


def _exchange(private: X25519PrivateKey, public: bytes) -> bytes | None:
    """DH of section 12.1. None for a wrong length, or a point of low order, whose secret everybody knows."""
    try:
        return private.exchange(X25519PublicKey.from_public_bytes(public))
    except ValueError:
        return None
