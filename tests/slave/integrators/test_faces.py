import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from weberlink.geometry.vector import Vector, dot, unit
from weberlink.slave.integrators.linear_contact import Faces
from weberlink.slave.scenes.active_set import smallest_push

directions = st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda n: dot(n, n) > 0.1).map(unit)
points = st.tuples(*[st.floats(-0.01, 0.01)] * 3)


@given(st.lists(directions, min_size=1, max_size=4), st.lists(st.floats(0.0, 0.005), min_size=4, max_size=4), points)
def test_the_depths_are_those_of_the_smallest_push(normals: list[Vector], offsets: list[float], x: Vector) -> None:
    faces = Faces(normals, offsets[: len(normals)])
    gaps = [dot(n, x) + offset for n, offset in zip(normals, offsets, strict=False)]
    pushes = {i: depth for i, depth in smallest_push([-gap for gap in gaps], normals) if depth > 0.0}
    assert faces.active(x) == set(pushes)
    face = faces.face(frozenset(pushes))
    assert face is not None
    for depth in face.depths:
        assert depth.of(x) == pytest.approx(pushes[depth.plane], rel=1e-6, abs=1e-12)


@given(st.lists(directions, min_size=2, max_size=4), points)
def test_no_depth_knows_of_another_and_no_gap_of_any(normals: list[Vector], x: Vector) -> None:
    """Moving the probe along one active normal changes that depth alone; the proxy, and so the gaps, stay."""
    active = frozenset(range(min(2, len(normals))))
    assume(abs(dot(normals[0], normals[1])) < 0.99)
    face = Faces(normals, [0.0] * len(normals)).face(active)
    assert face is not None
    for moved in active:
        for depth in face.depths:
            assert dot(depth.vector, normals[moved]) == pytest.approx(-1.0 if depth.plane == moved else 0.0, abs=1e-9)
        for gap in face.gaps:
            assert dot(gap.vector, normals[moved]) == pytest.approx(0.0, abs=1e-9)


def test_planes_that_the_proxy_cannot_reach_are_not_looked_for() -> None:
    up: Vector = (0.0, 0.0, 1.0)
    faces = Faces([up, up, (0.0, 0.0, -1.0), (1.0, 0.0, 0.0)], [0.0, 0.001, 0.1, 0.0])
    face = faces.face(frozenset([0]))
    assert face is not None
    assert [gap.plane for gap in face.gaps] == [3]
    assert faces.face(frozenset([0, 1])) is None
    assert faces.face(frozenset([0, 1, 2, 3])) is None
