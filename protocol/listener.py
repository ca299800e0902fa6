"""The responder's half of the handshake: answers proven HELLOs. Its mirror is `protocol.dialer`.

An answer opens a session only on paper. It becomes the session of the endpoint when the first datagram under its keys
arrives, which only the sender of the HELLO can make: a recorded HELLO that somebody plays back costs a key exchange and
nothing else.
"""

from collections import OrderedDict
from collections.abc import Callable, Iterable, Mapping
from math import inf
from typing import NamedTuple

from protocol.handshake import (
    NONCE_BYTES,
    Hello,
    differences,
    open_frame,
    pack_frame,
    pack_refusal,
    read_hello,
    read_map,
    transcript,
    version_mismatch,
)
from protocol.reasons import DropReason
from protocol.roles import Role
from protocol.security import Protection, Security
from protocol.session import Session
from protocol.wire import Kind

PENDING_LIMIT = 4
"""Sessions on paper; more than one, so that played-back HELLOs do not push a real one out at once."""
REMEMBERED_NONCES = 4096
EXCHANGE_PACE = 0.005
"""Least time between two key exchanges, each of which takes some 0.2 ms [s]."""
EXCHANGE_PACE_ENGAGED = 0.1
"""The same while there is a session whose peer is heard: who else calls can wait [s]."""
_SPENT = 1 << 64


class Reply(NamedTuple):
    """A WELCOME to send to where the HELLO came from; `refusal` is its text if it refuses."""

    welcome: bytes
    refusal: str | None


class _Pending(NamedTuple):
    session: Session
    nonce: bytes
    key: bytes


class Listener:
    """Answers HELLOs and keeps the sessions that they may become."""

    __slots__ = (
        "_agreement",
        "_entropy",
        "_epoch",
        "_exchanged_at",
        "_known",
        "_open_session",
        "_pending",
        "_security",
        "_version",
    )

    def __init__(
        self,
        security: Security,
        entropy: Callable[[int], bytes],
        agreement: Mapping[str, object],
        version: int,
        epoch: float,
        open_session: Callable[[Protection, float, float], Session],
    ) -> None:
        """Prepare to be called.

        Args:
            entropy: random bytes of a number, for keys and nonces.
            agreement: as msgpack gives it back.
            epoch: when our clock was at 0 [s].
            open_session: makes a session of its keys, the peer's clock [s] and now [s].
        """
        self._security = security
        self._entropy = entropy
        self._agreement = agreement
        self._version = version
        self._epoch = epoch
        self._open_session = open_session
        self._pending: OrderedDict[bytes, _Pending] = OrderedDict()
        self._known: OrderedDict[bytes, int] = OrderedDict()
        self._exchanged_at = -inf

    @property
    def pending(self) -> Iterable[Session]:
        """Sessions that no datagram has confirmed yet, oldest first."""
        return tuple(pending.session for pending in self._pending.values())

    def settle(self) -> None:
        """One of them was confirmed: the others are void, and the calls that they came from are over."""
        for nonce in self._pending:
            self._known[nonce] = _SPENT
        self._pending.clear()

    def receive(self, data: bytes, now: float, *, is_engaged: bool = False) -> Reply | DropReason:
        """Take a HELLO: the answer to send, never longer than the HELLO, or why there is none.

        Args:
            data: the datagram.
            now: [s].
            is_engaged: whether there is a session whose peer is heard.
        """
        frame = open_frame(data, self._security)
        if frame is None:
            return DropReason.UNPROVEN
        version, packed = frame
        body = read_map(packed)
        if body is None:
            return DropReason.MALFORMED
        if version != self._version:
            nonce = body.get("nonce")
            if not isinstance(nonce, bytes) or len(nonce) != NONCE_BYTES:
                return DropReason.MALFORMED
            return self._refuse(version_mismatch(version, self._version), nonce, len(data))
        hello = read_hello(body, self._security)
        agreement = None if hello is None else read_map(hello.agreement)
        if hello is None or agreement is None:
            return DropReason.MALFORMED
        return self._answer(hello, agreement, len(data), now, EXCHANGE_PACE_ENGAGED if is_engaged else EXCHANGE_PACE)

    def _answer(
        self, hello: Hello, agreement: dict[str, object], limit: int, now: float, pace: float
    ) -> Reply | DropReason:
        is_new = hello.nonce not in self._known
        if is_new and now < self._exchanged_at + pace:
            return DropReason.OVERLOADED
        if not self._is_fresh(hello):
            return DropReason.REPLAYED
        if message := differences(Role.RESPONDER, self._agreement, agreement):
            return self._refuse(message, hello.nonce, limit)
        clock = now - self._epoch
        departure = hello.clock_us * 1e-6
        pending = self._pending.get(hello.nonce)
        if pending is None:
            self._exchanged_at = now
            pending = self._agree(hello, departure, now)
        else:
            pending.session.retime(departure, now)
        if pending is None:
            return DropReason.MALFORMED
        body = {
            "nonce": pending.nonce,
            "key": pending.key,
            "clock_us": round(clock * 1e6),
            "delta_us": round((clock - departure) * 1e6),
        }
        return Reply(pack_frame(Kind.WELCOME, self._version, body, self._security, hello.nonce), None)

    def _is_fresh(self, hello: Hello) -> bool:
        """A call repeats its HELLO with a later clock each time, until its session is confirmed."""
        known = self._known.get(hello.nonce)
        if known is not None and hello.clock_us <= known:
            return False
        self._known[hello.nonce] = hello.clock_us
        if len(self._known) > REMEMBERED_NONCES:
            self._known.popitem(last=False)
        return True

    def _agree(self, hello: Hello, departure: float, now: float) -> _Pending | None:
        private, nonce = self._entropy(self._security.private_size), self._entropy(NONCE_BYTES)
        key = self._security.public_key(private)
        protection = self._security.protect(
            is_initiator=False,
            private=private,
            peer_public=hello.key,
            transcript=transcript(self._version, hello, nonce, key),
        )
        if protection is None:
            return None
        pending = _Pending(self._open_session(protection, departure, now), nonce, key)
        self._pending[hello.nonce] = pending
        if len(self._pending) > PENDING_LIMIT:
            self._pending.popitem(last=False)
        return pending

    def _refuse(self, message: str, nonce: bytes, limit: int) -> Reply:
        return Reply(pack_refusal(message, nonce, self._version, self._security, limit), message)
