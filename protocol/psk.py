"""The suite with a pre-shared key: fresh session keys, every datagram encrypted and authenticated.

The only module that loads `cryptography`; nothing here imports it unless a key is configured.

- Proof of a handshake message: HMAC-SHA256 under a key derived from the PSK, first 16 bytes.
- Session keys: HKDF-SHA256 (RFC 5869) over the X25519 secret (RFC 7748) of two ephemeral keys, salted with a second key
  derived from the PSK, with the transcript as info. Who learns the PSK later cannot read what was recorded earlier.
- Datagrams: AES-128-CCM with an 8-byte tag (RFC 6655 uses the same), which keeps a 3-DoF update at 48 bytes. Nonce:
  5 bytes of salt for the direction and the full sequence number, which never repeats under a key.
"""

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
        material = _derive(shared, 2 * (_CCM_KEY + _SALT), self._mixing_key, transcript)
        forward, backward = material[: _CCM_KEY + _SALT], material[_CCM_KEY + _SALT :]
        return CcmProtection(forward, backward) if is_initiator else CcmProtection(backward, forward)


class CcmProtection:
    """The two directional keys of one session."""

    __slots__ = ("_decrypt", "_encrypt", "_incoming_salt", "_outgoing_salt")

    def __init__(self, outgoing: bytes, incoming: bytes) -> None:
        """Take key and salt of each direction, joined."""
        self._encrypt = AESCCM(outgoing[:_CCM_KEY], tag_length=_TAG).encrypt
        self._decrypt = AESCCM(incoming[:_CCM_KEY], tag_length=_TAG).decrypt
        self._outgoing_salt = outgoing[_CCM_KEY:]
        self._incoming_salt = incoming[_CCM_KEY:]

    def seal(self, sequence: int, clear: bytes) -> bytes:
        head = clear[:CLEAR_BYTES]
        return head + self._encrypt(self._outgoing_salt + sequence.to_bytes(8, "little"), clear[CLEAR_BYTES:], head)

    def open(self, sequence: int, datagram: bytes) -> bytes | None:
        nonce = self._incoming_salt + sequence.to_bytes(8, "little")
        try:
            return self._decrypt(nonce, datagram[CLEAR_BYTES:], datagram[:CLEAR_BYTES])
        except InvalidTag:
            return None
