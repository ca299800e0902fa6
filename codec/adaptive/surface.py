"""The surfaces that a contact may be, one for each supposition about it (see `weberlink.codec.adaptive.contact`)."""

from weberlink.codec.adaptive.candidate import Occasion
from weberlink.codec.adaptive.contact import Contact
from weberlink.codec.adaptive.history import History
from weberlink.codec.predictors import Trust
from weberlink.codec.predictors.surface import Surface, patch
from weberlink.geometry.sine import cosine, sine
from weberlink.geometry.vector import Vector, dot, norm, unit

LEAST_CURVATURE = 0.5
"""[1/m]: below it is flat, and cheaper."""
LEAST_FRICTION = 0.03
MOTION_WINDOW = 80
"""Ticks back over which velocity and acceleration are fitted."""
MOTION_STEP = 2
LEAST_WINDOW = 8


class _Supposition:
    """What all three know."""

    __slots__ = ("_contact", "_trust")

    def __init__(self, contact: Contact, trust: Trust) -> None:
        self._contact = contact
        self._trust = trust


class Smooth(_Supposition):
    """At rest, without friction: the normal is the direction of the force."""

    __slots__ = ()

    def model(self, occasion: Occasion) -> Surface | None:
        contact, newest = self._contact, occasion.newest
        give = contact.smooth.compliance
        if contact.age == 0 or give == 0.0 or norm(newest.value) == 0.0:
            return None
        return patch(newest, unit(newest.value), give, _bent(contact.bend.value), self._trust)


class Rough(_Supposition):
    """At rest, with friction."""

    __slots__ = ()

    def model(self, occasion: Occasion) -> Surface | None:
        contact, newest = self._contact, occasion.newest
        give, normal = contact.rough.compliance, contact.normal
        if contact.age == 0 or give == 0.0 or contact.friction < LEAST_FRICTION or dot(normal, newest.value) <= 0.0:
            return None
        return patch(newest, normal, give, _bent(contact.rough_bend.value), self._trust, friction=contact.friction)


class Moving(_Supposition):
    """Moving along its normal, without friction, and flat."""

    __slots__ = ()

    def model(self, occasion: Occasion) -> Surface | None:
        contact, newest = self._contact, occasion.newest
        give, pulse = contact.moving.compliance, contact.pulse.value
        if contact.age == 0 or give == 0.0 or norm(newest.value) == 0.0:
            return None
        normal = unit(newest.value)
        window = min(MOTION_WINDOW, contact.age - 1, len(occasion.history) - 1)
        if window <= LEAST_WINDOW:
            return patch(newest, normal, give, 0.0, self._trust)
        velocity, acceleration = _motion(occasion.history, normal, give, pulse, window)
        return patch(newest, normal, give, 0.0, self._trust, velocity=velocity, acceleration=acceleration, pulse=pulse)


def _bent(curvature: float) -> float:
    return curvature if abs(curvature) > LEAST_CURVATURE else 0.0


def _motion(history: History, normal: Vector, give: float, pulse: float, window: int) -> tuple[float, float]:
    """Velocity and acceleration of the surface, by least squares over where it held the probe."""
    values, places = history.values, history.places
    a, b, c = normal
    here = dot(normal, places[-1]) + give * dot(normal, values[-1])
    xx = xz = zz = xq = zq = 0.0
    for back in range(window, 0, -MOTION_STEP):
        (u, v, w), (x, y, z) = values[-1 - back], places[-1 - back]
        q = a * (x + give * u) + b * (y + give * v) + c * (z + give * w) - here
        ahead = -float(back)
        first, second = ahead, 0.5 * ahead * ahead
        if pulse > 0.0:
            angle = pulse * ahead
            first, second = sine(angle) / pulse, (1.0 - cosine(angle)) / (pulse * pulse)
        xx += first * first
        xz += first * second
        zz += second * second
        xq += first * q
        zq += second * q
    determinant = xx * zz - xz * xz
    if not determinant > 0.0:
        return 0.0, 0.0
    return (xq * zz - zq * xz) / determinant, (xx * zq - xz * xq) / determinant
