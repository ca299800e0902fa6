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

    def call(self, prologue: bytes, private: bytes) -> "OutgoingExchange":
        return OutgoingExchange(prologue, private)

    def hear(self, prologue: bytes, message: bytes) -> "IncomingExchange | None":
        payload = _unwrap(prologue, message)
        return None if payload is None else IncomingExchange(prologue + message, payload)


class OutgoingExchange:
    """The initiator's part in one handshake."""

    def __init__(self, prologue: bytes, nonce: bytes) -> None:
        self._transcript = prologue
        self._nonce = nonce

    def hello(self, payload: bytes) -> bytes:
        message = _wrap(self._transcript, self._nonce + payload)
        self._transcript += message
        return message

    def open(self, message: bytes) -> tuple[bytes, Protection] | None:
        payload = _unwrap(self._transcript, message)
        if payload is None:
            return None
        forward, backward = _ciphers(self._transcript + message)
        return payload, Protection(forward, backward)


class IncomingExchange:
    """The responder's part in one handshake."""

    def __init__(self, transcript: bytes, payload: bytes) -> None:
        self._transcript = transcript
        self.payload = payload

    def answer(self, payload: bytes, private: bytes) -> tuple[bytes, Protection]:
        message = _wrap(self._transcript, private + payload)
        forward, backward = _ciphers(self._transcript + message)
        return message, Protection(backward, forward)


def _wrap(before: bytes, content: bytes) -> bytes:
    """Content and its checksum, which starts from a hash of the transcript."""
    start = int.from_bytes(sha256(before).digest()[:4], "little")
    return content + crc32(content, start).to_bytes(_TAG, "little")


def _unwrap(before: bytes, message: bytes) -> bytes | None:
    """The payload of a message (nonce, payload, checksum); None if the checksum is wrong."""
    content = message[:-_TAG]
    return content[_NONCE:] if len(content) >= _NONCE and _wrap(before, content) == message else None


def _ciphers(transcript: bytes) -> "tuple[ChecksumCipher, ChecksumCipher]":
    """The cipher of the direction from the initiator, and that of the other direction."""
    session = sha256(transcript).digest()
    forward, backward = (ChecksumCipher(int.from_bytes(session[at : at + 4], "little")) for at in (0, 4))
    return forward, backward


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
