"""The newest update of each stream: whether the peer holds it, and when to send it again.

Only the newest update is ever repeated: it carries the whole state, so an older one has no use.
"""

from collections import deque
from math import ceil, inf, log
from typing import Final

from weberlink.protocol.liveness import Liveness
from weberlink.protocol.wire import ACKNOWLEDGEMENT_MASK, UpdateLayout
from weberlink.update import Update

SHORTEST_PACE: Final = 0.005
LONGEST_PACE: Final = 0.1
_EVEN_REPEATS: Final = 3
_MOST_UNHELD: Final = 1024
URGENT_SHARE: Final = 0.65
URGENT_PACE: Final = 0.04
"""From when on an update is sent again without evidence, because its time to be acknowledged runs out, and the least
time between two of these, as shares of the silence limit, beside the agreed round trip."""
UNHELD_SHARE: Final = 1.0 / 16.0
"""How exactly the age of what the peer lacks is known, as a share of the silence limit; it is never underestimated."""

MOST_COPIES: Final = 6
RESIDUAL: Final = 0.02  # share of updates that may stay lost although they were sent again early

LEAST_EARLY_PER_S: Final = 6.0
MOST_EARLY_PER_S: Final = 150.0
"""Updates sent again without evidence of a loss, on average, over all streams of an end: on a link that may be
congested, and on one that is known not to be."""
RAISE: Final = 5.0  # factor by which the allowance of early repeats grows in a step
STEP_S: Final = 1.0
STEP_SENT: Final = 50
"""Least time [s] and number of datagrams in which the loss is counted for a step."""
GROWTH: Final = 1.5
GROWTH_SLACK: Final = 0.08
JITTER_SLACK: Final = 0.02
"""The loss, or the delay in queues [s], has grown with the repeats where it exceeds `GROWTH` times that without them
plus this slack."""
SHORTEST_HOLD: Final = 2.0
LONGEST_HOLD: Final = 64.0
"""How long the allowance stays low after the loss has grown [s]; doubled each time."""


def lost_again(loss: float, burst: float) -> float:
    """Chance that the datagram after a lost one is lost too, 0..1, of the loss, 0..1, and the mean length of a run of
    losses, at least 1, or 0 if unknown.

    A run of losses ends with each datagram with the chance 1 / burst (Gilbert 1960). Shorter runs than independent
    losses make do not count."""
    return max(loss, 1.0 - 1.0 / burst) if burst > 1.0 else loss


def copies_needed(loss: float, burst: float = 0.0) -> int:
    """How often to send an update again before there is evidence of a loss, so that at most `RESIDUAL` are lost: 0 to
    `MOST_COPIES`."""
    if loss <= RESIDUAL:
        return 0
    again = lost_again(loss, burst)
    return MOST_COPIES if again >= 1.0 else min(MOST_COPIES, ceil(log(RESIDUAL / loss) / log(again) - 1e-9))


class Allowance:
    """How many early repeats an end may send: a bucket of tokens that is filled at a rate [1/s].

    The rate begins at its least and grows step by step on a lossy link, as long as neither the loss nor the delay in
    queues grows with it. If one does, the repeats themselves may be what fills the link: the rate falls to its least at
    once, both are measured anew, and the rate is raised again later, each time after twice as long.

    So in T seconds there are at most `MOST_EARLY_PER_S` (1 + T) early repeats."""

    def __init__(self) -> None:
        self.rate = LEAST_EARLY_PER_S
        self._tokens = LEAST_EARLY_PER_S
        self._filled_at = -inf
        self._alone: float | None = None  # loss while the rate is at its least
        self._jitter_alone = 0.0
        self._together: float | None = None  # loss since it is higher
        self._lost = self._sent = 0
        self._begun_at = -inf
        self._hold = SHORTEST_HOLD
        self._held_until = -inf

    def left(self, now: float) -> int:
        """Early repeats that may be sent now; 0 also where the streams together have spent more than there was."""
        passed = now - self._filled_at
        tokens = self._tokens + self.rate * (passed if passed < 1.0 else 1.0)
        self._tokens = tokens if tokens < self.rate else self.rate
        self._filled_at = now
        return max(0, int(self._tokens))

    def pay(self, now: float) -> None:
        self.left(now)
        self._tokens -= 1.0

    def adapt(self, lost: int, sent: int, jitter: float, now: float) -> None:
        """Count datagrams that the peer has found missing since the last call (negative for late ones that came) of all
        that were sent so far, and watch by how much few datagrams exceed their least delay [s]."""
        if self._begun_at == -inf:
            self._begun_at, self._sent = now, sent
            return
        self._lost += lost
        count = sent - self._sent
        if now < self._begun_at + STEP_S or count < STEP_SENT:
            return
        loss = min(1.0, max(0, self._lost) / count)
        self._lost, self._sent, self._begun_at = 0, sent, now
        if self.rate == LEAST_EARLY_PER_S:
            self._alone = loss if self._alone is None else 0.5 * (self._alone + loss)
            self._jitter_alone = jitter
            if now >= self._held_until and self._alone > RESIDUAL:
                self.rate, self._together = RAISE * LEAST_EARLY_PER_S, None
            return
        self._together = loss if self._together is None else 0.5 * (self._together + loss)
        has_more_loss = self._together > GROWTH * (self._alone or 0.0) + GROWTH_SLACK
        if has_more_loss or jitter > GROWTH * self._jitter_alone + JITTER_SLACK:
            self.rate, self._alone = LEAST_EARLY_PER_S, None
            self._held_until = now + self._hold
            self._hold = min(LONGEST_HOLD, 2.0 * self._hold)
        elif self._together > RESIDUAL:
            self.rate = min(MOST_EARLY_PER_S, RAISE * self.rate)


class OutgoingStream:
    """One stream of our updates: the newest one, and when to send it again.

    An update is overdue on evidence (a datagram that left the peer after the update must have arrived does not
    acknowledge it) or, where nothing comes from the peer, after a fallback time. Pace, the least time between two
    transmissions of the same update: 5 ms or the round trip if that is longer, doubled with each repeat after the
    third, at most 100 ms (or the round trip).

    On a lossy link an update is also sent again before there can be evidence, as often as loss and bursts call for
    (`copies_needed`), 5 ms apart so that one short burst does not take all, until it is acknowledged or a newer one
    replaces it; and in the place of a heartbeat that is due. These early repeats are paid from an `Allowance`, which
    the streams of an end share.

    Where the time runs out in which it must be acknowledged, an update is sent again without evidence.

    So in T seconds one update is repeated at most 23 + T / 0.1 times (13 + T / 0.1 without the urgent ones).
    `is_pending` if it is not known to have arrived, `is_forgotten` if the peer has said that it no longer holds it,
    `is_missed` if the peer was heard after the update must have arrived, and does not have it. `unheld_since` is the
    departure of the oldest update that the peer is not known to hold, or to have replaced by a newer one; inf if it
    holds the newest. `is_held` if it is known to hold any since `forget`."""

    def __init__(self, layout: UpdateLayout, allowance: Allowance, liveness: Liveness) -> None:
        self.layout = layout
        self.update: Update | None = None
        self.sent_at = -inf
        self.is_pending = self.is_forgotten = False
        self._allowance, self._liveness = allowance, liveness
        self._begun_at, self._begun = -inf, 0
        self._count = 0
        self.is_missed = False
        self._early = 0
        self.last_ack = 0
        self._acknowledged_by = -1
        self.is_held = False
        self.unheld_since = inf
        # Of a few updates in a row: departure of the first, number of the last.
        self._unheld: deque[tuple[float, int]] = deque(maxlen=_MOST_UNHELD)
        self._urgent_at = inf
        self._newest = 0

    def begin(self, sequence: int, now: float, copies: int = 0) -> None:
        """A new `update` was sent in the datagram of this number; `copies` early repeats follow, if allowed."""
        self._count, self._newest, self._begun = 0, sequence, sequence
        self._begun_at = self.sent_at = now
        if self._unheld and now - self._unheld[-1][0] < UNHELD_SHARE * self._liveness.silence:
            self._unheld[-1] = self._unheld[-1][0], sequence
        else:
            self._unheld.append((now, sequence))
        self.unheld_since = self._unheld[0][0]
        self.is_pending, self.is_forgotten, self.is_missed = True, False, False
        self._early = min(copies, self._allowance.left(now)) if copies else 0

    def can_be_carried(self, now: float) -> bool:
        """Whether a datagram that leaves now in any case is to be this update again, as an early repeat."""
        return self.is_pending and now >= self.sent_at + SHORTEST_PACE and self._allowance.left(now) > 0

    def repeated(self, sequence: int, now: float, *, is_carried: bool = False) -> bool:
        """The update was sent again in the datagram of that number, `is_carried` if one had to leave in any case;
        returns whether an answer is urgent."""
        self._newest = sequence
        is_urgent = now >= self._urgent_at
        if self._early or is_carried:
            self._early -= self._early > 0
            self._allowance.pay(now)
        else:
            self._count += 1
        self.sent_at = now
        self.is_missed = False
        return is_urgent

    def acknowledge(self, sequence: int, ack: int | None, *, is_newest: bool) -> bool:
        """Take the acknowledgement in the datagram of this number, None if it has none, so that the newest one still
        holds; returns whether the newest update is known to have arrived.

        A peer that acknowledges nothing after it had acknowledged the newest update has forgotten it."""
        if ack is None:
            if not is_newest:
                return True
            ack = self.last_ack
        elif sequence > self._acknowledged_by:
            if ack not in (0, self.last_ack):
                held, unheld = self._newest - (self._newest - ack & ACKNOWLEDGEMENT_MASK), self._unheld
                is_newest_held = held >= self._begun
                while unheld and (is_newest_held or unheld[0][1] <= held):
                    unheld.popleft()
                    self.is_held = True
                self.unheld_since = unheld[0][0] if unheld else inf
                self.is_pending = self.is_pending and not is_newest_held
            self.last_ack, self._acknowledged_by = ack, sequence
        if self.is_pending:
            return False
        self.is_forgotten |= is_newest and ack == 0 and self.update is not None
        return True

    def forget(self) -> None:
        """The peer holds nothing any more; what is still to arrive will be sent again."""
        self._unheld.clear()
        if self.is_pending:
            self._unheld.append((self._begun_at, self._begun))
        self.unheld_since, self.is_held = self._begun_at if self.is_pending else inf, False

    def is_lost(self, now: float) -> bool:
        """Whether the peer needs a new state, because it has forgotten the update, or the update has not arrived and is
        older than what the peer executes; then it is repeated no more."""
        if not self.is_forgotten and not (self.is_pending and now - self._begun_at > self._liveness.limit):
            return False
        self.is_pending = self.is_forgotten = False
        return True

    def due_at(self, rtt: float, fallback: float) -> float:
        """Time of the next repeat, infinity if there is no need; `fallback` is how long to wait for evidence [s]."""
        if not self.is_pending:
            return inf
        pace = max(SHORTEST_PACE, rtt)
        if self._early:
            pace = SHORTEST_PACE
        else:
            if self._count >= _EVEN_REPEATS:
                pace = min(pace * 2.0 ** min(self._count + 1 - _EVEN_REPEATS, 10), max(LONGEST_PACE, rtt))
            pace = pace if self.is_missed else max(pace, fallback)
        silence, held_from = self._liveness.silence, self.unheld_since + self._liveness.round_trip
        self._urgent_at = held_from + URGENT_SHARE * silence
        urgent_at = max(self._urgent_at, self.sent_at + URGENT_PACE * silence)
        return urgent_at if urgent_at < self.sent_at + pace and urgent_at < held_from + silence else self.sent_at + pace
