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
_FIRST: Final = NAME.ljust(32, b"\0")
"""InitializeSymmetric: a name of up to 32 bytes is its own hash, padded with zeros."""
PSK_BYTES: Final = 32
PRIVATE_BYTES: Final = 32
PUBLIC_BYTES: Final = 32
OVERHEAD: Final = PUBLIC_BYTES + 16
"""Bytes that each message adds to its payload: the public key and the tag."""
_NONCE: Final = bytes(12)
"""Section 12.3. Each key encrypts one payload, so the counter is always 0."""


class Secrets(NamedTuple):
    """The secrets that both ends share after both messages."""

    forward: bytes
    """Key from initiator to responder, of 32 bytes."""
    backward: bytes
    handshake_hash: bytes
    """Hash of both messages (section 11.2)."""


class Symmetric(NamedTuple):
    """The SymmetricState of section 5.2, with the key of its CipherState; each step makes a new one."""

    chaining_key: bytes
    hash: bytes
    key: bytes

    def mix_hash(self, data: bytes) -> "Symmetric":
        return Symmetric(self.chaining_key, sha256(self.hash + data).digest(), self.key)

    def mix_key(self, material: bytes) -> "Symmetric":
        chaining_key, key = hkdf(self.chaining_key, material, 2)
        return Symmetric(chaining_key, self.hash, key)

    def mix_ephemeral(self, public: bytes) -> "Symmetric":
        """The token `e` of a pattern with a pre-shared key (section 9.2)."""
        return self.mix_hash(public).mix_key(public)

    def seal(self, clear: bytes) -> bytes:
        """EncryptAndHash, but for the hash."""
        return AESGCM(self.key).encrypt(_NONCE, clear, self.hash)

    def open(self, sealed: bytes) -> bytes | None:
        """DecryptAndHash, but for the hash; None if it is not authentic."""
        try:
            return AESGCM(self.key).decrypt(_NONCE, sealed, self.hash)
        except InvalidTag:
            return None

    def split(self) -> Secrets:
        forward, backward = hkdf(self.chaining_key, b"", 2)
        return Secrets(forward, backward, self.hash)


Waiting = tuple[Symmetric, X25519PrivateKey]
"""What the initiator holds until the answer comes."""
Heard = tuple[Symmetric, bytes]
"""What the responder holds until it answers: with the public key of the initiator."""


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


def _begin(shared: tuple[bytes, bytes], prologue: bytes) -> Symmetric:
    chaining_key, mixed = shared
    return Symmetric(chaining_key, sha256(_FIRST + prologue).digest(), b"").mix_hash(mixed)


def call(shared: tuple[bytes, bytes], prologue: bytes, private: bytes, payload: bytes) -> tuple[bytes, Waiting]:
    """The message `psk, e`. Both ends must have the same prologue, which is not part of the messages; `private` are
    `PRIVATE_BYTES` random bytes that serve for this message alone."""
    own = X25519PrivateKey.from_private_bytes(private)
    public = own.public_key().public_bytes_raw()
    state = _begin(shared, prologue).mix_ephemeral(public)
    sealed = state.seal(payload)
    return public + sealed, (state.mix_hash(sealed), own)


def hear(shared: tuple[bytes, bytes], prologue: bytes, message: bytes) -> tuple[bytes, Heard] | None:
    """The payload of the message `psk, e`; None if it is not authentic. Needs no X25519."""
    public, sealed = message[:PUBLIC_BYTES], message[PUBLIC_BYTES:]
    state = _begin(shared, prologue).mix_ephemeral(public)
    payload = state.open(sealed)
    return None if payload is None else (payload, (state.mix_hash(sealed), public))


def answer(heard: Heard, private: bytes, payload: bytes) -> tuple[bytes, Secrets] | None:
    """The message `e, ee` and the secrets; only once. None if the peer's public key is invalid."""
    state, peer = heard
    own = X25519PrivateKey.from_private_bytes(private)
    shared = _exchange(own, peer)
    if shared is None:
        return None
    public = own.public_key().public_bytes_raw()
    state = state.mix_ephemeral(public).mix_key(shared)
    sealed = state.seal(payload)
    return public + sealed, state.mix_hash(sealed).split()


def open_answer(waiting: Waiting, message: bytes) -> tuple[bytes, Secrets] | None:
    """Payload of the message `e, ee`, and the secrets; None if it is not authentic. May be tried again."""
    state, own = waiting
    public, sealed = message[:PUBLIC_BYTES], message[PUBLIC_BYTES:]
    shared = _exchange(own, public)
    if shared is None:
        return None
    state = state.mix_ephemeral(public).mix_key(shared)
    payload = state.open(sealed)
    return None if payload is None else (payload, state.mix_hash(sealed).split())


def _exchange(private: X25519PrivateKey, public: bytes) -> bytes | None:
    """DH of section 12.1. None for a wrong length, or a point of low order, whose secret everybody knows."""
    try:
        return private.exchange(X25519PublicKey.from_public_bytes(public))
    except ValueError:
        return None
