"""What a security suite provides: the key exchange of the handshake, and the protection of a session.

There are two suites: `weberlink.protocol.psk` (default between hosts) and `Checksum` (for loopback), with which a side
never loads a crypto library.
"""

from hashlib import sha256
from math import inf
from typing import Any, ClassVar, Final
from zlib import crc32

from weberlink.compiled import mypyc_attr
from weberlink.protocol.keys import Grant
from weberlink.protocol.wire import CLEAR_BYTES, PHASE

REKEY_AFTER_S: Final = 120.0
REKEY_AFTER: Final = 1 << 20
"""For how long, and for how many datagrams, one key seals what an end sends; far below the limit of AES-CCM (RFC 9147,
section 4.5.3)."""
_TAG: Final = 4  # of a checksum
_NONCE: Final = 16


class Cipher:
    """The keys of one direction."""

    def seal(self, sequence: int, clear: bytes) -> bytes:
        """The datagram to send, of which phase and number are readable. Never twice for one sequence number."""
        raise NotImplementedError

    def open(self, sequence: int, datagram: bytes) -> bytes | None:
        """The first byte that was sealed, and what follows the first `CLEAR_BYTES`; None if the datagram is not
        authentic under this number."""
        raise NotImplementedError

    def next(self) -> "Cipher":
        """The keys that replace these, derived from them one-way."""
        raise NotImplementedError


class Protection:
    """The keys of both directions of one session, replaced by time and by count as in RFC 9001 section 6: the first
    byte of a datagram tells the phase of its keys, which flips with each new key. Sequence numbers go on."""

    def __init__(self, outgoing: Cipher, incoming: Cipher) -> None:
        self._outgoing, self._incoming = outgoing, incoming
        self._next: Cipher | None = None
        self._previous: Cipher | None = None
        self._phase = self._incoming_phase = 0
        self._rekey_after = self._rekey_from = REKEY_AFTER
        self._rekey_at = inf

    def begin(self, now: float, sequence: int, rekey_after: int = REKEY_AFTER) -> None:
        """Begin with this number; a key seals so many datagrams at most."""
        self._rekey_after = rekey_after
        self._rekey_at, self._rekey_from = now + REKEY_AFTER_S, sequence + rekey_after

    def seal(self, sequence: int, clear: bytes, now: float) -> bytes:
        """The datagram to send. Never twice for one number."""
        if now >= self._rekey_at or sequence >= self._rekey_from:
            self._outgoing = self._outgoing.next()
            self._phase ^= PHASE
            self.begin(now, sequence, self._rekey_after)
        if self._phase:
            clear = bytes((clear[0] | PHASE,)) + clear[1:]
        return self._outgoing.seal(sequence, clear)

    def open(self, sequence: int, datagram: bytes, newest: int) -> bytes | None:
        """As `Cipher.open`. Changes nothing.

        A datagram of the other phase is of the next keys if its number is above the `newest` accepted one, else of the
        previous keys."""
        if datagram[0] & PHASE == self._incoming_phase:
            return self._incoming.open(sequence, datagram)
        if sequence > newest:
            self._next = self._next or self._incoming.next()
            return self._next.open(sequence, datagram)
        return None if self._previous is None else self._previous.open(sequence, datagram)

    def accept(self, first: int) -> None:
        """Use the keys of the newest datagram that was accepted, by its first byte."""
        if first & PHASE != self._incoming_phase and self._next is not None:
            self._previous, self._incoming, self._next = self._incoming, self._next, None
            self._incoming_phase = first & PHASE


@mypyc_attr(allow_interpreted_subclasses=True)
class Security:
    """A suite, with its secret if it has one. A key exchange has two messages; between them each end holds a state of
    the suite's own. `private` are `private_size` random bytes, for one message alone.

    Attributes:
        tag_size: bytes that `Protection.seal` adds.
        overhead: bytes that a handshake message adds to its payload.
        private_size: random bytes in an ephemeral private key.
    """

    tag_size: ClassVar[int]
    overhead: ClassVar[int]
    private_size: ClassVar[int]

    def call(self, prologue: bytes, private: bytes, payload: bytes) -> tuple[bytes, Any]:
        """The first message, and the state of the initiator.

        The prologue is sent in clear beside the messages; the exchange fails if the two ends see different ones."""
        raise NotImplementedError

    def hear(self, prologue: bytes, message: bytes) -> tuple[bytes, Any, Grant] | None:
        """The payload of the first message, whose sender holds or held the secret, the state of the responder, and what
        that secret is good for; None if it is not authentic."""
        raise NotImplementedError

    def holds(self, grant: Grant) -> bool:
        """Whether the secret of a call is still held, and good for the same."""
        raise NotImplementedError

    def answer(self, state: Any, private: bytes, payload: bytes) -> tuple[bytes, Protection] | None:
        """The second message and the keys of the session; only once. None if the first held no valid public key."""
        raise NotImplementedError

    def open(self, state: Any, message: bytes) -> tuple[bytes, Protection] | None:
        """Payload of the second message, and the keys of the session; None if it does not answer the first, after which
        another one may."""
        raise NotImplementedError


@mypyc_attr(allow_interpreted_subclasses=True)
class Checksum(Security):
    """The suite without a key, for loopback: finds damaged and misdirected datagrams, not forged ones.

    The tag is a CRC-32 that starts from the session, the direction and the full sequence number. So a datagram that is
    damaged, reflected, misnumbered or of another session is rejected, as under a real key. A handshake message is a
    nonce, the payload and a checksum; the state of an exchange is all that was said in it."""

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


def _ciphers(transcript: bytes) -> "list[ChecksumCipher]":
    """Of the direction from the initiator, and of the other direction."""
    session = sha256(transcript).digest()
    return [ChecksumCipher(int.from_bytes(session[at : at + 4], "little")) for at in (0, 4)]


class ChecksumCipher(Cipher):
    """The start value of the CRC of one direction."""

    def __init__(self, start: int) -> None:
        self._start = start

    def seal(self, sequence: int, clear: bytes) -> bytes:
        return clear + crc32(clear, (self._start + sequence) & 0xFFFF_FFFF).to_bytes(_TAG, "little")

    def open(self, sequence: int, datagram: bytes) -> bytes | None:
        clear, start = datagram[:-_TAG], (self._start + sequence) & 0xFFFF_FFFF
        is_authentic = crc32(clear, start).to_bytes(_TAG, "little") == datagram[-_TAG:]
        return clear[:1] + clear[CLEAR_BYTES:] if is_authentic else None

    def next(self) -> "ChecksumCipher":
        return ChecksumCipher(crc32(b"weberlink key update", self._start))
