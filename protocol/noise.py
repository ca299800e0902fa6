"""Key exchange Noise_NNpsk0_25519_AESGCM_SHA256: two messages that derive fresh keys from a pre-shared one.

Section numbers are those of the Noise Protocol Framework, revision 34. The pattern (sections 7.4 and 9.4):

    -> psk, e       `Initiator.hello`, `Responder.read`
    <- e, ee        `Initiator.open`, `Responder.answer`

Both messages carry an encrypted payload. The first one proves that its sender held the key at some time; it may be a
recording. Only the two ends know the derived keys, even if the pre-shared key becomes known later. An ephemeral key
must never be used for two messages: the payload is encrypted under a key derived from it.
"""

from collections.abc import Callable
from copy import copy
from hashlib import sha256
from hmac import digest
from typing import Any, NamedTuple

from cryptography.exceptions import InvalidTag
from cryptography.hazmat.primitives.asymmetric.x25519 import X25519PrivateKey, X25519PublicKey
from cryptography.hazmat.primitives.ciphers.aead import AESGCM

NAME = b"Noise_NNpsk0_25519_AESGCM_SHA256"
_FIRST = NAME.ljust(32, b"\0")
"""InitializeSymmetric: a name of up to 32 bytes is its own hash, padded with zeros."""
PSK_BYTES = 32
PRIVATE_BYTES = 32
PUBLIC_BYTES = 32
OVERHEAD = PUBLIC_BYTES + 16
"""Bytes that each message adds to its payload: the public key and the tag."""


class Secrets(NamedTuple):
    """The secrets that both ends share after both messages."""

    forward: bytes
    """Key from initiator to responder, of 32 bytes."""
    backward: bytes
    handshake_hash: bytes
    """Hash of both messages (section 11.2)."""


def hkdf(chaining_key: bytes, material: bytes, count: int) -> list[bytes]:
    """Two or three keys of 32 bytes (section 4.3)."""
    temporary = digest(chaining_key, material, "sha256")
    outputs: list[bytes] = []
    for number in range(1, count + 1):
        previous = outputs[-1] if outputs else b""
        outputs.append(digest(temporary, previous + bytes((number,)), "sha256"))
    return outputs


class SharedKey:
    """A pre-shared key after the token `psk` (section 9.2), which comes first and so is the same in every handshake."""

    def __init__(self, psk: bytes) -> None:
        self.chaining_key, self.mixed, _ = hkdf(_FIRST, psk, 3)


class SymmetricState:
    """Section 5.2, with the CipherState of section 5.1; ready for the first token after `psk`. It may be copied."""

    def __init__(self, shared: SharedKey, prologue: bytes) -> None:
        self._chaining_key = shared.chaining_key
        self._hash = sha256(_FIRST + prologue).digest()
        self.mix_hash(shared.mixed)
        self._key = b""  # until the token `e`
        self._nonce = 0

    def mix_key(self, material: bytes) -> None:
        self._chaining_key, self._key = hkdf(self._chaining_key, material, 2)
        self._nonce = 0

    def mix_hash(self, data: bytes) -> None:
        self._hash = sha256(self._hash + data).digest()

    def mix_ephemeral(self, public: bytes) -> None:
        """The token `e` of a pattern with a pre-shared key (section 9.2)."""
        self.mix_hash(public)
        self.mix_key(public)

    def encrypt_and_hash(self, clear: bytes) -> bytes:
        sealed = AESGCM(self._key).encrypt(self._take_nonce(), clear, self._hash)
        self.mix_hash(sealed)
        return sealed

    def decrypt_and_hash(self, sealed: bytes) -> bytes | None:
        """The clear text; None if it is not authentic, and the state must not be used again."""
        try:
            clear = AESGCM(self._key).decrypt(self._take_nonce(), sealed, self._hash)
        except InvalidTag:
            return None
        self.mix_hash(sealed)
        return clear

    def _take_nonce(self) -> bytes:
        """Section 12.3: 32 bits of zero, then the counter, big-endian."""
        nonce = self._nonce.to_bytes(12, "big")
        self._nonce += 1
        return nonce

    def split(self) -> Secrets:
        forward, backward = hkdf(self._chaining_key, b"", 2)
        return Secrets(forward, backward, self._hash)


class Initiator:
    """Writes the first message and reads the second."""

    def __init__(self, shared: SharedKey, prologue: bytes, private: bytes, finish: Callable[[Secrets], Any]) -> None:
        """Prepare. Both ends must have the same prologue, which is not part of the messages; `private` are
        `PRIVATE_BYTES` random bytes that serve for this message alone; `finish` makes the keys of the session."""
        self._private = X25519PrivateKey.from_private_bytes(private)
        self._state = SymmetricState(shared, prologue)
        self._finish = finish

    def hello(self, payload: bytes) -> bytes:
        """The message `psk, e`; only once."""
        public = self._private.public_key().public_bytes_raw()
        self._state.mix_ephemeral(public)
        return public + self._state.encrypt_and_hash(payload)

    def open(self, message: bytes) -> tuple[bytes, Any] | None:
        """Payload of the message `e, ee`, and the keys; None if it is not authentic. May be tried again."""
        state, public = copy(self._state), message[:PUBLIC_BYTES]
        state.mix_ephemeral(public)
        shared = _exchange(self._private, public)
        if shared is None:
            return None
        state.mix_key(shared)
        payload = state.decrypt_and_hash(message[PUBLIC_BYTES:])
        return None if payload is None else (payload, self._finish(state.split()))


class Responder:
    """Has read the first message, with this payload, and writes the second."""

    def __init__(self, state: SymmetricState, peer: bytes, payload: bytes, finish: Callable[[Secrets], Any]) -> None:
        self.payload = payload
        self._state = state
        self._peer = peer
        self._finish = finish

    @classmethod
    def read(
        cls, shared: SharedKey, prologue: bytes, message: bytes, finish: Callable[[Secrets], Any]
    ) -> "Responder | None":
        """Read the message `psk, e`; None if it is not authentic. Needs no X25519."""
        state, public = SymmetricState(shared, prologue), message[:PUBLIC_BYTES]
        state.mix_ephemeral(public)
        payload = state.decrypt_and_hash(message[PUBLIC_BYTES:])
        return None if payload is None else cls(state, public, payload, finish)

    def answer(self, payload: bytes, private: bytes) -> tuple[bytes, Any] | None:
        """The message `e, ee` and the keys; only once. None if the peer's public key is invalid."""
        ours = X25519PrivateKey.from_private_bytes(private)
        shared = _exchange(ours, self._peer)
        if shared is None:
            return None
        public = ours.public_key().public_bytes_raw()
        self._state.mix_ephemeral(public)
        self._state.mix_key(shared)
        return public + self._state.encrypt_and_hash(payload), self._finish(self._state.split())


def _exchange(private: X25519PrivateKey, public: bytes) -> bytes | None:
    """DH of section 12.1. None for a wrong length, or a point of low order, whose secret everybody knows."""
    try:
        return private.exchange(X25519PublicKey.from_public_bytes(public))
    except ValueError:
        return None
