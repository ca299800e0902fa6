"""The initiator's half of the handshake: says HELLO until it is answered. Its mirror is `protocol.listener`."""

from collections.abc import Callable
from math import inf
from typing import NamedTuple

from protocol.handshake import (
    NONCE_BYTES,
    Hello,
    open_frame,
    pack_hello,
    read_map,
    read_welcome,
    transcript,
    version_mismatch,
)
from protocol.reasons import DropReason
from protocol.security import Protection, Security

FIRST_INTERVAL = 0.02
LONGEST_INTERVAL = 0.5


class Answer(NamedTuple):
    """What a WELCOME that agrees brings: the keys, and one measurement of the link in each direction [s]."""

    protection: Protection
    peer_clock: float
    outward_delay: float


class Dialer:
    """One call after another; each has its own nonce and ephemeral key."""

    __slots__ = ("_agreement", "_entropy", "_epoch", "_hello", "_interval", "_private", "_security", "_version", "due")

    def __init__(
        self, security: Security, entropy: Callable[[int], bytes], agreement: bytes, version: int, epoch: float
    ) -> None:
        """Prepare to call.

        Args:
            entropy: random bytes of a number, for keys and nonces.
            agreement: from `pack_agreement`.
            epoch: when our clock was at 0 [s].
        """
        self._security = security
        self._entropy = entropy
        self._agreement = agreement
        self._version = version
        self._epoch = epoch
        self._hello: Hello | None = None
        self._private = b""
        self._interval = FIRST_INTERVAL
        self.due = inf
        """When the next HELLO is to be sent [s]; infinity when not calling."""

    def start(self, now: float) -> None:
        """Begin a new call; the first HELLO is due at once."""
        self._private = self._entropy(self._security.private_size)
        public = self._security.public_key(self._private)
        self._hello = Hello(self._agreement, self._entropy(NONCE_BYTES), public, 0)
        self._interval = FIRST_INTERVAL
        self.due = now

    def stop(self) -> None:
        """Hang up; an answer that still comes is not expected any more."""
        self._hello = None
        self._private = b""
        self.due = inf

    def hello(self, now: float) -> bytes:
        """The next HELLO of this call, and schedule the one after it."""
        assert self._hello is not None
        self.due = now + self._interval
        self._interval = min(2.0 * self._interval, LONGEST_INTERVAL)
        hello = self._hello._replace(clock_us=round((now - self._epoch) * 1e6))
        return pack_hello(hello, self._version, self._security)

    def receive(self, data: bytes) -> Answer | str | DropReason:
        """Take a WELCOME: the session that it opens, the text of a refusal, or why it is of no use."""
        if self._hello is None:
            return DropReason.UNEXPECTED
        frame = open_frame(data, self._security, self._hello.nonce)
        if frame is None:
            return DropReason.UNPROVEN
        version, packed = frame
        body = read_map(packed)
        if body is not None and isinstance(body.get("refusal"), str):
            return str(body["refusal"])
        if version != self._version:
            return version_mismatch(self._version, version)
        answer = None if body is None else self._agree(body)
        return DropReason.MALFORMED if answer is None else answer

    def _agree(self, body: dict[str, object]) -> Answer | None:
        welcome = read_welcome(body, self._security)
        if welcome is None:
            return None
        assert self._hello is not None
        protection = self._security.protect(
            is_initiator=True,
            private=self._private,
            peer_public=welcome.key,
            transcript=transcript(self._version, self._hello, welcome.nonce, welcome.key),
        )
        return None if protection is None else Answer(protection, welcome.clock_us * 1e-6, welcome.delta_us * 1e-6)
