"""What a security suite provides: the key exchange of the handshake, and the protection of a session.

There are two suites: `weberlink.protocol.psk` (default between hosts) and `weberlink.protocol.checksum` (for loopback).
This file imports neither, so that a side without a key never loads a crypto library.
"""

from math import inf
from typing import Any, Final, Protocol

from weberlink.protocol.keys import Grant
from weberlink.protocol.wire import PHASE

REKEY_AFTER_S: Final = 120.0
REKEY_AFTER: Final = 1 << 20
"""For how long, and for how many datagrams, one key seals what an end sends; far below the limit of AES-CCM (RFC 9147,
section 4.5.3)."""


class Cipher(Protocol):
    """The keys of one direction."""

    def seal(self, sequence: int, clear: bytes) -> bytes:
        """The datagram to send, of which phase and number are readable. Never twice for one sequence number."""

    def open(self, sequence: int, datagram: bytes) -> bytes | None:
        """The first byte that was sealed, and what follows the first `CLEAR_BYTES`; None if the datagram is not
        authentic under this number."""

    def next(self) -> "Cipher":
        """The keys that replace these, derived from them one-way."""


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


class Security(Protocol):
    """A suite, with its secret if it has one. A key exchange has two messages; between them each end holds a state of
    the suite's own. `private` are `private_size` random bytes, for one message alone."""

    @property
    def tag_size(self) -> int:
        """Bytes that `Protection.seal` adds."""

    @property
    def overhead(self) -> int:
        """Bytes that a handshake message adds to its payload."""

    @property
    def private_size(self) -> int:
        """Random bytes in an ephemeral private key."""

    def call(self, prologue: bytes, private: bytes, payload: bytes) -> tuple[bytes, Any]:
        """The first message, and the state of the initiator.

        The prologue is sent in clear beside the messages; the exchange fails if the two ends see different ones."""

    def hear(self, prologue: bytes, message: bytes) -> tuple[bytes, Any, Grant] | None:
        """The payload of the first message, whose sender holds or held the secret, the state of the responder, and what
        that secret is good for; None if it is not authentic."""

    def holds(self, grant: Grant) -> bool:
        """Whether the secret of a call is still held, and good for the same."""

    def answer(self, state: Any, private: bytes, payload: bytes) -> tuple[bytes, Protection] | None:
        """The second message and the keys of the session; only once. None if the first held no valid public key."""

    def open(self, state: Any, message: bytes) -> tuple[bytes, Protection] | None:
        """Payload of the second message, and the keys of the session; None if it does not answer the first."""
