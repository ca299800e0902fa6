"""Model parameters as bytes: fields, number formats, and their use by the estimated predictors."""

from contextlib import nullcontext
from math import inf, isfinite, nan
from typing import Any

import pytest
from hypothesis import given, strategies as st

from tests.examples import examples
from weberlink.codec import force_channel
from weberlink.codec.predictors import PREDICTORS
from weberlink.codec.sample import Sample
from weberlink.geometry.vector import ZERO, unit
from weberlink_predictors.affine import Affine
from weberlink_predictors.parameters import EXPONENT_BITS, Block, Float, Uniform, pack, unpack
from weberlink_predictors.path import Path
from weberlink_predictors.surface import SurfacePatch

LARGEST_EXPONENT = 2**EXPONENT_BITS - 1
widths_of_fields = st.lists(st.integers(1, 20), max_size=10)


@given(data=st.data(), widths=widths_of_fields)
def test_fields_come_back_and_zeros_at_the_end_take_no_bytes(data: st.DataObject, widths: list[int]) -> None:
    values = [data.draw(st.integers(0, 2**width - 1)) for width in widths]
    packed = pack(values, widths)
    assert unpack(packed, widths) == unpack(packed, [*widths, 8])[:-1] == values
    used = max((number for number, value in enumerate(values, 1) if value), default=0)
    assert len(packed) <= -(-sum(widths[:used]) // 8)
    with pytest.raises(ValueError, match="zip"):
        pack([*values, 1], widths)


@given(data=st.binary(max_size=20), widths=widths_of_fields)
def test_any_bytes_are_fields_within_their_widths_and_too_many_are_refused(data: bytes, widths: list[int]) -> None:
    size = -(-sum(widths) // 8)
    with nullcontext() if len(data) <= size else pytest.raises(ValueError, match=f"{len(data)} bytes"):
        values = unpack(data, widths)
        assert all(0 <= value < 2**width for value, width in zip(values, widths, strict=True))


# Number formats.

blocks = st.builds(Block, st.floats(1e-9, 1e3), st.integers(2, 16), st.integers(1, 9))
floats = st.builds(Float, st.floats(1e-12, 10.0), st.integers(1, 6), st.integers(0, 10), st.booleans())
uniforms = st.builds(Uniform, st.floats(-10.0, 10.0), st.floats(1e-6, 1.0), st.integers(1, 16))


@given(block=blocks, data=st.data())
@examples(50)
def test_a_block_rounds_towards_zero_by_less_than_a_digit(block: Block, data: st.DataObject) -> None:
    top = 2 ** (block.width - 1) - 1
    most = block.unit * top * 2.0**LARGEST_EXPONENT
    numbers = [data.draw(st.floats(-most, most)) for _ in range(block.size)]
    levels = block.levels(numbers)
    assert len(levels) == len(block.widths) == 1 + block.size
    assert all(0 <= level < 2**width for level, width in zip(levels, block.widths, strict=True))
    digit = block.unit * 2.0 ** levels[0]
    for number, decoded in zip(numbers, block.numbers(levels), strict=True):
        assert abs(decoded) <= abs(number) * (1.0 + 1e-12)  # a quotient just below a whole number may be rounded to it
        assert decoded * number >= 0.0
        assert abs(number - decoded) <= digit * (1.0 + 1e-9)
    assert digit <= max(block.unit, 2.0 * max(map(abs, numbers)) / (top + 1) * (1.0 + 1e-9))
    for sign in (1.0, -1.0):
        assert block.numbers(block.levels([sign * 2.0 * most] * block.size)) == [sign * most] * block.size


@given(unit=st.integers(-30, 10), block=blocks, data=st.data())
@examples(50)
def test_decoded_blocks_are_fixed_points(unit: int, block: Block, data: st.DataObject) -> None:
    """If the unit is a power of two; otherwise a quotient may be rounded below its digit."""
    block, top = block._replace(unit=2.0**unit), 2 ** (block.width - 1) - 1
    digits = [data.draw(st.integers(-top, top)) % 2**block.width for _ in range(block.size)]
    numbers = block.numbers([data.draw(st.integers(0, LARGEST_EXPONENT)), *digits])
    assert all(isfinite(number) for number in numbers)
    assert block.numbers(block.levels(numbers)) == numbers


def test_the_levels_of_a_block() -> None:
    block = Block(0.5, 8, 3)
    assert block.numbers(block.levels([0.49, -0.0, 0.5])) == [0.0, 0.0, 0.5]
    assert block.levels([63.5, -63.5, 0.0]) == [0, 127, 129, 0]
    assert block.levels([64.0, -0.9, 0.0]) == [1, 64, 0, 0]


@given(form=floats, data=st.data())
def test_a_float_has_a_bounded_relative_error_and_fixed_points(form: Float, data: st.DataObject) -> None:
    most = form.low * 2.0 ** (2**form.octaves - 1) * (2.0 - 2.0**-form.digits)
    magnitude = data.draw(st.floats(form.low, most))
    number = magnitude * (data.draw(st.sampled_from([-1.0, 1.0])) if form.signed else 1.0)
    level = form.level(number)
    assert 0 <= level < 2**form.width
    least = 0.0
    if form.signed and magnitude < form.low * (1.0 + 2.0 ** -(form.digits + 1)) and number > 0.0:
        # The smallest positive number would have the level of 0: it is encoded as the next.
        least = 2.0**-form.digits
    assert abs(form.number(level) / number - 1.0) <= max(least, 2.0 ** -(form.digits + 1)) * (1.0 + 1e-9)
    any_level = data.draw(st.integers(0, 2**form.width - 1))
    assert form.number(form.level(form.number(any_level))) == form.number(any_level)
    below = form.number(form.level(data.draw(st.floats(0.0, 1.0, exclude_max=True)) * form.low))
    assert below == (0.0 if form.signed else form.low)


def test_the_levels_of_a_float() -> None:
    form, signed = Float(2.0, 2, 1), Float(2.0, 1, 1, signed=True)
    assert [form.number(level) for level in range(8)] == [2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0, 24.0]
    assert [form.level(number) for number in (2.0, 2.4, 2.6, 3.6, 19.0, 21.0, inf)] == [0, 0, 1, 2, 6, 7, 7]
    assert [signed.number(level) for level in range(8)] == [0.0, -2.0, 3.0, -3.0, 4.0, -4.0, 6.0, -6.0]
    levels = [signed.level(number) for number in (0.0, -2.0, 2.0, 3.0, -6.0, 1e300, -inf, nan)]
    assert levels == [0, 1, 2, 2, 7, 6, 7, 0]


@given(form=uniforms, number=st.floats(-1e300, 1e300))
def test_a_uniform_number_is_within_half_a_step_or_saturated(form: Uniform, number: float) -> None:
    level, most = form.level(number), form.low + form.step * (2**form.width - 1)
    assert 0 <= level < 2**form.width
    assert abs(form.number(level) - min(max(number, form.low), most)) <= 0.5 * form.step * (1.0 + 1e-6) + 1e-12


NEWEST = Sample(9, (0.0, 0.0, 2.0), (0.0, 0.0, -0.004))
OBLIQUE = unit((1.0, -2.0, 3.0))
MOVING = SurfacePatch(OBLIQUE, ZERO, 9, 700.0, 20.0, 0.3, 3e-5, -4e-7, 6e-3)
DAMPED = SurfacePatch(OBLIQUE, ZERO, 9, 700.0, -20.0, 0.3, damping=300.0, rate=-2e-4)
PATH = Path(NEWEST, (4, 8), ((0.01, -0.02, 0.0), (0.2, 0.0, -1.0)))
ELASTIC = Path(NEWEST, (4,), ((0.1, 0.0, -0.05),), stiffness=(-100.0, -400.0))
FIELD = ((-300.0, 50.0, 20.0), (40.0, -500.0, 10.0), (-20.0, 30.0, -400.0))
AFFINE = Affine(NEWEST.value, NEWEST.position, 9, FIELD, (0.01, -0.02, 0.03))


@pytest.mark.parametrize(
    ("predictor", "model", "axes", "data"),
    [
        ("surface", MOVING, "xyz", "5127773695eaf44cb789463120"), ("surface", DAMPED, "xyz", "d127773695eaf64ce3a82c"),
        ("surface", MOVING, "xz", "5173a57abd132de2518c"), ("surface", MOVING, "z", "495eb7894631"),
        ("path", PATH, "xyz", "56040a7d900264400030"), ("elastic", ELASTIC, "xyz", "3007240273018020"),
        ("affine", AFFINE, "xyz", "3680401835800fe826024a160780"),
    ],
)  # fmt: skip
def test_a_model_has_the_bytes_of_the_protocol(predictor: str, model: Any, axes: str, data: str) -> None:
    """Another format of a number needs another version of the protocol."""
    grid = force_channel(predictor=predictor, axes=axes).grid
    assert PREDICTORS[predictor].packed(model, NEWEST, grid).data.hex() == data  # type: ignore[attr-defined]
