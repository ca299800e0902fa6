"""The table of integrators. A new one is a file beside these and a line here."""

from weberlink.slave.integrators.contract import Body, Integrator, Motion, Scheme

INTEGRATORS: dict[str, Scheme] = {
    "semi_implicit": Scheme("weberlink.slave.integrators.semi_implicit:SemiImplicit", order=1, l_stable=False),
    "implicit": Scheme("weberlink.slave.integrators.implicit:Implicit", order=2, l_stable=True),
    "exact": Scheme("weberlink.slave.integrators.exact:Exact", order=2, l_stable=True, exact_if_linear=True),
}
"""By name, the cheapest step first."""

__all__ = ["INTEGRATORS", "Body", "Integrator", "Motion", "Scheme"]
