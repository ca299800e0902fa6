"""The suite without secrecy: finds damage and mix-ups, not forgery. For one host, where it must be asked for by name.

A CRC-32 that starts from a session id, the direction and the full sequence number, so that a damaged, reflected or
misnumbered datagram and one of another session fail as they would under a real key.
"""

from hashlib import sha256
from zlib import crc32

from protocol.wire import CLEAR_BYTES

_TAG = 4


class Checksum:
    """The `Security` of a link that is trusted."""

    __slots__ = ()

    tag_size = _TAG
    proof_size = _TAG
    private_size = 0
    public_size = 0

    def public_key(self, private: bytes) -> bytes:
        return private

    def proof(self, message: bytes) -> bytes:
        return crc32(message).to_bytes(_TAG, "little")

    def protect(
        self, *, is_initiator: bool, private: bytes, peer_public: bytes, transcript: bytes
    ) -> "ChecksumProtection":
        del private, peer_public  # of no bytes here
        session = sha256(transcript).digest()
        forward, backward = int.from_bytes(session[:4], "little"), int.from_bytes(session[4:8], "little")
        return ChecksumProtection(forward, backward) if is_initiator else ChecksumProtection(backward, forward)


class ChecksumProtection:
    """One session's start values of the CRC; a change of keys changes them."""

    __slots__ = ("_incoming", "_outgoing", "_previous")

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
