"""Coulomb friction as a cone on the displacement of the proxy, never on a velocity.

A decoded position moves in steps, so its velocity is either zero or absurd; the displacement from where the surface
holds the probe is well defined at every tick. The cone on the proxy is that of Harwin and Melder, "Improved haptic
rendering for multi-finger manipulation using friction cone based god-objects", Eurohaptics 2002.
"""

from typing import cast

from weberlink.geometry.vector import ZERO, Vector, add, dot, norm, scale, subtract
from weberlink.slave.scenes.contact import Contact, FrictionCone, Touch

State = tuple[object, Vector | None, bool]

RESTICK = 0.5  # share of the dynamic cone


class FrictionContact:
    """Adds k (anchor - proxy) along the surface to the force of the contact that it wraps.

    The anchor is where the surface holds the probe. It stays while the displacement is within mu_static * depth;
    beyond, it is dragged along at mu_dynamic * depth. Once sliding, it slides until the displacement falls below half
    of the dynamic cone (the probe has turned back): a mere pause between two position updates must not bring back the
    higher static limit.
    """

    __slots__ = ("_anchor", "_cone", "_normal_contact", "_sliding", "_stiffness")

    def __init__(self, normal_contact: Contact, stiffness: float, cone: FrictionCone) -> None:
        self._normal_contact = normal_contact
        self._stiffness = stiffness
        self._cone = cone
        self._anchor: Vector | None = None
        self._sliding = False

    @property
    def state(self) -> State:
        return (self._normal_contact.state, self._anchor, self._sliding)

    def restore(self, state: object) -> None:
        pressed, self._anchor, self._sliding = cast(State, state)
        self._normal_contact.restore(pressed)

    def touch(self, index: int, depth: float, normal: Vector, proxy: Vector) -> Touch:
        touch = self._normal_contact.touch(index, depth, normal, proxy)
        before = self._anchor
        drag = self._drag(depth, normal, proxy)
        dragged = before is not None and self._anchor is not before
        return touch._replace(drag=drag, grip=0.0 if dragged else self._stiffness)

    def force(self, depth: float, normal: Vector, proxy: Vector, dt: float) -> Vector:
        pressed = self._normal_contact.force(depth, normal, proxy, dt)
        return add(pressed, self._drag(depth, normal, proxy))

    def _drag(self, depth: float, normal: Vector, proxy: Vector) -> Vector:
        """k (anchor - proxy) along the surface, after the anchor has been dragged along as far as it must."""
        if self._anchor is None:
            self._anchor = proxy
            return ZERO
        offset = subtract(self._anchor, proxy)
        tangential = subtract(offset, scale(normal, dot(offset, normal)))
        length = norm(tangential)
        dynamic = self._cone.dynamic * depth
        if length > (dynamic if self._sliding else self._cone.static * depth):
            self._sliding = True
            tangential = scale(tangential, dynamic / length)
            self._anchor = add(proxy, tangential)
        elif length < RESTICK * dynamic:
            self._sliding = False
        return scale(tangential, self._stiffness)

    def release(self) -> None:
        self._normal_contact.release()
        self._anchor = None
        self._sliding = False
