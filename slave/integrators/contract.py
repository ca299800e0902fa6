"""What an integrator is: one step of a mass under position control that touches a scene. Knows no clock, no robot.

    m a = k (goal - x) - c v + f(x, v)

with the contact force f of the scene. How the force follows from x and v is in `weberlink.slave.integrators.reaction`.
"""

from dataclasses import dataclass
from importlib import import_module
from typing import NamedTuple, Protocol, cast

from weberlink.geometry.vector import Vector
from weberlink.slave.scenes.scene import Scene


class Motion(NamedTuple):
    """Where the mass is [m], how fast [m/s], and the contact force on it there [N]; scene frame."""

    position: Vector
    velocity: Vector
    force: Vector


class Body(NamedTuple):
    """The mass [kg], and stiffness [N/m] and damping [N s/m] of its position control; the last two may be 0."""

    mass: float
    stiffness: float
    damping: float


class Integrator(Protocol):
    """A scheme for one body and one scene."""

    def advance(self, motion: Motion, goal: Vector, step: float) -> Motion:
        """The motion `step` [s] later, with the goal [m] constant meanwhile.

        The scene moves on with it: its state afterwards is that of the position returned. Never raises; a goal far
        beyond all use may give a motion that is not finite.
        """
        ...


class Builder(Protocol):
    def __call__(self, body: Body, scene: Scene | None) -> Integrator: ...


@dataclass(frozen=True, slots=True)
class Scheme:
    """One line of the table of integrators.

    Args:
        where: "module:Class", imported only when one is built.
        order: Global order where the motion is smooth.
        l_stable: Whether a linear contact stiffer than the step resolves is damped out at once: stable at any step.
        exact_if_linear: Whether flat contact without friction has no error but rounding, at any step.
    """

    where: str
    order: int
    l_stable: bool
    exact_if_linear: bool = False

    def build(self, body: Body, scene: Scene | None) -> Integrator:
        """The integrator for `body`; without a scene it moves freely."""
        module, _, attribute = self.where.partition(":")
        return cast(Builder, getattr(import_module(module), attribute))(body, scene)
