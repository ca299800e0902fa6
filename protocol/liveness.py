"""Measure whether the two ends hear each other, on each end's own clock, against two limits.

Reception: something fresh of the peer has come within the silence limit S. This does not depend on the round trip.

Loop age: every datagram echoes the departure of the newest datagram that its sender has heard from the receiver, as a
time on the receiver's clock. So an end knows the time since the departure of its newest datagram that the peer is known
to have heard. It contains both delays, the wait at the peer and the time since, needs no common clock, and does not
depend on how the round trip divides. It bounds the age of whatever the peer has sent. It may be at most S + R, with the
round trip R that both ends have agreed on (`weberlink.protocol.round_trip`).

This is bidirectional forwarding detection (RFC 5880) with the ages of both directions added: hearing the peer is not
enough, the peer must hear this end too. All times that owners need are derived here, so that they compare with S alone.

The echo has 8 bits: the departure in units of 1/64 of S + R, rounded down, modulo 255; 255 if nothing was heard within
S. R may change in a session; a bit beside the echo, the generation, is the parity of the R that its sender uses. The
echo is unambiguous for almost four times S + R. It has to be for three: what counts is at most S + R old, is echoed for
at most S, and that echo is at most S + R old; R at most halves in a change.
"""

from math import floor, inf
from typing import Final

DEAF: Final = 255
"""The echo of an end that has heard nothing within the limit."""
UNITS: Final = 64
"""Units of the echo in S + R; the loop age is overestimated by at most one."""
_MODULUS: Final = 255
FADE_SHARE: Final = 0.8
"""Share of the silence limit at which owners begin to fade force out."""
HORIZON_SHARE: Final = 0.6
"""Share of the silence limit for which a motion is extrapolated after the peer's encoder was last known to run."""


class Liveness:
    """Both directions of one session. Times are in s; -inf (`generation_heard_at`: inf) stands for never.

    Attributes:
        heard_at: arrival of the newest fresh datagram.
        confirmed_at: departure of our newest datagram that the peer is known to have heard.
        encoder_heard_at: arrival of the newest fresh datagram that left while the peer's encoder ran, with no update
            known to be missing since its departure.
        encodes_until: until when the peer's encoder counts as running.
        in_touch_at: the end is in touch until then, and fades as time passes since then.
        round_trip, generation: R that this end uses now, and its parity.
        is_agreed: whether there is one; a responder learns it from the first datagrams of the initiator.
        is_opening: whether nothing that left in this session was confirmed yet, and the path is so long that the first
            confirmation cannot be there in time. Then the session is given time for one round trip, but must not drive.
        opened_at: when the session had a round trip.
        generation_heard_at: arrival of the first datagram that used the present round trip.
    """

    def __init__(self, epoch: float, silence: float, departure: float, now: float, confirmed_at: float = -inf) -> None:
        """Begin with a handshake datagram of the peer, which left at `departure` on its clock and arrived at `now`.
        `confirmed_at` is the departure of our datagram that it answers; -inf if it answers none."""
        self._epoch = epoch
        self._silence = silence
        self.round_trip = 0.0
        self._round_trips = [0.0, 0.0]
        self.generation = 0
        self.is_agreed = self.is_opening = False
        self.opened_at = -inf
        self.generation_heard_at = inf
        self._departure = departure
        self._newest = -1
        self.heard_at = now
        self.confirmed_at = confirmed_at
        self.encoder_heard_at = self.encodes_until = self.in_touch_at = -inf

    def agree(self, round_trip: float, now: float) -> None:
        """Begin with this round trip [s], as generation 0."""
        self._round_trips = [round_trip, round_trip]
        self.round_trip = round_trip
        self.is_agreed = True
        self.is_opening = 2.0 * round_trip > self._silence
        self.opened_at = now
        self.generation_heard_at = now

    def expect(self, round_trip: float) -> None:
        """Read echoes of the other generation with this round trip [s] from now on."""
        self._round_trips[1 - self.generation] = round_trip

    def switch(self) -> None:
        """Use the round trip of the other generation, which both ends have agreed on."""
        self.generation = 1 - self.generation
        self.round_trip = self._round_trips[self.generation]
        self.generation_heard_at = inf
        self._touch()

    @property
    def limit(self) -> float:
        """Largest loop age, S + R [s]; nothing is executed, and nothing is repeated, that is older."""
        return self._silence + self.round_trip

    @property
    def silent_at(self) -> float:
        """Time at which one of the limits is passed if nothing more is heard [s]."""
        if self.is_opening:
            return self.opened_at + self.limit
        return min(self.heard_at, self.confirmed_at + self.round_trip) + self._silence

    def is_fresh(self, age: float | None, generation: int) -> bool:
        """Whether a datagram of this age by the mapped clocks counts [s]; also while they are not mapped (None).

        The mapping errs by at most half the round trip, so the true age of a fresh datagram is at most S + R. R is the
        smaller one of both ends: otherwise an echo could wrap as R rises.
        """
        return age is None or age <= self._silence + 0.5 * min(self.round_trip, self._round_trips[generation])

    def drives(self, now: float) -> bool:
        """Whether the peer's updates may be executed, as far as the two limits and the peer's encoder are concerned."""
        return now <= self.encodes_until and not self.is_opening

    def echo(self, now: float) -> int:
        """The echo of a datagram that leaves now."""
        if now - self.heard_at > self._silence:
            return DEAF
        return floor(self._departure / (self.limit / UNITS)) % _MODULUS

    def confirmed_after(self, departure: float) -> float:
        """The least `confirmed_at` that shows that a datagram was heard which left after this one [s, our clock]."""
        unit = self.limit / UNITS
        return self._epoch + (floor(departure / unit) + 1) * unit

    def confirmation(self, echo: int, generation: int, now: float) -> float:
        """Departure of our newest datagram that the sender of this echo had heard [s]; -inf if it had heard none."""
        if echo == DEAF:
            return -inf
        unit = (self._silence + self._round_trips[generation]) / UNITS
        latest = floor((now - self._epoch) / unit) + 1  # a rounding may put an echo of just now ahead of now
        departed = self._epoch + (latest - (latest - echo) % _MODULUS) * unit
        return departed if departed < now else now

    def hear(self, departure: float, echo: int, generation: int, now: float) -> bool:
        """Take a fresh datagram; returns whether its loop age as it arrives is within the limit."""
        self.heard_at = now
        self._departure = departure if departure > self._departure else self._departure
        if generation == self.generation and self.generation_heard_at == inf:
            self.generation_heard_at = now
        confirmation = self.confirmation(echo, generation, now)
        if confirmation > self.confirmed_at:
            self.confirmed_at = confirmation
            if confirmation + self.limit / UNITS >= self.opened_at:
                self.is_opening = False
        self._touch()
        return now - confirmation <= self.limit

    def hear_encoder(self, sequence: int, now: float, *, runs: bool) -> None:
        """Take what a fresh datagram of this number says of the peer's encoder: it ran, and this end holds all its
        updates, or it did not run. An update says so only if it is executed: otherwise somebody who holds updates back
        could keep an old one in use."""
        if sequence > self._newest:
            self._newest = sequence
            if runs:
                self.encoder_heard_at = now
            self.encodes_until = self.encoder_heard_at + self._silence if runs else -inf
            self._touch()

    def _touch(self) -> None:
        self.in_touch_at = min(self.confirmed_at + self.round_trip, self.encoder_heard_at)
