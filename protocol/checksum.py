"""Security suite without a key, for loopback: detects damaged and misdirected datagrams, not forged ones.

The tag is a CRC-32 that starts from the session, the direction and the full sequence number. So a datagram that is
damaged, reflected, misnumbered or of another session is rejected, as it would be under a real key.
"""

from hashlib import sha256
from typing import ClassVar
from zlib import crc32

from weberlink.protocol.security import Protection
from weberlink.protocol.wire import CLEAR_BYTES

_TAG = 4
_NONCE = 16


class Checksum:
    """The `Security` of a trusted link."""

    tag_size: ClassVar[int] = _TAG
    overhead: ClassVar[int] = _NONCE + _TAG
    private_size: ClassVar[int] = _NONCE

    def call(self, prologue: bytes, private: bytes) -> "Exchange":
        return Exchange(prologue, private, b"")

    def hear(self, prologue: bytes, message: bytes) -> "Exchange | None":
        payload = _opened(prologue, message)
        return None if payload is None else Exchange(prologue + message, b"", payload)


class Exchange:
    """Either end's part in one handshake. A message is a nonce, the payload and a checksum."""

    def __init__(self, transcript: bytes, nonce: bytes, payload: bytes) -> None:
        self.payload = payload
        self._transcript = transcript
        self._nonce = nonce

    def hello(self, payload: bytes) -> bytes:
        message = _sealed(self._transcript, self._nonce + payload)
        self._transcript += message
        return message

    def open(self, message: bytes) -> tuple[bytes, Protection] | None:
        payload = _opened(self._transcript, message)
        return None if payload is None else (payload, Protection(*_ciphers(self._transcript + message)))

    def answer(self, payload: bytes, private: bytes) -> tuple[bytes, Protection]:
        message = _sealed(self._transcript, private + payload)
        forward, backward = _ciphers(self._transcript + message)
        return message, Protection(backward, forward)


def _sealed(before: bytes, content: bytes) -> bytes:
    """Content and its checksum, which starts from a hash of all that came before."""
    start = int.from_bytes(sha256(before).digest()[:_TAG], "little")
    return content + crc32(content, start).to_bytes(_TAG, "little")


def _opened(before: bytes, message: bytes) -> bytes | None:
    """The payload of a message; None if the checksum is wrong."""
    content = message[:-_TAG]
    return content[_NONCE:] if len(content) >= _NONCE and _sealed(before, content) == message else None


def _ciphers(transcript: bytes) -> "tuple[ChecksumCipher, ChecksumCipher]":
    """Of the direction from the initiator, and of the other direction."""
    session = sha256(transcript).digest()
    first, second = (int.from_bytes(session[at : at + 4], "little") for at in (0, 4))
    return ChecksumCipher(first), ChecksumCipher(second)


class ChecksumCipher:
    """The start value of the CRC of one direction."""

    def __init__(self, start: int) -> None:
        self._start = start

    def seal(self, sequence: int, clear: bytes) -> bytes:
        return clear + crc32(clear, (self._start + sequence) & 0xFFFF_FFFF).to_bytes(_TAG, "little")

    def open(self, sequence: int, datagram: bytes) -> bytes | None:
        clear = datagram[:-_TAG]
        return clear[CLEAR_BYTES:] if self.seal(sequence, clear) == datagram else None

    def next(self) -> "ChecksumCipher":
        return ChecksumCipher(crc32(b"weberlink key update", self._start))
