"""The suite with a pre-shared key: fresh session keys, every datagram encrypted and authenticated.

The only module that loads `cryptography`; nothing here imports it unless a key is configured.

- Proof of a handshake message: HMAC-SHA256 under a key derived from the PSK, first 16 bytes.
- Session keys: HKDF-SHA256 (RFC 5869) over the X25519 secret (RFC 7748) of two ephemeral keys, salted with a second key
  derived from the PSK, with the transcript as info. Who learns the PSK later cannot read what was recorded earlier.
- Datagrams: AES-128-CCM with an 8-byte tag (RFC 6655 uses the same), which keeps a 3-DoF update at 48 bytes. Nonce:
  5 bytes of salt for the direction and the full sequence number, which never repeats under a key.
"""

from hmac import digest

from cryptography.exceptions import InvalidTag
from cryptography.hazmat.primitives.asymmetric.x25519 import X25519PrivateKey, X25519PublicKey
from cryptography.hazmat.primitives.ciphers.aead import AESCCM
from cryptography.hazmat.primitives.hashes import SHA256
from cryptography.hazmat.primitives.hmac import HMAC
from cryptography.hazmat.primitives.kdf.hkdf import HKDF

from protocol.wire import CLEAR_BYTES

KEY_BYTES = 32
_CCM_KEY = 16
_SALT = 5
_TAG = 8
SECRET_BYTES = 32
_PROOF = 16


def _derive(secret: bytes, length: int, salt: bytes | None, info: bytes) -> bytes:
    return HKDF(SHA256(), length=length, salt=salt, info=info).derive(secret)


class PresharedKey:
    """The `Security` of two ends that hold the same key."""

    __slots__ = ("_mixing_key", "_proof_key")

    tag_size = _TAG
    proof_size = _PROOF
    private_size = 32
    public_size = 32

    def __init__(self, key: bytes) -> None:
        """Derive what the suite needs from the shared key.

        Raises:
            ValueError: if the key is not of `KEY_BYTES`.
        """
        if len(key) != KEY_BYTES:
            raise ValueError(f"a pre-shared key has {KEY_BYTES} bytes, not {len(key)}")
        self._proof_key = _derive(key, 32, None, b"weberlink handshake proof")
        self._mixing_key = _derive(key, 32, None, b"weberlink session keys")

    def public_key(self, private: bytes) -> bytes:
        return X25519PrivateKey.from_private_bytes(private).public_key().public_bytes_raw()

    def proof(self, message: bytes) -> bytes:
        mac = HMAC(self._proof_key, SHA256())
        mac.update(message)
        return mac.finalize()[:_PROOF]

    def protect(
        self, *, is_initiator: bool, private: bytes, peer_public: bytes, transcript: bytes
    ) -> "CcmProtection | None":
        try:
            peer = X25519PublicKey.from_public_bytes(peer_public)
            shared = X25519PrivateKey.from_private_bytes(private).exchange(peer)
        except ValueError:  # wrong length, or a point of low order, whose secret everybody knows
            return None
        material = _derive(shared, 2 * SECRET_BYTES, self._mixing_key, transcript)
        forward, backward = material[:SECRET_BYTES], material[SECRET_BYTES:]
        return CcmProtection(forward, backward) if is_initiator else CcmProtection(backward, forward)


class CcmProtection:
    """The keys of one session: a secret per direction, from which key and nonce salt follow, and the next secret.

    `open` of one phase and the next is RFC 9001 section 6: only the secrets change, sequence numbers go on.
    """

    __slots__ = ("_decrypt", "_encrypt", "_incoming", "_next", "_outgoing", "_previous")

    def __init__(self, outgoing: bytes, incoming: bytes) -> None:
        """Take the secret of each direction, of `SECRET_BYTES`."""
        self._outgoing = outgoing
        self._incoming = incoming
        self._encrypt = _Cipher(outgoing)
        self._decrypt = _Cipher(incoming)
        self._next: _Cipher | None = None
        self._previous: _Cipher | None = None

    def seal(self, sequence: int, clear: bytes) -> bytes:
        encrypt, salt = self._encrypt.encrypt, self._encrypt.salt
        head = clear[:CLEAR_BYTES]
        return head + encrypt(salt + sequence.to_bytes(8, "little"), clear[CLEAR_BYTES:], head)

    def open(self, sequence: int, datagram: bytes) -> bytes | None:
        return self._decrypt.open(sequence, datagram)

    def rekey_outgoing(self) -> None:
        self._outgoing = _next_secret(self._outgoing)
        self._encrypt = _Cipher(self._outgoing)

    def rekey_incoming(self) -> None:
        self._previous, self._decrypt = self._decrypt, self._following()
        self._incoming = _next_secret(self._incoming)
        self._next = None

    def open_next(self, sequence: int, datagram: bytes) -> bytes | None:
        return self._following().open(sequence, datagram)

    def open_previous(self, sequence: int, datagram: bytes) -> bytes | None:
        return None if self._previous is None else self._previous.open(sequence, datagram)

    def _following(self) -> "_Cipher":
        if self._next is None:
            self._next = _Cipher(_next_secret(self._incoming))
        return self._next


class _Cipher:
    """AES-128-CCM under the key and nonce salt of one secret."""

    __slots__ = ("_decrypt", "encrypt", "salt")

    def __init__(self, secret: bytes) -> None:
        material = _expand(secret, b"weberlink key", _CCM_KEY + _SALT)
        cipher = AESCCM(material[:_CCM_KEY], tag_length=_TAG)
        self.encrypt = cipher.encrypt
        self._decrypt = cipher.decrypt
        self.salt = material[_CCM_KEY:]

    def open(self, sequence: int, datagram: bytes) -> bytes | None:
        nonce = self.salt + sequence.to_bytes(8, "little")
        try:
            return self._decrypt(nonce, datagram[CLEAR_BYTES:], datagram[:CLEAR_BYTES])
        except InvalidTag:
            return None


def _next_secret(secret: bytes) -> bytes:
    return _expand(secret, b"weberlink key update", SECRET_BYTES)


def _expand(secret: bytes, info: bytes, length: int) -> bytes:
    """HKDF-Expand of RFC 5869 section 2.3, of up to one block: T(1) = HMAC(secret, info | 1)."""
    return digest(secret, info + b"\x01", "sha256")[:length]
