"""A damped oscillator in closed form, and the time at which it falls to zero."""

from math import atan2, cos, exp, expm1, inf, log1p, pi, sin, sqrt

NEWTON_MOST = 64  # each halves the bracket at worst, so that the bits of a double run out first
ROUNDING = 4e-16

Transition = tuple[float, float, float, float]  # y(t) = rest + a (y - rest) + b v and v(t) = c (y - rest) + d v


class Oscillation:
    """m y'' = -k (y - rest) - c y', for any k, c >= 0: under-, over- and critically damped, or free.

    With s = c / 2m and w^2 = k/m - s^2 the transition is that of exp(A t):

        w^2 > 0:  b = exp(-s t) sin(w t) / w,  a = exp(-s t) cos(w t) + s b,  d = a - 2 s b
        else, with the rates p = s + |w| and q = (k/m) / p:
                  b = exp(-q t) (1 - exp(-(p - q) t)) / (p - q),  a = exp(-q t) + q b,  d = exp(-p t) - q b

    and c = -(k/m) b. This form avoids overflow, and cancellation where one rate is far above the other.
    """

    def __init__(self, mass: float, stiffness: float, damping: float) -> None:
        self.squared = stiffness / mass  # k / m [1/s^2]
        self.decay = damping / (2.0 * mass)  # s [1/s]
        difference = self.squared - self.decay * self.decay
        self._frequency = sqrt(difference) if difference > 0.0 else 0.0
        self._half_period = pi / self._frequency if difference > 0.0 else inf
        self._fast = self.decay + sqrt(max(0.0, -difference))
        self._slow = self.squared / self._fast if self._fast > 0.0 else 0.0
        self._cached: tuple[float, Transition] = (0.0, (1.0, 0.0, 0.0, 1.0))

    def transition(self, time: float) -> Transition:
        """Over `time` [s], at least 0; the last result is cached."""
        if time != self._cached[0]:
            self._cached = (time, self._transition(time))
        return self._cached[1]

    def _transition(self, time: float) -> Transition:
        frequency = self._frequency
        if frequency > 0.0:
            faded, angle = exp(-self.decay * time), frequency * time
            b = faded * sin(angle) / frequency
            a = faded * cos(angle) + self.decay * b
            return a, b, -self.squared * b, a - 2.0 * self.decay * b
        fast, slow = self._fast, self._slow
        faded, spread = exp(-slow * time), fast - slow
        b = faded * (-expm1(-spread * time) / spread if spread > 0.0 else time)
        return faded + slow * b, b, -self.squared * b, exp(-fast * time) - slow * b

    def first_fall(self, value: float, rate: float, rest: float, horizon: float) -> float | None:
        """When the coordinate first reaches zero from above, or is at or below it and falls [s]; None beyond `horizon`.

        The time is exact to rounding. Successive swings never grow, so the first minimum is the lowest: only the motion
        up to it is searched, and a grazed zero is found by that minimum. A coordinate that starts below zero and rises
        is left alone until it falls again.
        """
        offset = value - rest
        if rest > 0.0 and self.squared * (rest * rest - offset * offset) > rate * rate:
            return None  # its energy does not reach so far
        start, end = 0.0, self.turn(offset, rate)
        if rate > 0.0 or (rate == 0.0 and self.squared * (rest - value) >= 0.0):
            start, end = end, end + self._half_period
            if start >= horizon or (rate == 0.0 and value == rest):
                return None
        elif value <= 0.0:
            return 0.0
        end = min(end, horizon)
        a, b, _, _ = self.transition(end)
        if rest + a * (value - rest) + b * rate > 0.0:
            return None
        return min(end, self._zero(value - rest, rate, rest, start, end))  # which may pass it by a rounding

    def turn(self, offset: float, rate: float) -> float:
        """Time to the next change of sign of the rate [s]; infinite if never."""
        if self._frequency > 0.0:
            angle = atan2(self._frequency * rate, self.squared * offset + self.decay * rate)
            # The product with a tiny positive rate may underflow to 0; it turns at once, not after half a swing.
            return (angle if angle > 0.0 or rate > 0.0 else angle + pi) / self._frequency
        backward = self.squared * offset + self._slow * rate
        if backward == 0.0 or (rate > 0.0) != (backward > 0.0) or rate == 0.0:
            return inf
        spread = self._fast - self._slow
        return log1p(spread * rate / backward) / spread if spread > 0.0 else rate / backward

    def _zero(self, offset: float, rate: float, rest: float, low: float, high: float) -> float:
        """Zero of the coordinate, which falls from `low` to `high`, by bracketed Newton iteration."""
        a, b, _, _ = self._transition(low)
        above = rest + a * offset + b * rate
        if above <= 0.0:
            return low
        a, b, _, _ = self._transition(high)
        below = rest + a * offset + b * rate
        time = low + (high - low) * above / (above - below)
        for _ in range(NEWTON_MOST):
            a, b, c, d = self._transition(time)
            value, slope = rest + a * offset + b * rate, c * offset + d * rate
            if value > 0.0:
                low = time
            else:
                high = time
            following = time - value / slope if slope < 0.0 else low
            if not low < following < high:
                following = 0.5 * (low + high)
            if abs(following - time) <= ROUNDING * time or value == 0.0:
                break
            time = following
        return time
