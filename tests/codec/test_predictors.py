"""The contract of every predictor that is fitted to two samples, and the geometry that each fit must recover."""

from math import inf, nan

import pytest
from hypothesis import assume, given, strategies as st

from tests.codec.law import FITTED
from tests.examples import examples
from weberlink.codec.predictors import PREDICTORS, FitLimits, FittedPredictor
from weberlink.codec.predictors.contract import Hold
from weberlink.codec.predictors.geometry_based import MISFIT, Plane, Sphere
from weberlink.codec.sample import Sample
from weberlink.geometry.vector import ZERO, Vector, add, distance, dot, norm, scale, subtract, unit

LIMITS = FitLimits()
FITS = {name: each for name, each in PREDICTORS.items() if isinstance(each, FittedPredictor)}
coordinates = st.floats(-0.1, 0.1)
vectors = st.tuples(coordinates, coordinates, coordinates)
wild = st.floats(-1e300, 1e300) | st.sampled_from([0.0, 5e-324, 1e-300, 1e300, nan, inf])
wild_vectors = st.tuples(wild, wild, wild)
every = pytest.mark.parametrize("name", FITTED)


def wall(position: Vector, normal: Vector, offset: float, stiffness: float) -> Vector:
    return scale(normal, -stiffness * min(0.0, dot(normal, position) + offset))


def ball(position: Vector, centre: Vector, radius: float, stiffness: float) -> Vector:
    """Convex for radius > 0, a cavity for radius < 0."""
    offset = subtract(position, centre)
    length = norm(offset)
    depth = max(0.0, radius - length) if radius > 0.0 else -max(0.0, length + radius)
    return scale(offset, stiffness * depth / length)


@every
@given(newest=wild_vectors, previous=wild_vectors, p1=wild_vectors, p2=wild_vectors, gap=st.integers(0, 65_535))
@examples(100)
def test_no_samples_make_a_fit_or_a_prediction_raise(
    name: str, newest: Vector, previous: Vector, p1: Vector, p2: Vector, gap: int
) -> None:
    model = FITS[name].model(Sample(gap, newest, p1), Sample(0, previous, p2), LIMITS)
    model.at(gap + 1, p2)


@every
@given(forces=st.tuples(vectors, vectors), positions=st.tuples(vectors, vectors), gap=st.integers(1, 1000))
@examples(80)
def test_every_model_passes_through_its_newest_sample(
    name: str, forces: tuple[Vector, Vector], positions: tuple[Vector, Vector], gap: int
) -> None:
    """Except the sphere, which two samples over-determine: it passes near the newest one."""
    newest, previous = (
        Sample(gap, scale(forces[0], 50.0), positions[0]),
        Sample(0, scale(forces[1], 50.0), positions[1]),
    )
    model = FITS[name].model(newest, previous, LIMITS)
    allowed = MISFIT * norm(newest.value) if isinstance(model, Sphere) else 1e-9 + 1e-9 * 1e6 * 0.2
    assert distance(model.at(gap, newest.position), newest.value) <= allowed


def test_linear_continues_a_ramp() -> None:
    model = FITS["linear"].model(Sample(20, (0.0, 0.0, 2.0), ZERO), Sample(10, (0.0, 0.0, 1.0), ZERO), LIMITS)
    assert model.at(25.5, ZERO) == pytest.approx((0.0, 0.0, 2.55))


@given(
    normal=vectors.filter(lambda v: norm(v) > 0.01), offset=st.floats(-0.05, 0.05), stiffness=st.floats(10.0, 1e5),
    depths=st.tuples(st.floats(1e-4, 0.02), st.floats(1e-4, 0.02)).filter(lambda d: abs(d[0] - d[1]) > 1e-4),
    slide=vectors, somewhere=vectors,
)  # fmt: skip
@examples(80)
def test_plane_recovers_a_wall_from_two_samples(
    normal: Vector, offset: float, stiffness: float, depths: tuple[float, float], slide: Vector, somewhere: Vector
) -> None:
    n = unit(normal)
    surface = scale(n, -offset)
    along = subtract(slide, scale(n, dot(n, slide)))
    p1, p2 = subtract(surface, scale(n, depths[0])), add(subtract(surface, scale(n, depths[1])), along)
    model = FITS["plane"].model(
        Sample(1, wall(p1, n, offset, stiffness), p1), Sample(0, wall(p2, n, offset, stiffness), p2), LIMITS
    )
    assert isinstance(model, Plane)
    assert distance(model.at(2, somewhere), wall(somewhere, n, offset, stiffness)) <= 1e-6 * stiffness * 0.2


@given(
    centre=vectors, radius=st.floats(0.01, 0.1), concave=st.booleans(), stiffness=st.floats(10.0, 1e4),
    directions=st.tuples(vectors, vectors).filter(lambda d: min(norm(d[0]), norm(d[1])) > 0.01),
    depths=st.tuples(st.floats(5e-4, 5e-3), st.floats(5e-4, 5e-3)), probe=vectors,
)  # fmt: skip
@examples(100)
def test_sphere_recovers_a_dome_and_a_cavity_from_two_samples(
    centre: Vector, radius: float, concave: bool, stiffness: float, directions: tuple[Vector, Vector],
    depths: tuple[float, float], probe: Vector,
) -> None:  # fmt: skip
    u1, u2 = unit(directions[0]), unit(directions[1])
    assume(abs(dot(u1, u2)) <= 0.98 and abs(depths[0] - depths[1]) >= 1e-4)
    sign = 1.0 if concave else -1.0
    p1 = add(centre, scale(u1, radius + sign * depths[0]))
    p2 = add(centre, scale(u2, radius + sign * depths[1]))
    signed = -radius if concave else radius
    samples = (Sample(1, ball(p1, centre, signed, stiffness), p1), Sample(0, ball(p2, centre, signed, stiffness), p2))
    model = FITS["sphere"].model(*samples, LIMITS)
    assert isinstance(model, Sphere)
    assert model.radius == pytest.approx(signed, rel=1e-5)
    assert model.stiffness == pytest.approx(stiffness, rel=1e-5)
    assert distance(model.centre, centre) <= 1e-6
    for limits in (FitLimits(radius=(1e-3, 0.5 * radius)), FitLimits(stiffness=(1.0, 0.5 * stiffness))):
        assert isinstance(FITS["sphere"].model(*samples, limits), Hold)
    if distance(probe, centre) > 1e-3:
        assert distance(model.at(2, probe), ball(probe, centre, signed, stiffness)) <= 1e-4 * stiffness * 0.2


def test_at_its_centre_a_sphere_gives_the_newest_force() -> None:
    assert Sphere((0.0, 0.0, 0.0), 0.05, 100.0, (0.0, 0.0, 1.0)).at(0, ZERO) == (0.0, 0.0, 1.0)


@pytest.mark.parametrize(
    ("name", "newest", "previous", "why"),
    [
        ("plane", ((0, 0, 2.0), (0, 0, -0.001)), ((0, 0, 1.0), (0, 0, -0.002)), "softer when deeper: c < 0"),
        ("plane", ((0, 0, 2.0), (0, 0, -0.002)), ((0, 0, 2.0), (0, 0, -0.001)), "no change of force"),
        ("plane", ((0, 0, 2.0), (0, 0, -0.001)), ((0, 0, 1.0), (0, 0, -0.001)), "no change of depth"),
        ("plane", ((0, 0, 2.0), (0, 0, -2e-7)), ((0, 0, 1.0), (0, 0, -1e-7)), "stiffer than the range"),
        ("plane", ((0, 0, 2.0), (0, 0, -0.002)), ((0, 0, 0.0), (0, 0, 0.001)), "the sample before was free"),
        ("sphere", ((0, 0, 2.0), (0, 0, -0.002)), ((0, 0, 1.0), (0, 0, -0.001)), "parallel forces"),
        ("sphere", ((0, 0, 2.0), (0, 0, -0.002)), ((0, 0, -1.0), (0, 0, -0.001)), "opposite forces"),
        ("sphere", ((7.65, 0, 10.2), (-0.00153, 0, -0.00204)), ((6.0, 0, 8.0), (-0.0012, 0, -0.0016)), "parallel"),
        ("sphere", ((1.2, 0, 10.0), (0, 0, -0.002)), ((1.0, 0, 8.34), (0, 0, -0.001)), "parallel but for the wire"),
        (
            "sphere",
            ((0.081, 0.048, 2.858), (-0.000088, -0.000082, -0.00549)),
            ((0.071, 0.040, 2.539), (-0.000068, -0.000068, -0.00472)),
            "deeper than the centre: it would pull",
        ),
        (
            "sphere",
            ((0.154, 0.522, 2.909), (-0.011818, -0.007414, -0.00515)),
            ((0.152, 0.287, 2.943), (-0.00814, -0.005552, -0.00562)),
            "no sphere touches both",
        ),
        ("sphere", ((0, 0, 2.0), (0, 0, 0)), ((0, 2.0, 0), (0, 0, 0)), "equal magnitudes: dependent columns"),
        ("sphere", ((0, 0, 2.0), (0, 0, 0)), ((0, 0, 0), (0, 0, 0)), "the sample before was free"),
    ],
)
def test_a_model_that_cannot_be_trusted_holds(
    name: str, newest: tuple[Vector, Vector], previous: tuple[Vector, Vector], why: str
) -> None:
    model = FITS[name].model(Sample(1, *newest), Sample(0, *previous), LIMITS)
    assert model == Hold(newest[0]), why
