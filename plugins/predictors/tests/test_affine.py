"""A stiffness matrix and a drift: closed forms, the wire's rounding, and the sender's least squares."""

from collections.abc import Callable
from itertools import pairwise
from math import cos, sin
from random import Random

import pytest
from hypothesis import given, strategies as st

from tests.codec.law import make_channel
from tests.codec.signals import Stream
from tests.codec.test_coder import check_that_only_the_delay_is_left
from tests.examples import examples
from weberlink.codec import Decoder, Update, force_channel
from weberlink.codec.sample import Sample
from weberlink.geometry.vector import ZERO, Vector, distance, dot, norm, scale, unit
from weberlink_predictors.affine import AFFINE, SLOWEST, SOFTEST, WIDEST, Affine, LocalAffine
from weberlink_predictors.estimation import EncodeContext, History, Signal
from weberlink_predictors.parameters import components, vector_of

S = 800.0
coordinates = st.floats(-0.02, 0.02)
vectors = st.tuples(coordinates, coordinates, coordinates)
normals = vectors.filter(lambda v: norm(v) > 1e-3).map(unit)


def wall_matrix(normal: Vector, stiffness: float) -> tuple[Vector, Vector, Vector]:
    """-s n n^T."""
    x, y, z = (scale(normal, -stiffness * each) for each in normal)
    return (x, y, z)


@given(normal=normals, probe=vectors, depth=st.floats(1e-4, 0.02))
def test_with_the_matrix_of_a_wall_it_is_that_wall(normal: Vector, probe: Vector, depth: float) -> None:
    model = Affine(scale(normal, S * depth), scale(normal, -depth), 0, wall_matrix(normal, S), ZERO)
    expected = scale(normal, S * max(0.0, -dot(normal, probe)))
    assert distance(model.at(5, probe), expected) <= 1e-9


def test_it_is_the_sum_of_force_position_and_time() -> None:
    stiffness = ((-100.0, 20.0, 3.0), (40.0, -200.0, 5.0), (6.0, 10.0, -300.0))
    model = Affine((1.0, 2.0, 3.0), (0.1, 0.2, 0.3), 10, stiffness, (0.01, 0.02, -0.03))
    assert model.at(10, (0.1, 0.2, 0.3)) == (1.0, 2.0, 3.0)
    assert model.at(12.5, (0.1, 0.2, 0.3)) == pytest.approx((1.025, 2.05, 2.925))
    assert model.at(10, (0.101, 0.2, 0.3)) == pytest.approx((0.9, 2.04, 3.006))
    assert model.at(10, (0.1, 0.201, 0.301)) == pytest.approx((1.023, 1.805, 2.71))


def test_a_contact_does_not_pull_and_returns_gradually() -> None:
    model = Affine((0.0, 0.0, 1.0), ZERO, 0, wall_matrix((0.0, 0.0, 1.0), S), (0.0, 0.0, -0.1))
    assert model.at(0, (0.0, 0.0, 0.0012))[2] == pytest.approx(0.04)
    assert model.at(0, (0.0, 0.0, 0.0013)) == model.at(11, ZERO) == ZERO
    assert model.at(9, ZERO)[2] == pytest.approx(0.1)
    # A sideways stiffness that is only noise would push the probe aside when the contact returns.
    model = Affine((0.0, 0.0, 1.0), ZERO, 0, ((2000.0, 0.0, 0.0), (0.0, 2000.0, 0.0), (0.0, 0.0, -500.0)), ZERO)
    back = [model.at(1, (0.003, -0.002, 0.004 - 1e-6 * step)) for step in range(4000)]
    assert back[0] == ZERO
    assert max(norm(force) for force in back) > 1.0
    assert max(distance(one, other) for one, other in pairwise(back)) < 5e-3
    assert all(norm((x, y, 0.0)) <= WIDEST * z * (1.0 + 1e-12) for x, y, z in back)


@pytest.mark.parametrize("axes", ["z", "xz", "xyz"])
@given(elements=st.lists(st.floats(-4000.0, 4000.0), min_size=9, max_size=9), slope=vectors)
@examples(40)
def test_a_model_survives_the_wire_towards_zero(axes: str, elements: list[float], slope: Vector) -> None:
    """To one part in 64 of its largest element."""
    channel = force_channel(predictor="affine", axes=axes)
    grid, quantizer, decoder = channel.grid, channel.value_quantizer, Decoder(channel)
    kept = [float(axis in axes) for axis in "xyz"]
    rows = tuple(
        tuple(kept[row] * kept[column] * elements[3 * row + column] for column in range(3)) for row in range(3)
    )
    levels = tuple(range(1, 1 + grid.size))
    newest, drift = grid.sample(6, levels), vector_of(components(slope, quantizer), quantizer)
    model = Affine(newest.value, newest.position, 6, rows, drift)  # type: ignore[arg-type]
    decoder.apply(Update(6, 0, levels, AFFINE.packed(model, newest, grid)))
    decoded = decoder.model
    assert isinstance(decoded, Affine)
    assert (decoded.value, decoded.position, decoded.tick) == (newest.value, newest.position, 6)
    truth, found = ([element for row in matrix for element in row] for matrix in (rows, decoded.stiffness))
    digit = SOFTEST * quantizer.step / 1e-5
    for one, other in zip(found, truth, strict=True):
        assert abs(one) <= abs(other) + 1e-12
        assert abs(one - other) <= max(digit, max(map(abs, truth)) / 64.0) * (1.0 + 1e-9)
    for one, other in zip(decoded.slope, drift, strict=True):
        assert abs(one - other) <= max(SLOWEST * 1e-3, max(map(abs, drift)) / 64.0) * (1.0 + 1e-9)


@pytest.mark.parametrize(("stiffness", "accepted"), [(1e5, True), (1e7, False)])
def test_a_stiffness_beyond_the_limits_is_held(stiffness: float, accepted: bool) -> None:
    channel = force_channel(predictor="affine")
    newest = channel.grid.sample(0, (0, 0, 1000, 0, 0, 0))
    model = Affine(newest.value, ZERO, 0, wall_matrix((0.0, 0.0, 1.0), stiffness), ZERO)
    packed = AFFINE.packed(model, newest, channel.grid)
    decoded = AFFINE.decode(packed, newest, channel.grid, channel.fit_limits)
    assert isinstance(decoded, Affine) == accepted


# Least squares.


def estimated(stream: Stream, period: float = 1e-3) -> Affine | None:
    channel = make_channel("affine", tick_period=period)
    history = History(channel.tick_period)
    for tick, (force, position) in enumerate(stream):
        history.add(tick, force, position, 0.1)
    candidate = LocalAffine(Signal(channel.grid, channel.fit_limits, 0.04))
    return candidate.model(EncodeContext(Sample(len(stream) - 1, *stream[-1]), None, 0.1, history))


def tremor(tick: int) -> Vector:
    """Some millimetres that span all three axes within a few ticks."""
    return (1e-3 * sin(0.9 * tick), 1e-3 * cos(1.3 * tick), 1e-3 * sin(2.1 * tick + 1.0))


SKEW = ((-300.0, 50.0, 20.0), (40.0, -500.0, 10.0), (-20.0, 30.0, -400.0))
NORMAL = unit((0.3, -0.2, 0.9))


@pytest.mark.parametrize(
    ("stiffness", "force"),
    [
        (SKEW, lambda p: (1.0 + dot(SKEW[0], p), 2.0 + dot(SKEW[1], p), 5.0 + dot(SKEW[2], p))),
        (wall_matrix(NORMAL, S), lambda p: scale(NORMAL, S * (4e-3 - dot(NORMAL, p)))),
    ],
)
def test_it_recovers_an_affine_field(stiffness: tuple[Vector, ...], force: Callable[[Vector], Vector]) -> None:
    model = estimated([(force(tremor(tick)), tremor(tick)) for tick in range(40)])
    assert model is not None
    for row, truth in zip(model.stiffness, stiffness, strict=True):
        assert row == pytest.approx(truth, rel=1e-2, abs=2.0)
    assert model.slope == pytest.approx(ZERO, abs=1e-3)


def test_with_a_hand_at_rest_noise_is_no_stiffness() -> None:
    """The ridge corresponds to a motion of 10 um; without it, 2 mN over 1 um would be 2000 N/m."""
    random = Random(4)
    draws = [[random.gauss(0.0, 1.0) for _ in range(4)] for _ in range(40)]
    model = estimated([((2e-3 * a, 2e-3 * b, 1.0 + 2e-3 * c), (1e-6 * d, 0.0, 0.0)) for a, b, c, d in draws])
    assert model is not None
    assert max(norm(row) for row in model.stiffness) < 60.0


@pytest.mark.parametrize("per_tick", [1, 4])
def test_a_drift_in_time_alone_is_the_slope(per_tick: int) -> None:
    """Also in ticks of which it takes every so-manieth."""
    drift = [((0.0, 0.0, 1.0 + 0.01 * tick / per_tick), ZERO) for tick in range(40 * per_tick)]
    model = estimated(drift, 1e-3 / per_tick)
    assert model is not None
    # The ridge on time is 0.2, beside a mean square of time of about 1/3: the slope shrinks by about a third.
    assert 0.5 * 0.01 < model.slope[2] * per_tick < 0.01
    assert model.stiffness == (ZERO, ZERO, ZERO)
    assert estimated([(ZERO, ZERO)] * 2) is None
    assert estimated([(ZERO, ZERO)] * 3) is not None


@pytest.mark.parametrize("size", [1e-300, 1e150])
def test_extreme_samples_make_a_finite_model_or_none(size: float) -> None:
    model = estimated([(scale(tremor(tick), size * 1e3), scale(tremor(tick + 7), size * 1e3)) for tick in range(20)])
    assert model is None or all(abs(each) < 1e300 for row in model.stiffness for each in row)


def test_without_a_known_future_look_ahead_is_a_delay() -> None:
    check_that_only_the_delay_is_left("affine")
