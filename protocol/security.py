"""What a security suite gives to the handshake and to a session.

Two suites exist: `protocol.psk` (on by default between hosts) and `protocol.checksum` (for loopback). This file imports
neither, so that a side without a key never loads a crypto library.
"""

from typing import Protocol


class Protection(Protocol):
    """Both directions of one session."""

    def seal(self, sequence: int, clear: bytes) -> bytes:
        """The datagram to send; the first `CLEAR_BYTES` stay readable. Never twice for one sequence number."""

    def open(self, sequence: int, datagram: bytes) -> bytes | None:
        """What follows the first `CLEAR_BYTES`, if the whole is authentic under this number, else None."""

    def rekey_outgoing(self) -> None:
        """Replace the outgoing keys by the next ones, which follow from them in one direction only."""

    def rekey_incoming(self) -> None:
        """Replace the incoming keys by the next ones; `open_previous` knows those until now."""

    def open_next(self, sequence: int, datagram: bytes) -> bytes | None:
        """As `open`, under the incoming keys after the present ones; changes nothing, however often it is asked."""

    def open_previous(self, sequence: int, datagram: bytes) -> bytes | None:
        """As `open`, under the incoming keys before the present ones; None before the first change of keys."""


class Security(Protocol):
    """A suite, with its secret if it has one."""

    @property
    def tag_size(self) -> int:
        """Bytes that `Protection.seal` adds."""

    @property
    def proof_size(self) -> int:
        """Bytes of a proof."""

    @property
    def private_size(self) -> int:
        """Random bytes in an ephemeral private key; may be 0."""

    @property
    def public_size(self) -> int:
        """Bytes of an ephemeral public key; may be 0."""

    def public_key(self, private: bytes) -> bytes:
        """The half of an ephemeral key that travels."""

    def proof(self, message: bytes) -> bytes:
        """What shows that the sender of a handshake message holds the secret."""

    def protect(
        self, *, is_initiator: bool, private: bytes, peer_public: bytes, transcript: bytes
    ) -> Protection | None:
        """Keys of the session that two ends with this transcript share; None for a public key that is no key."""
