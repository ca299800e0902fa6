"""Measure whether the two ends hear each other: the loop age, on each end's own clock.

Every datagram echoes the departure of the newest datagram that its sender has heard from the receiver, as a time on the
receiver's clock. So an end knows the loop age: the time since the departure of its newest datagram that the peer is
known to have heard. It contains both delays, the wait at the peer and the time since, needs no common clock, and does
not depend on how the round trip divides. It bounds the age of whatever the peer has sent.

An end is engaged only while the loop age is within the silence limit. This is bidirectional forwarding detection (RFC
5880) with the ages of both directions added: hearing the peer is not enough, the peer must hear this end too.

The echo has 8 bits: the departure in units of 1/64 of the limit, rounded down, modulo 255; 255 if nothing was heard
within the limit. It is unambiguous for almost four limits: a datagram that counts is at most one limit old by the
mapped clocks, which err by less than half a round trip, and is echoed for at most one limit.
"""

from math import floor, inf
from typing import Final

DEAF: Final = 255
"""The echo of an end that has heard nothing within the limit."""
UNITS: Final = 64
"""Units of the echo in the silence limit; the loop age is overestimated by at most one."""
_MODULUS: Final = 255
FADE_SHARE: Final = 0.8
"""Share of the silence limit at which owners begin to fade force out, as loop age."""
HORIZON_SHARE: Final = 0.6
"""Share of the silence limit for which a motion is extrapolated after the peer's encoder was last known to run."""


class Liveness:
    """Both directions of one session.

    Attributes:
        heard_at: arrival of the newest fresh datagram [s].
        confirmed_at: departure of our newest datagram that the peer is known to have heard [s]; -inf before the first.
        encoder_heard_at: arrival of the newest fresh datagram that left while the peer's encoder ran, with no update
            known to be missing since its departure [s]; -inf before the first.
        encodes_until: until when the peer's updates may be executed [s]; -inf if they may not.
        in_touch_at: the earlier of `confirmed_at` and `encoder_heard_at` [s]; out of touch since then.
    """

    def __init__(self, epoch: float, silence: float, departure: float, now: float, confirmed_at: float = -inf) -> None:
        """Begin with a handshake datagram of the peer.

        Args:
            epoch: when our clock was at 0 [s].
            silence: the limit, which both ends have agreed on [s].
            departure: of that datagram on the peer's clock [s].
            now: its arrival [s].
            confirmed_at: departure of our datagram that it answers [s]; -inf if it answers none.
        """
        self._epoch = epoch
        self._silence = silence
        self._unit = silence / UNITS
        self._departure = departure
        self._newest = -1
        self.heard_at = now
        self.confirmed_at = confirmed_at
        self.encoder_heard_at = self.encodes_until = self.in_touch_at = -inf

    def echo(self, now: float) -> int:
        """The echo of a datagram that leaves now."""
        if now - self.heard_at > self._silence:
            return DEAF
        return floor(self._departure / self._unit) % _MODULUS

    def confirmed_after(self, departure: float) -> float:
        """The least `confirmed_at` that shows that a datagram was heard which left after this one [s, our clock]."""
        return self._epoch + (floor(departure / self._unit) + 1) * self._unit

    def confirmation(self, echo: int, now: float) -> float:
        """Departure of our newest datagram that the sender of this echo had heard [s]; -inf if it had heard none."""
        if echo == DEAF:
            return -inf
        latest = floor((now - self._epoch) / self._unit) + 1  # a rounding may put an echo of just now ahead of now
        departed = self._epoch + (latest - (latest - echo) % _MODULUS) * self._unit
        return departed if departed < now else now

    def hear(self, sequence: int, departure: float, echo: int, *, says_encoding: bool | None, now: float) -> bool:
        """Take a fresh datagram; returns whether its loop age as it arrives is within the limit.

        Args:
            sequence: its number.
            departure: on the peer's clock [s].
            echo: what it says.
            says_encoding: whether the sender's encoder ran and this end holds all its updates; None if unknown.
            now: [s].
        """
        self.heard_at = now
        self._departure = departure if departure > self._departure else self._departure
        confirmation = self.confirmation(echo, now)
        self.confirmed_at = confirmation if confirmation > self.confirmed_at else self.confirmed_at
        if says_encoding is not None and sequence > self._newest:
            self._newest = sequence
            if says_encoding:
                self.encoder_heard_at = now
            self.encodes_until = self.encoder_heard_at + self._silence if says_encoding else -inf
        self.in_touch_at = min(self.confirmed_at, self.encoder_heard_at)
        return now - confirmation <= self._silence
