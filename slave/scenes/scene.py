"""Everything that the probe can touch, and the force that it feels. Pure: no clock, no I/O."""

from collections.abc import Sequence

from codec.vector import ZERO, Vector, distance, is_finite
from slave.scenes.contact import SceneObject, contact_of
from slave.scenes.proxy import Proxy

FARTHEST = 1e12  # [m] beyond it squares of distances have no digits left for a contact


class Scene:
    """The union of `objects`; none of them is free space.

    Never raises and never returns a non-finite force, whatever the position. One that is not finite, or 1e12 m away,
    leaves the contact as it was, gives zero force and is counted in `rejected`.
    """

    __slots__ = ("_contacts", "_proxy", "_touched", "damping_n_s_m", "penetration_depth", "rejected", "stiffness_n_m")

    def __init__(self, objects: Sequence[SceneObject]) -> None:
        self._contacts = [contact_of(thing) for thing in objects]
        self._proxy = Proxy([thing.shape for thing in objects])
        self._touched: set[int] = set()
        self.stiffness_n_m = max((thing.stiffness_n_m for thing in objects), default=0.0)
        """The stiffest object, which decides the step of whoever integrates against this scene."""
        self.damping_n_s_m = max((thing.damping_n_s_m or 0.0 for thing in objects), default=0.0)
        self.penetration_depth = 0.0
        """Distance [m] between probe and proxy at the last call."""
        self.rejected = 0
        """Positions that were not usable."""

    @property
    def contacts(self) -> int:
        """How many objects were touched at the last call."""
        return len(self._touched)

    @property
    def proxy(self) -> Vector | None:
        """The proxy; None before the first position."""
        return self._proxy.at

    def force(self, position: Vector, dt: float) -> Vector:
        """Reaction of the scene on a probe.

        Args:
            position: Where the probe is, scene frame [m].
            dt: Time since the last call [s]; only damping uses it.

        Returns:
            Force on the probe [N], scene frame.
        """
        if not (abs(position[0]) < FARTHEST and abs(position[1]) < FARTHEST and abs(position[2]) < FARTHEST):
            self.rejected += 1
            return ZERO
        proxy, presses = self._proxy.follow(position)
        if self._touched:
            self._release_all_but({index for index, _, _ in presses})
        if not presses:
            self.penetration_depth = 0.0
            return ZERO
        self.penetration_depth = distance(proxy, position)
        x = y = z = 0.0
        for index, depth, normal in presses:
            self._touched.add(index)
            f = self._contacts[index].force(depth, normal, proxy, dt)
            x, y, z = x + f[0], y + f[1], z + f[2]
        force = (x, y, z)
        if not is_finite(force):
            self._release_all_but(set())  # whatever overflowed must not be remembered
            self.rejected += 1
            return ZERO
        return force

    def reset(self) -> None:
        """Forgets the contact: the next position is taken as it comes, inside a solid or not. Counters stay."""
        self._proxy.at = None
        self._release_all_but(set())
        self.penetration_depth = 0.0

    def _release_all_but(self, held: set[int]) -> None:
        for index in self._touched - held:
            self._contacts[index].release()
        self._touched &= held
