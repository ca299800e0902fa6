from math import sqrt

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.slave.integrators.problems import ball, wall
from weberlink.slave.integrators import INTEGRATORS, ControlledMass
from weberlink.slave.integrators.choice import FEW, chosen
from weberlink.slave.scenes.contact import FrictionCone

TICK = 0.001
CONE = FrictionCone(0.5, 0.4)


def body(mass: float, stiffness: float = 2e4) -> ControlledMass:
    return ControlledMass(mass, stiffness, 2.0 * sqrt(stiffness * mass))


def test_auto_is_exact_for_flat_contact() -> None:
    assert chosen(body(0.2), wall(500.0, 1.0), TICK)[:2] == ("exact", 1)
    assert chosen(body(1e-3), wall(1e7), TICK)[:2] == ("exact", 1)
    assert chosen(body(0.2), None, TICK) == ("exact", 1, "no contact")


def test_what_few_substeps_resolve_gets_them() -> None:
    assert chosen(body(1.0, 500.0), ball(500.0), TICK)[:2] == ("semi_implicit", 1)
    assert chosen(body(0.2), ball(1e5), TICK)[:2] == ("semi_implicit", 4)  # 1 ms sqrt(1.2e5 / 0.2) / 0.2 = 3.9
    assert chosen(body(0.2), wall(1e5, None, CONE), TICK)[:2] == ("semi_implicit", 4)


@pytest.mark.parametrize(
    ("mass", "stiffness", "substeps", "told"),
    [
        (1e-4, 1e7, None, r"^integrator: semi_implicit is unstable in 64 .* expected integrator: auto"),
        (0.1, 1e6, 1, r"^integrator: semi_implicit is unstable in 1 .* expected substeps: 16, or integrator: auto"),
    ],
)
def test_unstable_named_scheme_is_refused(mass: float, stiffness: float, substeps: int | None, told: str) -> None:
    with pytest.raises(ValueError, match=told):
        chosen(body(mass), wall(stiffness), TICK, "semi_implicit", substeps)


@given(
    st.floats(1e-4, 1000.0),
    st.floats(1.0, 1e7),
    st.floats(1.0, 1e7),
    st.one_of(st.none(), st.floats(0.0, 1e4)),
    st.floats(1e-4, 1e-2),
    st.booleans(),
)
def test_auto_is_always_stable_in_few_steps(
    mass: float, control: float, stiffness: float, damping: float | None, tick: float, flat: bool
) -> None:
    scene = wall(stiffness, damping) if flat else ball(stiffness, damping)
    name, substeps, reason = chosen(body(mass, control), scene, tick)
    assert 1 <= substeps <= FEW
    assert reason
    if not INTEGRATORS[name].l_stable:
        step, held = tick / substeps, body(mass, control)
        b = (control + stiffness) * step**2 / mass
        a = (held.damping + (damping or 0.0)) * step / mass
        assert max(sqrt(b), a) <= 0.2 * (1.0 + 1e-9)
