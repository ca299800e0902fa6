"""Security suite with a pre-shared key: fresh session keys, every datagram encrypted and authenticated.

It loads `cryptography`, and is imported only where a key is configured.

- Handshake: Noise_NNpsk0_25519_AESGCM_SHA256. Section numbers are those of the Noise Protocol Framework, revision 34.
  The pattern (sections 7.4 and 9.4) is `-> psk, e` (`call`, `hear`), `<- e, ee` (`answer`, `open`). Both messages carry
  an encrypted payload. The first one proves that its sender held the key at some time; it may be a recording. Only the
  two ends know the derived keys: a key that leaks later does not reveal recorded sessions. An ephemeral key must never
  be used for two messages: the payload is encrypted under a key derived from it.
- Secret of a direction: HKDF-Extract (RFC 5869) of that direction's key from Split(), with the handshake hash as salt.
- Key and nonce salt of a direction: HKDF-Expand of its secret. The next secret: HKDF-Expand of it under another label.
- Datagrams: AES-128-CCM with an 8-byte tag (RFC 6655 uses the same), a third of a 3-DoF force update. Nonce: 5 bytes of
  salt for the direction and the full sequence number (8 bytes), which never repeats under a key.
- First byte: kind, mark and selector are hidden by a pad, HMAC-SHA256 of the number under a key of its own, which is
  added modulo the number of values that are no handshake. The byte is authenticated as it is sent.
"""

import os
from collections.abc import Iterable
from hashlib import sha256
from hmac import digest
from struct import Struct
from typing import ClassVar, Final

from cryptography.exceptions import InvalidTag
from cryptography.hazmat.primitives.asymmetric.x25519 import X25519PrivateKey, X25519PublicKey
from cryptography.hazmat.primitives.ciphers.aead import AESCCM, AESGCM

from weberlink.compiled import mypyc_attr
from weberlink.protocol.handshake import HELLO_HEADER, identity_of
from weberlink.protocol.keys import KEY_BYTES, Grant, HeldKey
from weberlink.protocol.security import Cipher, Protection, Security
from weberlink.protocol.wire import CLEAR_BYTES, PHASE

NAME: Final = b"Noise_NNpsk0_25519_AESGCM_SHA256"
# InitializeSymmetric: a name of up to 32 bytes is its own hash, padded with zeros.
_FIRST: Final = NAME.ljust(32, b"\0")
_PUBLIC: Final = 32  # bytes of a public key
_ONCE: Final = bytes(12)  # nonce of section 12.3; each key encrypts one payload, so the counter is always 0
SECRET_BYTES: Final = 32
_CCM_KEY: Final = 16
_SALT: Final = 5
_TAG: Final = 8
_PADS: Final = Struct("<16H")  # of a hash, for as many numbers
_VALUES: Final = bytes((0, *range(3, PHASE)))  # what the first byte hides: 7 bits, but no handshake


def _of_both_phases(values: bytes) -> bytes:
    return values + bytes(value | PHASE for value in values)


# What `bytes.translate` needs to put another value in the place of each, and keep the phase; by how far it is turned.
_TURNS: Final = tuple(
    bytes.maketrans(_of_both_phases(_VALUES), _of_both_phases(_VALUES[by:] + _VALUES[:by]))
    for by in range(len(_VALUES))
)
# How often this process was copied since its beginning: a copy would seal other datagrams under the same numbers.
_copies: Final = [0]


def _on_copied() -> None:
    _copies[0] += 1


os.register_at_fork(after_in_child=_on_copied)

State = tuple[bytes, bytes]  # the SymmetricState of section 5.2 between two messages: chaining key and hash
Waiting = tuple[State, X25519PrivateKey]  # what the initiator holds until the answer comes
Heard = tuple[State, bytes]  # what the responder holds until it answers: with the public key of the initiator


def _hkdf(chaining_key: bytes, material: bytes) -> tuple[bytes, bytes, bytes]:
    """Three keys of 32 bytes (section 4.3); where two are needed, they are the first ones."""
    temporary = digest(chaining_key, material, "sha256")
    first = digest(temporary, b"\x01", "sha256")
    second = digest(temporary, first + b"\x02", "sha256")
    return first, second, digest(temporary, second + b"\x03", "sha256")


def _mix_hash(former: bytes, data: bytes) -> bytes:
    return sha256(former + data).digest()


def _mix_keys(state: State, public: bytes, secret: bytes = b"") -> tuple[bytes, bytes, AESGCM]:
    """The tokens `e` of a pattern with a pre-shared key (section 9.2) and, with a secret, `ee`: chaining key, hash, and
    cipher of the payload."""
    chaining_key, mixed = state
    chaining_key, key, _ = _hkdf(chaining_key, public)
    if secret:
        chaining_key, key, _ = _hkdf(chaining_key, secret)
    return chaining_key, _mix_hash(mixed, public), AESGCM(key)


def _exchange(private: X25519PrivateKey, public: bytes) -> bytes | None:
    """DH of section 12.1. None for a wrong length, or a point of low order, whose secret everybody knows."""
    try:
        return private.exchange(X25519PublicKey.from_public_bytes(public))
    except ValueError:
        return None


def _decrypted(cipher: AESGCM, sealed: bytes, mixed: bytes) -> bytes | None:
    try:
        return cipher.decrypt(_ONCE, sealed, mixed)
    except InvalidTag:
        return None


def ciphers(chaining_key: bytes, handshake_hash: bytes) -> "tuple[CcmCipher, CcmCipher]":
    """Of the direction from the initiator, and of the other direction, after both messages (Split() of section 5.2)."""
    forward, backward, _ = _hkdf(chaining_key, b"")
    return CcmCipher(digest(handshake_hash, forward, "sha256")), CcmCipher(digest(handshake_hash, backward, "sha256"))


@mypyc_attr(allow_interpreted_subclasses=True)
class _Noise(Security):
    """What a suite with keys does once the first message has told which one."""

    tag_size: ClassVar[int] = _TAG
    overhead: ClassVar[int] = _PUBLIC + 16  # public key and tag
    private_size: ClassVar[int] = 32

    def answer(self, state: Heard, private: bytes, payload: bytes) -> tuple[bytes, Protection] | None:
        began, peer = state
        own = X25519PrivateKey.from_private_bytes(private)
        secret = _exchange(own, peer)
        if secret is None:
            return None
        public = own.public_key().public_bytes_raw()
        chaining_key, mixed, cipher = _mix_keys(began, public, secret)
        sealed = cipher.encrypt(_ONCE, payload, mixed)
        forward, backward = ciphers(chaining_key, _mix_hash(mixed, sealed))
        return public + sealed, Protection(backward, forward)

    def open(self, state: Waiting, message: bytes) -> tuple[bytes, Protection] | None:
        began, own = state
        public, sealed = message[:_PUBLIC], message[_PUBLIC:]
        secret = _exchange(own, public)
        if secret is None:
            return None
        chaining_key, mixed, cipher = _mix_keys(began, public, secret)
        payload = _decrypted(cipher, sealed, mixed)
        return None if payload is None else (payload, Protection(*ciphers(chaining_key, _mix_hash(mixed, sealed))))


@mypyc_attr(allow_interpreted_subclasses=True)
class PresharedKey(_Noise):
    """The `Security` of two ends that hold the same key."""

    def __init__(self, key: bytes) -> None:
        """Take the shared key; ValueError if it does not have `KEY_BYTES`."""
        if len(key) != KEY_BYTES:
            raise ValueError(f"a pre-shared key has {KEY_BYTES} bytes, not {len(key)}")
        # The token `psk` (section 9.2) comes first, and so is the same in every handshake.
        self._chaining_key, self._mixed, _ = _hkdf(_FIRST, key)
        self._grant = HeldKey(key).grant

    def _begin(self, prologue: bytes, public: bytes) -> tuple[bytes, bytes, AESGCM]:
        began = self._chaining_key, _mix_hash(sha256(_FIRST + prologue).digest(), self._mixed)
        return _mix_keys(began, public)

    def call(self, prologue: bytes, private: bytes, payload: bytes) -> tuple[bytes, Waiting]:
        own = X25519PrivateKey.from_private_bytes(private)
        public = own.public_key().public_bytes_raw()
        chaining_key, mixed, cipher = self._begin(prologue, public)
        sealed = cipher.encrypt(_ONCE, payload, mixed)
        return public + sealed, ((chaining_key, _mix_hash(mixed, sealed)), own)

    def hear(self, prologue: bytes, message: bytes) -> tuple[bytes, Heard, Grant] | None:
        public, sealed = message[:_PUBLIC], message[_PUBLIC:]
        chaining_key, mixed, cipher = self._begin(prologue, public)
        payload = _decrypted(cipher, sealed, mixed)
        state = (chaining_key, _mix_hash(mixed, sealed)), public
        return None if payload is None else (payload, state, self._grant)

    def holds(self, grant: Grant) -> bool:
        return grant == self._grant


class Keyring(_Noise):
    """The `Security` of a responder that holds several keys, each with its right, and most for one peer by name.

    The header of a HELLO names its sender by a hash, which chooses the key; a name that no key has is served by the key
    without a name, if there is one. The name in the sealed payload must have that hash, so the key of one peer opens no
    session under the name of another."""

    def __init__(self, keys: Iterable[HeldKey]) -> None:
        self.replace(keys)

    def replace(self, keys: Iterable[HeldKey]) -> None:
        """Hold these keys from now on; what began under another one goes on until it is asked about (`holds`)."""
        suites = {key.name: (PresharedKey(key.key), key.grant) for key in keys}
        self._nameless = suites.pop("", None)
        self._named = {identity_of(name): held for name, held in suites.items()}

    def hear(self, prologue: bytes, message: bytes) -> tuple[bytes, Heard, Grant] | None:
        held = self._named.get(HELLO_HEADER.unpack_from(prologue)[2], self._nameless)
        heard = None if held is None else held[0].hear(prologue, message)
        return None if heard is None or held is None else (heard[0], heard[1], held[1])

    def holds(self, grant: Grant) -> bool:
        held = self._named.get(identity_of(grant.name)) if grant.name else self._nameless
        return held is not None and held[1] == grant


class CcmCipher(Cipher):
    """AES-128-CCM under the key and nonce salt of the secret of one direction, of `SECRET_BYTES`."""

    def __init__(self, secret: bytes) -> None:
        material = _expand(secret, b"weberlink key", _CCM_KEY + _SALT)
        cipher = AESCCM(material[:_CCM_KEY], tag_length=_TAG)
        self._encrypt, self._decrypt = cipher.encrypt, cipher.decrypt
        self._salt = material[_CCM_KEY:]
        self._secret = secret
        self._pad_key = _expand(secret, b"weberlink kind", SECRET_BYTES)
        self._padded = -1
        self._pads: tuple[int, ...] = ()
        self._copies = _copies[0]

    def seal(self, sequence: int, clear: bytes) -> bytes:
        """Raises RuntimeError in a copy of the process that made the keys."""
        if self._copies != _copies[0]:
            raise RuntimeError("a copied process cannot go on with the session of another one; begin a new session")
        head = clear[:1].translate(_TURNS[self._pad(sequence)]) + clear[1:CLEAR_BYTES]
        return head + self._encrypt(self._salt + sequence.to_bytes(8, "little"), clear[CLEAR_BYTES:], head)

    def open(self, sequence: int, datagram: bytes) -> bytes | None:
        nonce = self._salt + sequence.to_bytes(8, "little")
        try:
            body: bytes = self._decrypt(nonce, datagram[CLEAR_BYTES:], datagram[:CLEAR_BYTES])
        except InvalidTag:
            return None
        return datagram[:1].translate(_TURNS[-self._pad(sequence)]) + body

    def _pad(self, sequence: int) -> int:
        """How far the first byte of the datagram of this number is turned."""
        block = sequence >> 4
        if block != self._padded:
            pads = _PADS.unpack(digest(self._pad_key, block.to_bytes(8, "little"), "sha256"))
            self._padded, self._pads = block, tuple([pad % len(_VALUES) for pad in pads])
        return self._pads[sequence & 15]

    def next(self) -> "CcmCipher":
        made = CcmCipher(_expand(self._secret, b"weberlink key update", SECRET_BYTES))
        made._copies = self._copies
        return made


def _expand(secret: bytes, info: bytes, length: int) -> bytes:
    """HKDF-Expand of RFC 5869 section 2.3, of up to one block: T(1) = HMAC(secret, info | 1)."""
    return digest(secret, info + b"\x01", "sha256")[:length]
