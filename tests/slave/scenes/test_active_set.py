from math import cos, pi, sin, sqrt

from hypothesis import given
from hypothesis import strategies as st

from weberlink.geometry.vector import Vector, dot, norm
from weberlink.slave.scenes.active_set import displacement, smallest_push


@st.composite
def unit_vectors(draw: st.DrawFn) -> Vector:
    azimuth, height = draw(st.floats(-pi, pi)), draw(st.floats(-1.0, 1.0))
    ring = sqrt(1.0 - height * height)
    return (ring * cos(azimuth), ring * sin(azimuth), height)


component = st.floats(-0.01, 0.01)


@given(
    normals=st.lists(unit_vectors(), min_size=1, max_size=6),
    feasible=st.tuples(component, component, component),
    slack=st.lists(st.floats(0.0, 0.01), min_size=6, max_size=6),
)
def test_push_is_feasible_and_smallest(normals: list[Vector], feasible: Vector, slack: list[float]) -> None:
    """`feasible` meets every constraint by construction, so the smallest push exists and cannot be longer."""
    violations = [dot(normal, feasible) - slack[i] for i, normal in enumerate(normals)]
    pushes = smallest_push(violations, normals)
    push = displacement(pushes, normals)
    assert norm(push) <= norm(feasible) + 1e-9
    assert len(pushes) <= 3
    assert all(multiplier >= 0.0 for _, multiplier in pushes)
    for violation, normal in zip(violations, normals, strict=True):
        assert dot(normal, push) >= violation - 1e-6
