"""Validate the peer's address: use a new one only after the peer has shown that it receives datagrams there.

An attacker who copies the peer's datagrams and delivers them first from its own address must not receive what is sent
to the peer. So a datagram from elsewhere only makes its address a candidate. The candidate is sent random bytes and
must return them (RFC 9000, section 8.2), and the address stays as it is while authentic datagrams, copies included,
come from it. A relay that forwards everything both ways cannot be told from the network.
"""

from collections.abc import Callable
from math import inf
from typing import Final

from weberlink.protocol.events import Address
from weberlink.protocol.wire import TOKEN_BYTES

PACE: Final = 0.02  # least time between two challenges [s]
OVERTAKEN: Final = 3
"""Fresh datagrams in a row from the candidate before the present address is quiet: an original follows its copy."""


class AddressCheck:
    """The address of one session's peer, and a candidate for it. Another address is used when nothing has come from the
    present one for `quiet` [s]."""

    def __init__(self, address: Address, entropy: Callable[[int], bytes], quiet: float) -> None:
        self.address = address
        self._entropy = entropy
        self._quiet = quiet
        self._heard_at = -inf
        self._in_a_row = 0
        self._candidate: Address | None = None
        self._answered = False
        self._token = b""
        self._asked_at = -inf

    def on_datagram(self, source: Address, now: float, *, is_fresh: bool) -> None:
        """Record an authentic datagram; it is fresh if neither a copy nor a later one came before it."""
        if source == self.address:
            self._heard_at, self._in_a_row = now, 0
        elif is_fresh:
            if source != self._candidate:
                self._candidate, self._answered, self._in_a_row, self._token = source, False, 0, b""
            self._in_a_row += 1
            self._move(now)

    def challenge(self, now: float) -> tuple[bytes, Address] | None:
        """Token to send now, and the address to send it to; None if no question is due."""
        if self._candidate is None or self._answered or now < self._asked_at + PACE:
            return None
        self._asked_at = now
        self._token = self._token or self._entropy(TOKEN_BYTES)
        return self._token, self._candidate

    def on_answer(self, token: bytes, now: float) -> None:
        """Take the answer to a challenge, from any address: only the receiver at the candidate knows the token."""
        if self._token and token == self._token:
            self._answered = True
            self._move(now)

    def _move(self, now: float) -> None:
        """Use the candidate once it has answered and the present address has gone quiet."""
        is_quiet = self._in_a_row >= OVERTAKEN and now - self._heard_at >= self._quiet
        if self._candidate is not None and self._answered and is_quiet:
            self.address, self._heard_at = self._candidate, now
            self._candidate, self._answered, self._token = None, False, b""
