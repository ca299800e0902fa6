"""From a penetration to a force: one contact per object, built only with the parts that the object names."""

from dataclasses import dataclass
from typing import NamedTuple, Protocol

from weberlink.geometry.vector import ZERO, Vector
from weberlink.slave.scenes.shape import Shape


@dataclass(frozen=True, slots=True)
class FrictionCone:
    """Coulomb coefficients, 0 <= dynamic <= static."""

    static: float
    dynamic: float

    def __post_init__(self) -> None:
        if not 0.0 <= self.dynamic <= self.static:
            raise ValueError(f"friction: expected 0 <= dynamic <= static, got {self.dynamic} and {self.static}")


@dataclass(frozen=True, slots=True)
class SceneObject:
    """A shape and what its surface does. None means that the part is not there, and nothing of it is computed."""

    shape: Shape
    stiffness_n_m: float
    friction: FrictionCone | None = None
    damping_n_s_m: float | None = None

    def __post_init__(self) -> None:
        if not self.stiffness_n_m > 0.0:
            raise ValueError(f"stiffness_n_m: expected more than 0 N/m, got {self.stiffness_n_m}")
        if self.damping_n_s_m is not None and not self.damping_n_s_m >= 0.0:
            raise ValueError(f"damping_n_s_m: expected at least 0 N s/m, got {self.damping_n_s_m}")


class Touch(NamedTuple):
    """One object as it is felt where the probe is now, for whoever knows the velocity of the probe.

    Args:
        owner: Which object of the scene.
        depth: How far the object pushes the probe out along `normal` [m], more than 0.
        normal: Unit vector out of the object.
        stiffness: k of the spring along the normal [N/m].
        damping: b along the normal [N s/m]; 0 where the object has none.
        drag: Friction force on the probe [N], along the surface.
        grip: Stiffness of `drag` against motion along the surface [N/m]; 0 where it drags along or nothing rubs.
    """

    owner: int
    depth: float
    normal: Vector
    stiffness: float
    damping: float
    drag: Vector
    grip: float


class Contact(Protocol):
    """How one object answers."""

    @property
    def state(self) -> object:
        """What is remembered of the touch, immutable."""
        ...

    def restore(self, state: object) -> None:
        """Goes back to a `state` of this contact."""
        ...

    def touch(self, index: int, depth: float, normal: Vector, proxy: Vector) -> Touch:
        """The same contact without its dampers' force; friction moves on as in `force`."""
        ...

    def force(self, depth: float, normal: Vector, proxy: Vector, dt: float) -> Vector:
        """Force [N] on the probe that is `depth` [m] inside, `dt` [s] after the last call; `normal` points out."""
        ...

    def release(self) -> None:
        """The probe has left the object: whatever was remembered of the touch is void."""
        ...


class SpringContact:
    """f = k depth n."""

    __slots__ = ("_stiffness",)

    def __init__(self, stiffness: float) -> None:
        self._stiffness = stiffness

    @property
    def state(self) -> None:
        return None

    def restore(self, state: object) -> None:
        pass

    def touch(self, index: int, depth: float, normal: Vector, proxy: Vector) -> Touch:  # noqa: ARG002
        return Touch(index, depth, normal, self._stiffness, 0.0, ZERO, 0.0)

    def force(self, depth: float, normal: Vector, proxy: Vector, dt: float) -> Vector:  # noqa: ARG002
        f = self._stiffness * depth
        return (f * normal[0], f * normal[1], f * normal[2])

    def release(self) -> None:
        pass


def contact_of(thing: SceneObject) -> Contact:
    """The contact that `thing` needs; imports damping and friction only for an object that has them."""
    contact: Contact
    if thing.damping_n_s_m is None:
        contact = SpringContact(thing.stiffness_n_m)
    else:
        from weberlink.slave.scenes.damping import DampedContact  # noqa: PLC0415

        contact = DampedContact(thing.stiffness_n_m, thing.damping_n_s_m)
    if thing.friction is not None:
        from weberlink.slave.scenes.friction import FrictionContact  # noqa: PLC0415

        contact = FrictionContact(contact, thing.stiffness_n_m, thing.friction)
    return contact
