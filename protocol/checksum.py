"""Security suite without a key, for loopback: detects damaged and misdirected datagrams, not forged ones.

The tag is a CRC-32 that starts from the session, the direction and the full sequence number. So a datagram that is
damaged, reflected, misnumbered or of another session is rejected, as it would be under a real key.
"""

from hashlib import sha256
from typing import ClassVar, Final
from zlib import crc32

from weberlink.compiled import mypyc_attr
from weberlink.protocol.keys import Grant
from weberlink.protocol.security import Protection
from weberlink.protocol.wire import CLEAR_BYTES

_TAG: Final = 4
_NONCE: Final = 16


@mypyc_attr(allow_interpreted_subclasses=True)
class Checksum:
    """The `Security` of a trusted link. A message is a nonce, the payload and a checksum; the state of a key exchange
    is all that was said in it."""

    tag_size: ClassVar[int] = _TAG
    overhead: ClassVar[int] = _NONCE + _TAG
    private_size: ClassVar[int] = _NONCE

    def call(self, prologue: bytes, private: bytes, payload: bytes) -> tuple[bytes, bytes]:
        message = _sealed(prologue, private + payload)
        return message, prologue + message

    def hear(self, prologue: bytes, message: bytes) -> tuple[bytes, bytes, Grant] | None:
        payload = _opened(prologue, message)
        return None if payload is None else (payload, prologue + message, Grant())

    def holds(self, grant: Grant) -> bool:
        return grant == Grant()

    def answer(self, state: bytes, private: bytes, payload: bytes) -> tuple[bytes, Protection]:
        message = _sealed(state, private + payload)
        forward, backward = _ciphers(state + message)
        return message, Protection(backward, forward)

    def open(self, state: bytes, message: bytes) -> tuple[bytes, Protection] | None:
        payload = _opened(state, message)
        return None if payload is None else (payload, Protection(*_ciphers(state + message)))


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
        tag = crc32(clear, (self._start + sequence) & 0xFFFF_FFFF).to_bytes(_TAG, "little")
        return clear[:1] + clear[CLEAR_BYTES:] if datagram[-_TAG:] == tag else None

    def next(self) -> "ChecksumCipher":
        return ChecksumCipher(crc32(b"weberlink key update", self._start))
