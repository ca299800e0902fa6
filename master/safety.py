"""Protects the operator's hand: limits of force, slew rate and time without contact, and a gate that fades force.

A torque has limiters of its own and shares the gate of the force. The torques of an arm are limited axis by axis.
"""

from math import dist, hypot, inf

from weberlink.geometry.joints import Joints
from weberlink.geometry.vector import ZERO, Vector

PATIENCE = 0.045
"""Time beyond the round trip for which the robot's end may leave a force without a contact [s]: for a robot that lags
behind its command, and an update that comes late. 5 ms below what the law allows: a contact that a model claims counts
as younger than it may be by so much (`weberlink.master.operator_port.ContactWatch`)."""
FALL = 0.015
"""Last part of it, in which the bound falls to what needs no contact [s]; jitter may delay the news of one until then.
"""
FADE = 0.1
"""Time in which what is left falls to zero [s]."""
GRACE = 0.05
"""Time after which what still asks for a force is at fault [s]: a scheme fades out what it was told to let go of."""
RISE = 0.05
"""Time in which a bound rises to the largest force [s]."""
ROUNDING = 1.0 + 1e-9


class ForceLimiter:
    """Bounds the magnitude of a force or torque and keeps its direction.

    Attributes:
        most: the largest magnitude [N], or [N m].
        clipped: whether the newest value was longer.
    """

    __slots__ = ("clipped", "most")

    def __init__(self, limit: float) -> None:
        """Make the limiter.

        Args:
            limit: largest force [N], or torque [N m], > 0.
        """
        if not limit > 0.0:
            raise ValueError(f"force limit must be positive, not {limit!r}")
        self.most = limit
        self.clipped = False

    def limit(self, force: Vector) -> Vector:
        """The force, shortened to the limit if it is longer; `clipped` says whether it was."""
        length = hypot(force[0], force[1], force[2])
        self.clipped = length > self.most
        if not self.clipped:
            return force
        factor = self.most / length
        return (force[0] * factor, force[1] * factor, force[2] * factor)


class SlewLimiter:
    """Bounds the rate of change of a force or torque, as a vector, so also where it reverses.

    Without it, a peer with the key or a model that jumps may change the force by twice its limit within one tick.

    Attributes:
        limited: whether the newest force was held back.
    """

    __slots__ = ("_rate", "_value", "limited")

    def __init__(self, rate: float) -> None:
        """Make the limiter, at no force.

        Args:
            rate: largest change [N/s], or [N m/s], > 0; may be infinite.
        """
        if not rate > 0.0:
            raise ValueError(f"slew limit must be positive, not {rate!r}")
        self._rate = rate
        self._value: Vector = ZERO
        self.limited = False

    def place(self, force: Vector) -> Vector:
        """Begin at a force: it may jump while the gate is closed."""
        self._value = force
        self.limited = False
        return force

    def limit(self, force: Vector, elapsed: float) -> Vector:
        """The force, or the point on the way to it from the last one that `elapsed` seconds allow."""
        before = self._value
        if force == before:
            self.limited = False
            return force
        way, allowed = dist(before, force), self._rate * elapsed
        self.limited = way > allowed
        if self.limited:
            share = allowed / way
            force = (
                before[0] + share * (force[0] - before[0]),
                before[1] + share * (force[1] - before[1]),
                before[2] + share * (force[2] - before[2]),
            )
        self._value = force
        return force


class TorqueLimiter:
    """Bounds the torque of each axis of an arm, and its rate of change.

    Attributes:
        most: the largest torques [N m].
        clipped: whether the newest torque of an axis that displays any was larger.
        held_back: whether the newest torque of an axis changed faster than it may.
    """

    __slots__ = ("_slew", "_torques", "clipped", "held_back", "most")

    def __init__(self, most: Joints, slew: Joints) -> None:
        """Make the limiter, at no torque.

        Args:
            most: largest torque of each axis [N m], >= 0; 0 for one that displays none.
            slew: largest change of each axis [N m/s], > 0; may be infinite.
        """
        if len(most) != len(slew):
            raise ValueError(f"{len(most)} torque limits but {len(slew)} slew limits")
        if not all(limit >= 0.0 for limit in most):
            raise ValueError(f"torque limits must not be negative: {most}")
        if not all(limit > 0.0 for limit in slew):
            raise ValueError(f"slew limits must be positive: {slew}")
        self.most = most
        self._slew = slew
        self._torques: Joints = (0.0,) * len(most)
        self.clipped = self.held_back = False

    def limit(self, torques: Joints, elapsed: float | None) -> Joints:
        """The torques within both limits.

        Args:
            torques: of all axes, finite [N m].
            elapsed: time since the last call [s]; None where the torques may jump, since the gate is closed.
        """
        self.clipped = self.held_back = False
        limited = []
        for torque, most, slew, before in zip(torques, self.most, self._slew, self._torques, strict=True):
            value = torque
            if abs(value) > most:
                value = most if value > 0.0 else -most
                self.clipped |= most > 0.0
            if elapsed is not None and abs(value - before) > slew * elapsed:
                value = before + (slew * elapsed if value > before else -slew * elapsed)
                self.held_back = True
            limited.append(value)
        self._torques = tuple(limited)
        return self._torques


class ContactLimiter:
    """No force without a contact: bounds what is displayed while the robot's end states none.

    A hand may be ahead of the robot in a contact that a model predicts, for as long as the answer takes: the round trip
    and `PATIENCE`. By then the bound has fallen to `free`, and it falls on to 0. It does not depend on the control
    scheme or on a predictor, and holds whatever they ask for. A scheme is told as the bound begins to fall; one that
    asks for more than `free` `GRACE` beyond the law is at fault.

    Time with no more than `free` counts back, so that taps ahead of the robot do not add up.

    Attributes:
        free: largest force that needs no contact.
        lasted: time for which more than `free` was asked for since a contact was stated [s].
        quiet: whether nothing is bounded, and nothing was asked for lately that needs a contact.
        doubtful: whether it has lasted so long that the bound falls.
        unfounded: whether more than `free` was asked for until `GRACE` after the limit; it ends with the doubt.
    """

    __slots__ = ("_bound", "_free", "_longest", "_most", "doubtful", "free", "lasted", "quiet", "unfounded")

    def __init__(self, most: float, free: float, longest: float) -> None:
        """Make the limiter.

        Args:
            most: largest force [N], or torque [N m].
            free: largest one that needs no contact.
            longest: round trip that is assumed while none is known, and never exceeded [s].
        """
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
            asked: size of the force before the slew limit [N].
            elapsed: time since the last call [s].
            round_trip: of signals over the link [s]; None while unknown.
            stated: how long ago the robot's end stated a contact at the latest [s]; inf where it states none.
            claimed: for how long a model has claimed a contact that the robot's end has not contradicted yet [s]: the
                time waits, and counts in full if it does.
        """
        patience = self._longest if round_trip is None or round_trip > self._longest else round_trip
        patience += PATIENCE
        if asked > self.free:
            self.lasted = min(self.lasted + elapsed, stated, patience + FADE + GRACE)
        else:
            self.lasted = min(max(0.0, self.lasted - elapsed), stated)
        left = patience - self.lasted + claimed
        self.doubtful = left < FALL
        if not self.doubtful:
            self.unfounded = False
            allowed = inf
        elif left > 0.0:
            allowed = self._free + (self._most - self._free) * left / FALL
        else:
            allowed = self._free * max(0.0, 1.0 + left / FADE)
            self.unfounded = self.unfounded or -left >= GRACE
        before = min(self._bound, self._most)
        self._bound = max(min(allowed, before + self._most * elapsed / RISE), before - self._most * elapsed / FALL)
        if self._bound >= self._most:
            self._bound = inf
        self.quiet = self._bound == inf and self.lasted == 0.0
        return self._bound


class ForceGate:
    """The share of the decoded force that is displayed, 0 to 1, without a jump in either direction.

    It opens in `ramp` seconds after the session engages and closes as fast when it ends or stops. While the ends are
    engaged but out of touch (`Liveness.in_touch_at`), it closes over the last part of the silence limit, so that the
    force is zero when the limit is reached. When the peer returns, the force fades in.

    Attributes:
        gain: the share.
        ramping: whether the beginning or the end of a session reduces the force; False for silence.
    """

    __slots__ = ("_fade_from", "_ramp", "_silence", "gain", "ramping")

    def __init__(self, *, ramp: float, silence: float, fade_share: float) -> None:
        """Make the gate, closed.

        Args:
            ramp: time from closed to open and back [s], > 0.
            silence: limit of silence [s], > 0.
            fade_share: part of the limit, 0..1, after which the force begins to fade.
        """
        self._ramp = ramp
        self._silence = silence
        self._fade_from = fade_share * silence
        self.gain = 0.0
        self.ramping = True

    def close(self) -> None:
        """Close at once."""
        self.gain = 0.0

    def update(self, *, engaged: bool, age: float, elapsed: float) -> float:
        """Move the gate; returns the gain.

        Args:
            engaged: whether force may be felt at all.
            age: how long the ends have been out of touch [s].
            elapsed: time since the last call [s].
        """
        if engaged and self.gain == 1.0 and age <= self._fade_from:
            self.ramping = False
            return 1.0
        step = elapsed / self._ramp
        heard = (self._silence - age) / (self._silence - self._fade_from)
        wanted = min(1.0, self.gain + step) if engaged else self.gain - step
        self.gain = max(0.0, min(wanted, heard))
        self.ramping = not engaged or self.gain < min(1.0, heard)
        return self.gain
