"""A learned path: its closed form, its bounds, and its way over the wire."""

from math import isfinite

import pytest
from hypothesis import assume, given, strategies as st

from tests.codec.law import make_channel
from tests.examples import examples
from weberlink.codec import Channel, force_channel
from weberlink.codec.predictors import FitLimits
from weberlink.codec.predictors.contract import Hold, ModelKind
from weberlink.codec.sample import Sample
from weberlink.geometry.vector import ZERO, Vector, add, distance, dot, is_finite, norm
from weberlink.update import MOST_PARAMETER_BYTES, ModelParameters
from weberlink_predictors.parameters import pack
from weberlink_predictors.path import ELASTIC, HORIZONS, Path, horizons_of

NEWEST = Sample(10, (0.0, 0.0, 2.0), (0.0, 0.0, -0.004))
CHANNELS = [("path", False), ("elastic", False), ("path", True)]
coordinates = st.floats(-1e3, 1e3)
vectors = st.tuples(coordinates, coordinates, coordinates)
levels = st.tuples(*[st.integers(-32_767, 32_767)] * 6)
parameters = st.binary(max_size=MOST_PARAMETER_BYTES)


# The closed form.


def test_it_is_straight_between_its_knots_and_held_after_the_last() -> None:
    model = Path(NEWEST, (4, 8), ((0.0, 0.4, 0.0), (0.2, 0.0, -1.0)))
    expected = {10: (0.0, 0.0, 2.0), 12: (0.0, 0.2, 2.0), 14: (0.0, 0.4, 2.0), 15.0: (0.05, 0.3, 1.75)}
    for tick, value in (expected | dict.fromkeys((18, 19, 1e9), (0.2, 0.0, 1.0))).items():
        assert model.at(tick, (5.0, -7.0, 1.0)) == pytest.approx(value)
    assert model.at(3, ZERO) == NEWEST.value
    assert model.surface() is None
    assert model.record().kind is ModelKind.LINE


def test_elastic_adds_the_motion_of_the_hand() -> None:
    model = Path(NEWEST, (4,), ((0.1, 0.0, 0.0),), stiffness=(-100.0, -400.0))
    assert model.at(10, NEWEST.position) == NEWEST.value
    assert model.at(14, add(NEWEST.position, (1e-3, 2e-3, -1e-3))) == pytest.approx((0.0, -0.2, 2.5))
    assert model.surface() is None


@given(
    newest=vectors.filter(lambda v: norm(v) > 1e-3),
    path=st.lists(vectors, max_size=5),
    stiffness=st.tuples(coordinates, coordinates),
    ahead=st.floats(0.0, 1e6),
    moved=vectors,
)
def test_elastic_never_pulls(
    newest: Vector, path: list[Vector], stiffness: tuple[float, float], ahead: float, moved: Vector
) -> None:
    model = Path(Sample(0, newest, ZERO), horizons_of(1e-3)[: len(path)], tuple(path), stiffness=stiffness)
    shown = model.at(ahead, moved)
    if stiffness != (0.0, 0.0):
        assert dot(shown, newest) >= -1e-9 * norm(newest) * (1.0 + norm(shown) + 1e6 * norm(moved))


# The wire.


def unpacked(channel: Channel, sample: Sample, data: bytes) -> Path | None:
    model = channel.predictors[0].decode(ModelParameters(data), sample, channel.grid, channel.fit_limits)
    assert isinstance(model, Path | Hold)
    return model if isinstance(model, Path) else None


@pytest.mark.parametrize("axes", ["z", "xz", "xyz"])
@pytest.mark.parametrize(("name", "position"), CHANNELS)
@given(newest=levels, data=parameters, ahead=st.floats(0.0, 1e7), moved=vectors)
@examples(60)
def test_any_bytes_are_refused_or_a_bounded_path(
    name: str, position: bool, axes: str, newest: tuple[int, ...], data: bytes, ahead: float, moved: Vector
) -> None:
    channel = make_channel(name, position=position, axes=axes)
    sample = channel.grid.sample(7, newest[: channel.grid.size])
    try:
        model = unpacked(channel, sample, data)
    except ValueError as error:
        assert "bytes" in str(error)
        return
    if model is None:
        return
    assert list(model.knots) == sorted(set(model.knots))
    most = len(HORIZONS) + (1 + 7 if model.known else 0)  # after look-ahead a knot at 0, and seven at known ticks
    assert len(model.knots) == len(model.displacements) <= most
    assert all(map(is_finite, model.displacements))
    assert all(map(isfinite, model.stiffness))
    assert max(abs(model.stiffness[0]), abs(sum(model.stiffness))) <= channel.fit_limits.stiffness[1]
    shown = model.at(7 + ahead, moved)
    assert is_finite(channel.displayable(shown, sample))
    if name == "path":
        assert distance(shown, sample.value) <= max(map(norm, model.displacements), default=0.0) * (1.0 + 1e-9)
        last = model.knots[-1] if model.knots else 0
        assert model.at(7 + last + ahead, moved) == model.at(7 + last, moved)


@st.composite
def known_paths(draw: st.DrawFn, axes: int) -> bytes:
    """Fields of a path of a sender that looked ahead, which random bytes seldom are; its first knot is at 0."""
    known, inner, count = draw(st.integers(1, 127)), draw(st.integers(0, 7)), draw(st.integers(0, len(HORIZONS)))
    width, exponent = draw(st.integers(1, 15)), draw(st.integers(0, 63))
    chords = sorted(draw(st.sets(st.integers(1, known), max_size=min(inner, known))))
    size = axes * (1 + len(chords) + count)
    numbers = draw(st.lists(st.integers(0, 2**width - 1), min_size=size, max_size=size))
    fields = [7, width, exponent, known, len(chords), count, *chords, *numbers]
    widths = [3, 4, 6, 7, 3, 3, *[7] * len(chords), *[width] * size]
    assume(sum(widths) <= 8 * MOST_PARAMETER_BYTES)
    return pack(fields, widths)


@pytest.mark.parametrize("axes", ["z", "xz", "xyz"])
@pytest.mark.parametrize("position", [False, True])
@given(newest=levels, data=st.data(), before=st.floats(0.0, 1e7))
@examples(40)
def test_before_its_sample_a_path_is_where_it_begins(
    position: bool, axes: str, newest: tuple[int, ...], data: st.DataObject, before: float
) -> None:
    """A peer may send a sample of a tick that is still to come."""
    channel = make_channel("path", position=position, axes=axes)
    sample = channel.grid.sample(7, newest[: channel.grid.size])
    packed = data.draw(known_paths(len(axes)))
    model = unpacked(channel, sample, packed)
    assert model is not None
    assert model.knots[0] == 0
    assert model.at(7 - before, ZERO) == model.at(7, ZERO) == model.first(sample)


@given(data=parameters, newest=levels, bits=st.integers(0, 2**16 - 1))
def test_bytes_that_begin_as_a_model_are_refused_or_a_model(data: bytes, newest: tuple[int, ...], bits: int) -> None:
    """A head of 1 to 5 knots, which random bytes seldom are."""
    for name in ("path", "elastic"):
        channel = force_channel(predictor=name, axes="z")
        knots, width = 1 + bits % 5, 1 + bits // 5 % 15
        head = (knots << 13 | width << 9 | (bits >> 10) << 3).to_bytes(2, "big")
        sample = channel.grid.sample(7, newest[:2])
        longest = -(-(13 + knots * width + 22 * (name == "elastic")) // 8)
        body = data[: longest - 2]
        model = unpacked(channel, sample, head + body)
        assert model is None or len(model.knots) == knots
        assert model is not None or name == "elastic"
        with pytest.raises(ValueError, match="bytes"):
            unpacked(channel, sample, head + bytes(longest - 1))


@pytest.mark.parametrize(("along", "normal", "accepted"), [(0.0, -1e4, True), (-1e5, 0.0, False), (0.0, 0.0, False)])
def test_a_stiffness_that_is_none_or_beyond_the_limits_is_held(along: float, normal: float, accepted: bool) -> None:
    channel = make_channel("elastic", fit_limits=FitLimits(stiffness=(1.0, 2e4)))
    model = Path(NEWEST, (), (), stiffness=(along, normal))
    packed = ELASTIC.packed(model, NEWEST, channel.grid)
    found = unpacked(channel, NEWEST, packed.data)
    assert (found is not None) == accepted
    assert unpacked(channel, NEWEST._replace(value=ZERO), packed.data) is None
    if found is not None:
        assert found.stiffness == pytest.approx((along, normal), rel=2.0**-7)
