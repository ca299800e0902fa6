"""The table of integrators, extended by entry points of the group `weberlink.integrators`.

A new one is a file beside these and a line here; an entry point names an `IntegrationScheme`.
"""

from weberlink.registry import Registry
from weberlink.slave.integrators.contract import ControlledMass, IntegrationScheme, Integrator, MassState

INTEGRATORS: dict[str, IntegrationScheme] = {
    "semi_implicit": IntegrationScheme(
        "weberlink.slave.integrators.semi_implicit:SemiImplicit", order=1, l_stable=False
    ),
    "implicit": IntegrationScheme("weberlink.slave.integrators.implicit:Implicit", order=2, l_stable=True),
    "exact": IntegrationScheme("weberlink.slave.integrators.exact:Exact", order=2, l_stable=True, exact_if_linear=True),
}
"""The built-in ones by name, the cheapest step first."""

_installed: Registry[IntegrationScheme] = Registry(
    "integrator", dict.fromkeys(INTEGRATORS, ""), "weberlink.integrators"
)


def integration_scheme(name: str) -> IntegrationScheme:
    """The scheme of this name; raises ValueError if there is none."""
    return INTEGRATORS[name] if name in INTEGRATORS else _installed.load(name)


__all__ = ["INTEGRATORS", "ControlledMass", "IntegrationScheme", "Integrator", "MassState", "integration_scheme"]
