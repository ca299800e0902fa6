"""Messages between two known peers, sealed so that the server that carries them can neither read nor make one.

All of it derives from the key of the pair by HKDF-SHA256 (RFC 5869), with a label for each use: the name of the mailbox
and of its two sides, which nobody can guess and which stay the same after every start, and one key for each direction.
A message is `nonce | ciphertext | tag` of AES-256-GCM in hexadecimal; the nonce is random, and the phase (the kind of
message, which the server sees) is authenticated with it. So a message opens in its own direction, as its own kind, at
these two hosts only. That it is not an old one is for `weberlink_anywhere.calls`.
"""

import os
from typing import Any, Final, Literal

import msgpack
from cryptography.exceptions import InvalidTag
from cryptography.hazmat.primitives.ciphers.aead import AESGCM
from cryptography.hazmat.primitives.hashes import SHA256
from cryptography.hazmat.primitives.kdf.hkdf import HKDF

Role = Literal["master", "slave"]
LONGEST_BODY: Final = 32768
"""Hexadecimal digits of a message; a longer one is not opened."""
_NONCE: Final = 12
_NAME: Final = 16
_KEY: Final = 32


class Sealing:
    """One end's names and keys at the mailbox server.

    Args:
        key: of the pair.
        role: of this end.
    """

    def __init__(self, key: bytes, role: Role) -> None:
        other: Role = "slave" if role == "master" else "master"
        self.role = role
        self.mailbox = _derive(key, "mailbox", _NAME).hex()
        self.side = _derive(key, f"side {role}", _NAME).hex()
        self.other_side = _derive(key, f"side {other}", _NAME).hex()
        self._ours = AESGCM(_derive(key, f"from {role}", _KEY))
        self._theirs = AESGCM(_derive(key, f"from {other}", _KEY))

    def seal(self, phase: str, content: list[Any]) -> str:
        """The body of a message to the other end; `content` is of what MessagePack has."""
        nonce = os.urandom(_NONCE)
        return (nonce + self._ours.encrypt(nonce, msgpack.packb(content), phase.encode())).hex()

    def open(self, phase: str, body: str) -> list[Any] | None:
        """What the other end sealed; None if it did not, or not as this phase."""
        if len(body) > LONGEST_BODY:
            return None
        try:
            sealed = bytes.fromhex(body)
            content = msgpack.unpackb(self._theirs.decrypt(sealed[:_NONCE], sealed[_NONCE:], phase.encode()))
        except (ValueError, InvalidTag):  # of MessagePack, too: the other end has another version
            return None
        return content if isinstance(content, list) else None


def _derive(key: bytes, use: str, length: int) -> bytes:
    return HKDF(SHA256(), length, salt=None, info=f"weberlink rendezvous 1 {use}".encode()).derive(key)
