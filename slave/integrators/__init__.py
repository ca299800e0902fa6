"""The table of integrators, extended by entry points of the group `weberlink.integrators`.

A new one is a file beside these and a line here; an entry point names an `IntegrationScheme`.
"""

from weberlink.registry import Registry
from weberlink.slave.integrators.contract import ControlledMass, IntegrationScheme, Integrator, MassState

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

__all__ = ["BUILT_IN", "INTEGRATORS", "ControlledMass", "IntegrationScheme", "Integrator", "MassState"]
