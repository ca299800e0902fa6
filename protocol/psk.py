"""Security suite with a pre-shared key: fresh session keys, every datagram encrypted and authenticated.

This module and `weberlink.protocol.noise` load `cryptography`; they are imported only where a key is configured.

- Handshake: Noise_NNpsk0_25519_AESGCM_SHA256 (`weberlink.protocol.noise`). A key that leaks later does not reveal
  recorded sessions.
- Secret of a direction: HKDF-Extract (RFC 5869) of that direction's key from Split(), with the handshake hash as salt.
- Key and nonce salt of a direction: HKDF-Expand of its secret. The next secret: HKDF-Expand of it under another label.
- Datagrams: AES-128-CCM with an 8-byte tag (RFC 6655 uses the same), a third of a 3-DoF force update. Nonce: 5 bytes of
  salt for the direction and the full sequence number (8 bytes), which never repeats under a key.
"""

from collections.abc import Mapping
from hmac import digest
from typing import ClassVar, Final

from cryptography.exceptions import InvalidTag
from cryptography.hazmat.primitives.ciphers.aead import AESCCM

from weberlink.compiled import mypyc_attr
from weberlink.protocol.handshake import identity_in, identity_of
from weberlink.protocol.noise import OVERHEAD, PRIVATE_BYTES, PSK_BYTES, Initiator, Responder, Secrets, SharedKey
from weberlink.protocol.security import Incoming, Outgoing, Protection
from weberlink.protocol.wire import CLEAR_BYTES

SECRET_BYTES: Final = 32
_CCM_KEY: Final = 16
_SALT: Final = 5
_TAG: Final = 8


@mypyc_attr(allow_interpreted_subclasses=True)
class PresharedKey:
    """The `Security` of two ends that hold the same key."""

    tag_size: ClassVar[int] = _TAG
    overhead: ClassVar[int] = OVERHEAD
    private_size: ClassVar[int] = PRIVATE_BYTES

    def __init__(self, key: bytes) -> None:
        """Take the shared key.

        Raises:
            ValueError: if the key does not have `PSK_BYTES`.
        """
        if len(key) != PSK_BYTES:
            raise ValueError(f"a pre-shared key has {PSK_BYTES} bytes, not {len(key)}")
        self._key = SharedKey(key)

    def call(self, prologue: bytes, private: bytes) -> Initiator:
        return Initiator(self._key, prologue, private, _initiator_keys)

    def hear(self, prologue: bytes, message: bytes) -> Responder | None:
        return Responder.read(self._key, prologue, message, _responder_keys)


class Keyring:
    """The `Security` of a responder that holds a key for each of several peers, by name.

    The header of a HELLO names its sender by a hash, which chooses the key. The name in the sealed payload must have
    that hash, so the key of one peer opens no session under the name of another.
    """

    tag_size: ClassVar[int] = PresharedKey.tag_size
    overhead: ClassVar[int] = PresharedKey.overhead
    private_size: ClassVar[int] = PresharedKey.private_size

    def __init__(self, keys: Mapping[str, bytes]) -> None:
        self._suites = {identity_of(name): PresharedKey(key) for name, key in keys.items()}

    def call(self, prologue: bytes, private: bytes) -> Outgoing:  # noqa: ARG002 - of the contract
        raise TypeError("a keyring is for the end that is called")

    def hear(self, prologue: bytes, message: bytes) -> Incoming | None:
        suite = self._suites.get(identity_in(prologue))
        return None if suite is None else suite.hear(prologue, message)


def _initiator_keys(secrets: Secrets) -> Protection:
    salt, forward, backward = secrets.handshake_hash, secrets.forward, secrets.backward
    return Protection(CcmCipher(digest(salt, forward, "sha256")), CcmCipher(digest(salt, backward, "sha256")))


def _responder_keys(secrets: Secrets) -> Protection:
    return _initiator_keys(secrets._replace(forward=secrets.backward, backward=secrets.forward))


class CcmCipher:
    """AES-128-CCM under the key and nonce salt of the secret of one direction, of `SECRET_BYTES`."""

    def __init__(self, secret: bytes) -> None:
        material = _expand(secret, b"weberlink key", _CCM_KEY + _SALT)
        cipher = AESCCM(material[:_CCM_KEY], tag_length=_TAG)
        self._encrypt, self._decrypt = cipher.encrypt, cipher.decrypt
        self._salt = material[_CCM_KEY:]
        self._secret = secret

    def seal(self, sequence: int, clear: bytes) -> bytes:
        head = clear[:CLEAR_BYTES]
        return head + self._encrypt(self._salt + sequence.to_bytes(8, "little"), clear[CLEAR_BYTES:], head)

    def open(self, sequence: int, datagram: bytes) -> bytes | None:
        nonce = self._salt + sequence.to_bytes(8, "little")
        try:
            return self._decrypt(nonce, datagram[CLEAR_BYTES:], datagram[:CLEAR_BYTES])
        except InvalidTag:
            return None

    def next(self) -> "CcmCipher":
        return CcmCipher(_expand(self._secret, b"weberlink key update", SECRET_BYTES))


def _expand(secret: bytes, info: bytes, length: int) -> bytes:
    """HKDF-Expand of RFC 5869 section 2.3, of up to one block: T(1) = HMAC(secret, info | 1)."""
    return digest(secret, info + b"\x01", "sha256")[:length]
