"""The gate of the operator's end: every force and torque on the hand leaves through it, and nothing after it adds any.

It bounds the magnitude and the rate of change of what really leaves, fades with the session and the link, and lets no
force last that the robot's end states no contact for.
"""

from collections.abc import Sequence
from math import copysign, dist, hypot, inf, isfinite
from typing import Any

from weberlink.codec.coder import Decoder
from weberlink.codec.sample import Sample
from weberlink.control.contract import UNREACHED_S, SentCommands
from weberlink.geometry.joints import Joints
from weberlink.geometry.vector import toward
from weberlink.protocol.endpoint import Endpoint
from weberlink.protocol.retransmission import copies_needed

# Time beyond the round trip for which the robot's end may leave a force without a contact [s]: for a robot that lags
# behind its command, and an update that comes late. 5 ms below what the law allows: a contact that a model claims
# counts as younger than it may be by so much (`HandContact`).
PATIENCE = 0.045
# Last part of it, in which the bound falls to what needs no contact [s]; jitter may delay the news of one until then.
FALL = 0.015
FADE = 0.1  # time in which what is left falls to zero [s]
# Time after which what still asks for a force is at fault [s]: a scheme fades out what it was told to let go of.
GRACE = 0.05
# A force lasts for so long until the received model is asked for a contact, and a correction of the model is waited for
# so much longer than the round trip and its jitter [s].
LOOK_S = 0.005
# A contact lasts for so long until the robot's end is asked whether it has corrected the model: the answer comes before
# the bound falls [s].
ASK_S = 0.015
MOST_COPIES = 2  # how often it is asked again on a lossy link, `LOOK_S` apart: later answers would come too late
ROUNDING = 1.0 + 1e-9


class ContactLimiter:
    """No force without a contact: bounds what is displayed while the robot's end states none.

    A hand may be ahead of the robot in a contact that a model predicts, for as long as the answer takes: the round trip
    and `PATIENCE`. By then the bound has fallen to `free`, the largest force that needs no contact, and it falls on to
    0, whatever scheme or predictor ask for. A scheme is told as the bound begins to fall (`doubtful`); one that asks
    for more than `free` `GRACE` beyond the law is at fault (`unfounded`). `lasted` is the time for which more than
    `free` was asked for since a contact was stated [s]: time with less counts back, so that taps ahead of the robot do
    not add up. `quiet`: nothing is bounded, and nothing that needs a contact was asked for lately.

    While no round trip is known, `longest` [s] is assumed; it is never exceeded. Forces are [N], or torques [N m].
    """

    def __init__(self, most: float, free: float, longest: float) -> None:
        self._most = most
        self._free = free
        self.free = free * ROUNDING
        self._longest = longest
        self.reset()

    def reset(self) -> None:
        self.lasted = 0.0
        self._bound = inf
        self.quiet = True
        self.doubtful = self.unfounded = False

    def bound(
        self, asked: float, elapsed: float, round_trip: float | None, *, stated: float, claimed: float = 0.0
    ) -> float:
        """The largest force that may be displayed now [N]; inf for no bound.

        Args:
            asked: size of the force before fade and slew limit [N].
            elapsed: time since the last call [s].
            round_trip: of signals over the link [s]; None while unknown.
            stated: how long ago the robot's end stated a contact at the latest [s]; inf where it states none.
            claimed: how long a model has claimed a contact that the robot's end has not contradicted yet [s]: the time
                waits, and counts in full if it does.
        """
        patience = self._longest if round_trip is None or round_trip > self._longest else round_trip
        patience += PATIENCE
        if asked > self.free:
            lasted = min(self.lasted + elapsed, patience + FADE + GRACE)
        else:
            lasted = max(0.0, self.lasted - elapsed)
        self.lasted = lasted = lasted if lasted < stated else stated
        left = patience - lasted + claimed
        self.doubtful = left < FALL
        if not self.doubtful:
            self.unfounded = False
            self._bound = inf  # what comes back fades in: the gate approaches it
        else:
            if left > 0.0:
                allowed = self._free + (self._most - self._free) * left / FALL
            else:
                allowed = self._free * max(0.0, 1.0 + left / FADE)
                self.unfounded = self.unfounded or -left >= GRACE
            self._bound = max(allowed, min(self._bound, self._most) - self._most * elapsed / FALL)
        self.quiet = self._bound == inf and lasted == 0.0
        return self._bound


class ContactWatch:
    """Tells a limiter whether the robot's end states a contact: by what is decoded of the torques of an arm.

    `least` is the smallest torque of each axis that states one [N m]: less may be left over within the deadband.
    `delay` is what look-ahead and play-out add to the round trip [s].
    """

    def __init__(self, limiter: ContactLimiter, endpoint: Endpoint, least: Joints, delay: float) -> None:
        self.limiter, self._endpoint, self._least, self._delay = limiter, endpoint, least, delay
        self._now = 0.0
        self._doubted_at = self._answered_at = inf

    def reset(self) -> None:
        self.limiter.reset()
        self._doubted_at = self._answered_at = inf

    def begin(self, tick: float, now: float) -> None:  # noqa: ARG002 - of a hand
        """Begin a tick at `now` [s], and `tick` of the other side."""
        self._now = now

    def end(self) -> bool:
        """End a tick; whether a force is displayed or asked for that is at fault."""
        if not self.limiter.doubtful:
            self._doubted_at = self._answered_at = inf
            return False
        # A scheme cannot let go of what it has not heard of: no fault while the other end stands still.
        if self._doubted_at == inf:
            self._doubted_at = self._now
            self._doubt()
        elif self._answered_at == inf and self._endpoint.liveness.encoder_heard_at > self._doubted_at:
            self._answered_at = self._now
        return self.limiter.unfounded and self._now - self._answered_at >= GRACE

    def _doubt(self) -> None:
        """The bound begins to fall."""

    def bound(self, asked: float, decoded: Joints, elapsed: float) -> float:
        """The largest force or torque that may leave now; inf for no bound. `asked`: the largest before fade and slew
        limit.
        """
        rtt = self._endpoint.clock.rtt
        round_trip = None if rtt is None else rtt + self._delay
        stated, claimed = self._heard(decoded, elapsed, round_trip)
        return self.limiter.bound(asked, elapsed, round_trip, stated=stated, claimed=claimed)

    def _heard(self, decoded: Joints, elapsed: float, round_trip: float | None) -> tuple[float, float]:  # noqa: ARG002
        """How long ago the robot's end stated a contact at the latest, and for how long a model claims one [s]."""
        for torque, least in zip(decoded, self._least, strict=True):
            if abs(torque) > least:
                return 0.0, 0.0
        return inf, 0.0


class HandContact(ContactWatch):
    """The same of the force on a hand, which a model may predict ahead of the robot.

    The robot's end states a contact by an update whose sample has a force of more than `least` [N]; and while it is
    silent, by the received model, at the place that its silence is about: where the robot was commanded to a round trip
    ago, since by now a correction of the model for that place would have come. A robot that is elsewhere says so
    (`weberlink.slave.robot_port.Unreached`). Silence counts only where it is no loss: in each contact something must be
    heard once the robot is there, with no update missing, so it is asked for. `playout`: how much later than received
    an update is used [ticks]. `hand`: the `weberlink.master.operator_port.HandPosition`.
    """

    def __init__(
        self,
        limiter: ContactLimiter,
        decoder: Decoder,
        endpoint: Endpoint,
        hand: Any,
        *,
        least: float,
        sent: SentCommands,
        delay: float,
        playout: int,
    ) -> None:
        super().__init__(limiter, endpoint, (least,), delay)
        self._decoder, self._least_force, self._sent, self._playout = decoder, least, sent, playout
        self._hand = hand
        self._tick = self._claimed = 0.0
        self._newest_sample: Sample | None = None
        self._is_stated = False
        self._since, self._asked = -inf, 0

    def reset(self) -> None:
        super().reset()
        self._sent.reset()
        self._claimed = 0.0

    def begin(self, tick: float, now: float) -> None:
        self._sent.add(self._hand.sampled)
        self._tick, self._now = tick, now
        newest = self._decoder.newest
        self._is_stated = False
        if newest is not self._newest_sample:
            self._newest_sample = newest
            self._is_stated = newest is not None and hypot(*newest.value) > self._least_force
        if self._is_stated:
            self._since = -inf  # of this contact all is heard
        elif self._hand.felt.asked <= self._least_force:
            self._since, self._asked = now, 0

    def _doubt(self) -> None:
        # The scheme lets go of a model whose force lasts without a contact. The robot's end is silent while the model
        # of its newest update is right, which is lost by this: so it is asked for a complete one.
        self._hand.control.refute()
        self._endpoint.request_full_state()

    def _heard(self, decoded: Joints, elapsed: float, round_trip: float | None) -> tuple[float, float]:  # noqa: ARG002
        if self._is_stated:
            self._claimed = UNREACHED_S
            return 0.0, 0.0
        if self.limiter.lasted < LOOK_S:
            return inf, 0.0
        endpoint = self._endpoint
        trip = round_trip or 0.0
        is_silent = endpoint.liveness.encoder_heard_at < self._since + trip
        if is_silent and self._now - self._since >= ASK_S + self._delay + self._asked * LOOK_S:
            statistics = endpoint.statistics
            if self._asked <= min(MOST_COPIES, copies_needed(statistics.outgoing_loss, statistics.outgoing_burst)):
                self._asked += 1
                endpoint.request_answer()
        waited = trip + endpoint.clock.jitter + LOOK_S if trip else 0.0
        x, y, z = self._decoder.stated(self._tick - self._playout, self._sent.ago(waited))
        self._claimed = self._claimed + elapsed if hypot(x, y, z) > self._least_force else 0.0
        if is_silent:
            return inf, 0.0
        if self._claimed < UNREACHED_S + LOOK_S:
            return inf, self._claimed
        return UNREACHED_S, 0.0


class Bound:
    """The bounds of a channel: of a force or a torque on a hand, or of the torques of some axes of an arm.

    What is wanted is approached, part by part: no part changes faster than `slew`, and until all are there it grows in
    `ramp` at most, but may fall at once.

    Args:
        most: largest length of each part [N], or [N m]; 0 for one that displays nothing.
        slew: fastest change of each part [N/s], or [N m/s], > 0; may be infinite.
        ramp: time in which a part may grow to its largest after an engagement or a silence [s], > 0.
        width: axes of each part: three for a hand, one for an arm, whose axes are limited one by one.
        contact: ends what no contact founds; None for what is displayed as it is decoded.
    """

    def __init__(
        self, most: Joints, slew: Joints, ramp: float, *, width: int = 3, contact: ContactWatch | None = None
    ) -> None:
        if len(most) != len(slew):
            raise ValueError(f"{len(most)} limits but {len(slew)} slew limits")
        if not all(limit >= 0.0 for limit in most):
            raise ValueError(f"limits must not be negative: {most}")
        if not (ramp > 0.0 and all(rate > 0.0 for rate in slew)):
            raise ValueError(f"slew and ramp must be positive, not {slew} and {ramp}")
        self.most, self.slew, self.width, self.contact = most, slew, width, contact
        self._nothing: Joints = (0.0,) * (width * len(most))
        self._growth = [max(limit, 1e-300) * ROUNDING / ramp for limit in most]
        self.held = self._nothing  # what left last
        self.asked = 0.0  # largest length of what is wanted, within its limit, before fade and slew limit
        self.arrived = False  # whether the approach is over
        self.clipped = self.held_back = False  # by a limit of size; by the slew limit, and not in the approach

    def reset(self) -> None:
        """Nothing has left last; a gate that opens approaches what comes next."""
        self.held = self._nothing
        if self.contact is not None:
            self.contact.reset()

    def limited(self, wanted: Joints) -> Joints:
        """The parts of what is wanted, shortened to their limits; nothing for one that is not finite."""
        if len(self.most) == 1:  # of a hand; nothing is to be done in most ticks
            length = hypot(*wanted)
            if length <= self.most[0]:
                self.asked, self.clipped = length, False
                return wanted
        limited: Joints = ()
        width, first = self.width, 0
        self.asked, self.clipped = 0.0, False
        for most in self.most:
            part = wanted[first : first + width]
            length = hypot(*part)
            if not isfinite(length):
                part, length = self._nothing[:width], 0.0
            elif length > most:
                self.clipped = self.clipped or most > 0.0
                scale = most / length
                part = (copysign(most, part[0]),) if width == 1 else tuple([value * scale for value in part])
                length = most
            self.asked = max(self.asked, length)
            limited += part
            first += width
        return limited

    def within(self, values: Joints, most: float) -> Joints:
        """All parts as much shorter as the largest needs it."""
        width = self.width
        largest = max([hypot(*values[first : first + width]) for first in range(0, len(values), width)])
        return values if largest <= most else tuple([value * (most / largest) for value in values])

    def advance(self, goal: Joints, step: float, faded: Joints | None = None) -> Joints:
        """Go on towards a goal, as far as the time `step` [s] allows.

        `faded` is what a fade leaves of what left last; its way counts, so that both take no more than the slew limit
        allows, or than the fade alone.
        """
        last, arrived, width, first = self.held, self.arrived, self.width, 0
        held = last if faded is None else faded
        self.held_back = False
        if goal == held:
            self.held, self.arrived = held, True
            return held
        if arrived and faded is None and len(self.slew) == 1:  # the force of a hand follows: most ticks
            self.held = moved = toward(held, goal, self.slew[0] * step)
            self.held_back = moved != goal
            return moved
        moved = ()
        for slew, growth in zip(self.slew, self._growth):  # noqa: B905 - strict costs as much as the loop
            here, there, way = held[first : first + width], goal[first : first + width], slew * step
            if faded is not None:
                way = max(0.0, way - dist(last[first : first + width], here))
            if not arrived:
                there = toward(self._nothing[:width], there, hypot(*here) + growth * step)
            part = toward(here, there, way)
            self.held_back = self.held_back or part != there
            moved += part
            first += width
        self.held = moved
        self.arrived = arrived or moved == goal
        return moved


class OutputGate:
    """All that leaves for the operator's hand, and the share of it that the session and the link let through.

    The share `gain` opens in `ramp` seconds after the session engages and closes as fast when it ends or stops. While
    the ends are engaged but out of touch (`Liveness.in_touch_at`), it closes over the last part of the silence limit
    [s], from `fade_share` of it on, so that nothing is left when the limit is reached. When the peer returns, the force
    fades in. `ramping`: the beginning or the end of a session reduces the force, not silence. `held_back` and
    `clipped`: by a slew limit, or by a limit of size, since the last `fade`.
    """

    def __init__(self, bounds: Sequence[Bound], *, ramp: float, silence: float, fade_share: float) -> None:
        self.bounds = bounds
        self.ramp = ramp
        self.silence = silence
        self._fade_from = fade_share * silence
        self.gain, self._kept = 0.0, 1.0
        self._was_open = self.held_back = self.clipped = False
        self.ramping = True

    def close(self) -> None:
        """Nothing leaves any more, at once; what was heard of contacts is forgotten."""
        self.gain = 0.0
        for bound in self.bounds:
            bound.reset()

    def fade(self, *, engaged: bool, age: float, step: float) -> None:
        """Move the share by a tick of `step` [s]; `engaged`: anything may be felt at all; `age`: out of touch for so
        long [s].
        """
        self.held_back = self.clipped = False
        before, self._kept = self.gain, 1.0
        self._was_open = before > 0.0
        if engaged and before == 1.0 and age <= self._fade_from:
            self.ramping = False
            return
        share = step / self.ramp
        heard = (self.silence - age) / (self.silence - self._fade_from)
        self.gain = max(0.0, min(min(1.0, before + share) if engaged else before - share, heard))
        if self.gain < before:
            self._kept = self.gain / before
        self.ramping = not engaged or self.gain < min(1.0, heard)

    def passed(self, index: int, wanted: Joints, decoded: Joints, step: float) -> Joints:
        """What leaves of a channel in this tick; of what is wanted, what is not finite counts as nothing."""
        bound, gain, most = self.bounds[index], self.gain, inf
        goal, contact = bound.limited(wanted), bound.contact
        # A closed gate asks for no contact.
        if (
            self._was_open
            and contact is not None
            and not (contact.limiter.quiet and bound.asked <= contact.limiter.free)
        ):
            most = contact.bound(bound.asked, decoded, step)
        if gain == 1.0 and most == inf:
            output = bound.advance(goal, step)
        else:
            # Fade and contact take away at once, of what is wanted and of what left last; the slew limit is for the
            # rest. What comes back is approached.
            bound.arrived, kept = False, self._kept
            goal = tuple([value * gain for value in goal])
            faded: Joints | None = None
            if kept != 1.0 or most < inf:
                faded = tuple([value * kept for value in bound.held])
            if most < inf and faded is not None:
                goal, faded = bound.within(goal, most), bound.within(faded, most)
            output = bound.advance(goal, step, faded)
            bound.arrived = False
        self.held_back = self.held_back or bound.held_back
        self.clipped = self.clipped or bound.clipped
        return output
