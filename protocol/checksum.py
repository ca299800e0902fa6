"""Security suite without a key, for loopback: detects damaged and misdirected datagrams, not forged ones.

A CRC-32 that starts from a session id, the direction and the full sequence number, so that a damaged, reflected or
misnumbered datagram and one of another session fail as they would under a real key.
"""

from hashlib import sha256
from zlib import crc32

from weberlink.protocol.wire import CLEAR_BYTES

_TAG = 4
_NONCE = 16


class Checksum:
    """The `Security` of a trusted link."""

    tag_size = _TAG
    overhead = _NONCE + _TAG
    private_size = _NONCE

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

    def open(self, message: bytes) -> "tuple[bytes, ChecksumProtection] | None":
        payload = _unwrap(self._transcript, message)
        if payload is None:
            return None
        forward, backward = _starts(self._transcript + message)
        return payload, ChecksumProtection(forward, backward)


class IncomingExchange:
    """The responder's part in one handshake."""

    def __init__(self, transcript: bytes, payload: bytes) -> None:
        self._transcript = transcript
        self.payload = payload

    def answer(self, payload: bytes, private: bytes) -> "tuple[bytes, ChecksumProtection]":
        message = _wrap(self._transcript, private + payload)
        forward, backward = _starts(self._transcript + message)
        return message, ChecksumProtection(backward, forward)


def _wrap(before: bytes, content: bytes) -> bytes:
    """Content and its checksum, which starts from a hash of the transcript."""
    start = int.from_bytes(sha256(before).digest()[:4], "little")
    return content + crc32(content, start).to_bytes(_TAG, "little")


def _unwrap(before: bytes, message: bytes) -> bytes | None:
    """The payload of a message (nonce, payload, checksum); None if the checksum is wrong."""
    content = message[:-_TAG]
    return content[_NONCE:] if len(content) >= _NONCE and _wrap(before, content) == message else None


def _starts(transcript: bytes) -> tuple[int, int]:
    """Start values of the checksums of each direction."""
    session = sha256(transcript).digest()
    return int.from_bytes(session[:4], "little"), int.from_bytes(session[4:8], "little")


class ChecksumProtection:
    """One session's start values of the CRC; a change of keys changes them."""

    def __init__(self, outgoing: int, incoming: int) -> None:
        self._outgoing = outgoing
        self._incoming = incoming
        self._previous: int | None = None

    def seal(self, sequence: int, clear: bytes) -> bytes:
        return clear + crc32(clear, (self._outgoing + sequence) & 0xFFFF_FFFF).to_bytes(_TAG, "little")

    def open(self, sequence: int, datagram: bytes) -> bytes | None:
        return _open(self._incoming, sequence, datagram)

    def rekey_outgoing(self) -> None:
        self._outgoing = _next_start(self._outgoing)

    def rekey_incoming(self) -> None:
        self._previous, self._incoming = self._incoming, _next_start(self._incoming)

    def open_next(self, sequence: int, datagram: bytes) -> bytes | None:
        return _open(_next_start(self._incoming), sequence, datagram)

    def open_previous(self, sequence: int, datagram: bytes) -> bytes | None:
        return None if self._previous is None else _open(self._previous, sequence, datagram)


def _open(start: int, sequence: int, datagram: bytes) -> bytes | None:
    clear = datagram[:-_TAG]
    expected = crc32(clear, (start + sequence) & 0xFFFF_FFFF)
    return clear[CLEAR_BYTES:] if expected == int.from_bytes(datagram[-_TAG:], "little") else None


def _next_start(start: int) -> int:
    return crc32(b"weberlink key update", start)
