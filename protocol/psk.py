"""Security suite with a pre-shared key: fresh session keys, every datagram encrypted and authenticated.

This module and `weberlink.protocol.noise` load `cryptography`; they are imported only where a key is configured.

- Handshake: Noise_NNpsk0_25519_AESGCM_SHA256 (`weberlink.protocol.noise`). A key that leaks later does not reveal
  recorded sessions.
- Secret of a direction: HKDF-Extract (RFC 5869) of that direction's key from Split(), with the handshake hash as salt.
- Key and nonce salt of a direction: HKDF-Expand of its secret. The next secret: HKDF-Expand of it under another label.
- Datagrams: AES-128-CCM with an 8-byte tag (RFC 6655 uses the same), a third of a 3-DoF force update. Nonce: 5 bytes of
  salt for the direction and the full sequence number (8 bytes), which never repeats under a key.
- First byte: kind, mark and selector are hidden by a pad, HMAC-SHA256 of the number under a key of its own, which is
  added modulo the number of values that are no handshake. The byte is authenticated as it is sent.
"""

import os
from collections.abc import Iterable
from hmac import digest
from struct import Struct
from typing import ClassVar, Final

from cryptography.exceptions import InvalidTag
from cryptography.hazmat.primitives.ciphers.aead import AESCCM

from weberlink.compiled import mypyc_attr
from weberlink.protocol import noise
from weberlink.protocol.handshake import HELLO_HEADER, identity_of
from weberlink.protocol.keys import Grant, HeldKey
from weberlink.protocol.noise import OVERHEAD, PRIVATE_BYTES, PSK_BYTES, Heard, Secrets, Waiting
from weberlink.protocol.security import Protection
from weberlink.protocol.wire import CLEAR_BYTES, PHASE

SECRET_BYTES: Final = 32
_CCM_KEY: Final = 16
_SALT: Final = 5
_TAG: Final = 8
_PADS: Final = Struct("<16H")  # of a hash, for as many numbers
_VALUES: Final = bytes((0, *range(3, PHASE)))  # what the first byte hides: 7 bits, but no handshake


def _turned(by: int) -> bytes:
    """What `bytes.translate` needs to put another value in the place of each, and keep the phase."""
    shown = _VALUES[by:] + _VALUES[:by]
    return bytes.maketrans(_of_both_phases(_VALUES), _of_both_phases(shown))


def _of_both_phases(values: bytes) -> bytes:
    return values + bytes(value | PHASE for value in values)


_TURNS: Final = tuple(map(_turned, range(len(_VALUES))))
# How often this process was copied since its beginning: a copy would seal other datagrams under the same numbers.
_copies: Final = [0]


def _on_copied() -> None:
    _copies[0] += 1


os.register_at_fork(after_in_child=_on_copied)


@mypyc_attr(allow_interpreted_subclasses=True)
class PresharedKey:
    """The `Security` of two ends that hold the same key."""

    tag_size: ClassVar[int] = _TAG
    overhead: ClassVar[int] = OVERHEAD
    private_size: ClassVar[int] = PRIVATE_BYTES

    def __init__(self, key: bytes) -> None:
        """Take the shared key; ValueError if it does not have `PSK_BYTES`."""
        if len(key) != PSK_BYTES:
            raise ValueError(f"a pre-shared key has {PSK_BYTES} bytes, not {len(key)}")
        self._shared = noise.shared_key(key)
        self._grant = HeldKey(key).grant

    def call(self, prologue: bytes, private: bytes, payload: bytes) -> tuple[bytes, Waiting]:
        return noise.call(self._shared, prologue, private, payload)

    def hear(self, prologue: bytes, message: bytes) -> tuple[bytes, Heard, Grant] | None:
        heard = noise.hear(self._shared, prologue, message)
        return None if heard is None else (*heard, self._grant)

    def holds(self, grant: Grant) -> bool:
        return grant == self._grant

    def answer(self, state: Heard, private: bytes, payload: bytes) -> tuple[bytes, Protection] | None:
        answered = noise.answer(state, private, payload)
        if answered is None:
            return None
        message, secrets = answered
        forward, backward = _ciphers(secrets)
        return message, Protection(backward, forward)

    def open(self, state: Waiting, message: bytes) -> tuple[bytes, Protection] | None:
        opened = noise.open_answer(state, message)
        return None if opened is None else (opened[0], Protection(*_ciphers(opened[1])))


class Keyring(PresharedKey):
    """The `Security` of a responder that holds several keys, each with its right, and most for one peer by name.

    The header of a HELLO names its sender by a hash, which chooses the key; a name that no key has is served by the key
    without a name, if there is one. The name in the sealed payload must have that hash, so the key of one peer opens no
    session under the name of another."""

    def __init__(self, keys: Iterable[HeldKey]) -> None:
        # Without a key of its own: `PresharedKey.__init__` is not called, and what needs one fails.
        self.replace(keys)

    def replace(self, keys: Iterable[HeldKey]) -> None:
        """Hold these keys from now on; what began under another one goes on until it is asked about (`holds`)."""
        suites = {key.name: (PresharedKey(key.key), key.grant) for key in keys}
        self._nameless = suites.pop("", None)
        self._named = {identity_of(name): held for name, held in suites.items()}

    def call(self, prologue: bytes, private: bytes, payload: bytes) -> tuple[bytes, Waiting]:  # noqa: ARG002 - of the contract
        raise TypeError("a keyring is for the end that is called")

    def hear(self, prologue: bytes, message: bytes) -> tuple[bytes, Heard, Grant] | None:
        held = self._named.get(HELLO_HEADER.unpack_from(prologue)[2], self._nameless)
        heard = None if held is None else held[0].hear(prologue, message)
        return None if heard is None or held is None else (heard[0], heard[1], held[1])

    def holds(self, grant: Grant) -> bool:
        held = self._named.get(identity_of(grant.name)) if grant.name else self._nameless
        return held is not None and held[1] == grant


def _ciphers(secrets: Secrets) -> "tuple[CcmCipher, CcmCipher]":
    """Of the direction from the initiator, and of the other direction."""
    forward, backward, salt = secrets
    return CcmCipher(digest(salt, forward, "sha256")), CcmCipher(digest(salt, backward, "sha256"))


class CcmCipher:
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
