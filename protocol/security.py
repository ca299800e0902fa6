"""What a security suite provides: the key exchange of the handshake, and the protection of a session.

There are two suites: `weberlink.protocol.psk` (default between hosts) and `weberlink.protocol.checksum` (for loopback).
This file imports neither, so that a side without a key never loads a crypto library.
"""

from typing import Any, Protocol


class Cipher(Protocol):
    """The keys of one direction."""

    def seal(self, sequence: int, clear: bytes) -> bytes:
        """The datagram to send; the first `CLEAR_BYTES` stay readable. Never twice for one sequence number."""

    def open(self, sequence: int, datagram: bytes) -> bytes | None:
        """What follows the first `CLEAR_BYTES`; None if the datagram is not authentic under this number."""

    def next(self) -> "Cipher":
        """The keys that replace these, derived from them one-way."""


class Protection:
    """The keys of both directions of one session, replaced as in RFC 9001 section 6; sequence numbers go on.

    Attributes:
        seal: as of the outgoing `Cipher`.
        open: as of the incoming `Cipher`.
    """

    def __init__(self, outgoing: Cipher, incoming: Cipher) -> None:
        self._outgoing, self._incoming = outgoing, incoming
        self._next: Cipher | None = None
        self._previous: Cipher | None = None
        self.seal, self.open = outgoing.seal, incoming.open

    def rekey_outgoing(self) -> None:
        self._outgoing = self._outgoing.next()
        self.seal = self._outgoing.seal

    def rekey_incoming(self) -> None:
        """Replace the incoming keys by the next ones; `open_previous` keeps those used until now."""
        self._previous, self._incoming, self._next = self._incoming, self._following(), None
        self.open = self._incoming.open

    def open_next(self, sequence: int, datagram: bytes) -> bytes | None:
        """As `open`, under the next incoming keys; changes nothing."""
        return self._following().open(sequence, datagram)

    def open_previous(self, sequence: int, datagram: bytes) -> bytes | None:
        """As `open`, under the previous incoming keys; None before the first change of keys."""
        return None if self._previous is None else self._previous.open(sequence, datagram)

    def _following(self) -> Cipher:
        if self._next is None:
            self._next = self._incoming.next()
        return self._next


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

        The prologue is sent in clear beside the messages; the exchange fails if the two ends see different ones.
        """

    def hear(self, prologue: bytes, message: bytes) -> tuple[bytes, Any] | None:
        """The payload of the first message, whose sender holds or held the secret, and the state of the responder; None
        if it is not authentic."""

    def answer(self, state: Any, private: bytes, payload: bytes) -> tuple[bytes, Protection] | None:
        """The second message and the keys of the session; only once. None if the first held no valid public key."""

    def open(self, state: Any, message: bytes) -> tuple[bytes, Protection] | None:
        """Payload of the second message, and the keys of the session; None if it does not answer the first."""
