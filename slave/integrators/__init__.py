"""Integrators: what one is given, what it does in one step, and their table.

Entry points of the group `weberlink.integrators` extend it: a new one is a file beside these and a line here; an entry
point names an `IntegrationScheme`.
"""

from dataclasses import dataclass
from typing import NamedTuple, Protocol, cast

from weberlink.geometry.vector import Vector
from weberlink.registry import Registry, check_contract, import_part
from weberlink.slave.scenes.scene import Scene


class MassState(NamedTuple):
    """Position [m], velocity [m/s], and the contact force at that state [N]; scene frame."""

    position: Vector
    velocity: Vector
    force: Vector


class ControlledMass(NamedTuple):
    """The mass [kg], and stiffness [N/m] and damping [N s/m] of its position control; the last two may be 0."""

    mass: float
    stiffness: float
    damping: float


class Integrator(Protocol):
    """A scheme for one mass and one scene; its class is called with a `ControlledMass` and a `Scene`."""

    def advance(self, motion: MassState, goal: Vector, step: float) -> MassState:
        """The state `step` [s] later, with the goal [m] constant meanwhile.

        The scene moves on with it: its state afterwards is that of the position returned. Never raises; an extreme goal
        may give a state that is not finite.
        """
        ...


@dataclass(frozen=True, slots=True)
class IntegrationScheme:
    """One line of the table of integrators."""

    where: str  # "module:Class", imported only when one is built
    order: int  # global, where the motion is smooth
    l_stable: bool  # a linear contact stiffer than the step resolves is damped out at once: stable at any step
    exact_if_linear: bool = False  # flat contact without friction has no error but rounding, at any step
    gains_nothing: bool = False  # no step with its goal held gains energy, in any scene of one stiffness

    def build(self, body: ControlledMass, scene: Scene | None) -> Integrator:
        """The integrator for `body`; without a scene it moves freely. Raises ValueError if it cannot be imported, or is
        no integrator.
        """
        integrator = import_part("integrator", self.where)(body, scene or Scene([]))
        check_contract("integrator", integrator, Integrator)
        return cast(Integrator, integrator)


BUILT_IN: dict[str, IntegrationScheme | str] = {  # the cheapest step first
    "semi_implicit": IntegrationScheme("weberlink.slave.integrators.semi_implicit:SemiImplicit", 1, l_stable=False),
    "implicit": IntegrationScheme(
        "weberlink.slave.integrators.implicit:Implicit", 2, l_stable=True, gains_nothing=True
    ),
    "exact": IntegrationScheme(
        "weberlink.slave.integrators.exact:Exact", 2, l_stable=True, exact_if_linear=True, gains_nothing=True
    ),
}


def _check(name: str, entry: object) -> None:
    if not isinstance(entry, IntegrationScheme):
        raise ValueError(f"weberlink.integrators: {name} is not an IntegrationScheme")  # noqa: TRY004 - wrong name


INTEGRATORS: Registry[IntegrationScheme] = Registry("integrator", BUILT_IN, "weberlink.integrators", _check)
