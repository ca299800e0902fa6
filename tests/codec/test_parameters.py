"""Numbers as bits: what comes back of them, how wrong it is, and that there is room for all that is said."""

from math import inf, isfinite

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.codec.law import ESTIMATED
from tests.examples import examples
from weberlink.codec import force_channel, position_channel
from weberlink.codec.parameters import EXPONENT_BITS, Block, Float, Uniform, pack, unpack
from weberlink.codec.predictors import PREDICTORS
from weberlink.codec.predictors.model import Hold
from weberlink.protocol.wire import UpdateLayout
from weberlink.update import ModelParameters, Update, parameter_bits

finite = st.floats(-1e300, 1e300)
samples = st.tuples(*[st.integers(-(2**15), 2**15 - 1)] * 6)
LARGEST_EXPONENT = 2**EXPONENT_BITS - 1


@st.composite
def fields(draw: st.DrawFn) -> tuple[int, list[int], list[int]]:
    """Levels of a sample, widths that just fit or leave room, and a value of each width."""
    levels = draw(st.sampled_from([1, 2, 3, 4, 6]))
    widths: list[int] = []
    while sum(widths) < parameter_bits(levels) and draw(st.integers(0, 9)):
        widths.append(draw(st.integers(1, min(20, parameter_bits(levels) - sum(widths)))))
    return levels, widths, [draw(st.integers(0, 2**width - 1)) for width in widths]


@given(fields=fields())
def test_fields_come_back(fields: tuple[int, list[int], list[int]]) -> None:
    levels, widths, values = fields
    bits = pack(values, widths)
    assert 0 <= bits < 2 ** parameter_bits(levels)
    assert unpack(bits, widths) == values


@given(bits=st.integers(0, 2**111 - 1), widths=st.lists(st.integers(1, 20), max_size=10))
def test_any_bits_are_fields_within_their_widths(bits: int, widths: list[int]) -> None:
    values = unpack(bits, widths)
    assert all(0 <= value < 2**width for value, width in zip(values, widths, strict=True))


@pytest.mark.parametrize("axes", ["z", "xz", "xyz"])
@pytest.mark.parametrize("name", ESTIMATED)
def test_the_parameters_of_every_predictor_fit_into_an_update(name: str, axes: str) -> None:
    predictor = PREDICTORS[name]
    channels = [force_channel(predictor=name, axes=axes)]
    if not predictor.geometric:
        channels.append(position_channel(predictor=name, axes=axes))
    for channel in channels:
        size, widths = channel.grid.size, predictor.widths(channel.grid)
        assert min(widths) >= 1
        assert sum(widths) <= parameter_bits(size)
        for values in ([2**width - 1 for width in widths], [0] * len(widths)):
            UpdateLayout(size).check(Update(0, 0, (0,) * size, ModelParameters(pack(values, widths))))


@pytest.mark.parametrize("axes", ["z", "xz", "xyz"])
@pytest.mark.parametrize("name", ESTIMATED)
@given(newest=samples, bits=st.integers(0, 2**111 - 1))
@examples(40)
def test_any_bits_are_a_model_that_could_have_been_sent(
    name: str, axes: str, newest: tuple[int, ...], bits: int
) -> None:
    predictor, channel = PREDICTORS[name], force_channel(predictor=name, axes=axes)
    grid = channel.grid
    sample = grid.sample(100, newest[: grid.size])
    model = predictor.decode(ModelParameters(bits), sample, grid, channel.fit_limits)
    if not isinstance(model, Hold):
        widths, levels = predictor.widths(grid), predictor.levels(model, sample, grid)
        assert all(0 <= level < 2**width for level, width in zip(levels, widths, strict=True))


# Numbers.

blocks = st.builds(Block, st.floats(1e-9, 1e3), st.integers(2, 16), st.integers(1, 9))


@given(block=blocks, data=st.data())
@examples(50)
def test_a_block_is_towards_zero_and_off_by_less_than_a_digit_of_its_largest(block: Block, data: st.DataObject) -> None:
    top = 2 ** (block.width - 1) - 1
    most = block.unit * top * 2.0**LARGEST_EXPONENT
    numbers = [data.draw(st.floats(-most, most)) for _ in range(block.size)]
    levels = block.levels(numbers)
    assert len(levels) == len(block.widths) == 1 + block.size
    assert all(0 <= level < 2**width for level, width in zip(levels, block.widths, strict=True))
    digit = block.unit * 2.0 ** levels[0]
    for number, said in zip(numbers, block.numbers(levels), strict=True):
        assert abs(said) <= abs(number) * (1.0 + 1e-12)  # a quotient just below a whole number may be rounded to it
        assert said * number >= 0.0
        # A digit is saved where the largest number is the largest that can be said.
        assert abs(number - said) <= digit * (1.0 + 1e-9)
    largest = max(map(abs, numbers))
    assert digit <= max(block.unit, 2.0 * largest / (top + 1) * (1.0 + 1e-9))


@given(unit=st.integers(-30, 10), block=blocks, data=st.data())
@examples(50)
def test_what_a_block_says_it_says_again(unit: int, block: Block, data: st.DataObject) -> None:
    """Where the unit is a power of two; else a quotient may be rounded below the digit that it is."""
    block = block._replace(unit=2.0**unit)
    top = 2 ** (block.width - 1) - 1
    levels = [
        data.draw(st.integers(0, LARGEST_EXPONENT)),
        *(data.draw(st.integers(0, 2 * top)) for _ in range(block.size)),
    ]
    numbers = block.numbers(levels)
    assert all(isfinite(number) for number in numbers)
    assert block.numbers(block.levels(numbers)) == numbers


@given(block=blocks, number=st.floats(allow_nan=False, allow_infinity=False), sign=st.sampled_from([-1.0, 1.0]))
def test_a_block_saturates(block: Block, number: float, sign: float) -> None:
    top = 2 ** (block.width - 1) - 1
    most = block.unit * top * 2.0**LARGEST_EXPONENT
    said = block.numbers(block.levels([sign * max(abs(number), 2.0 * most)] * block.size))
    assert said == [sign * most] * block.size


def test_a_block_of_nothing_is_nothing() -> None:
    block = Block(0.5, 8, 3)
    assert block.numbers(block.levels([0.0, -0.0, 0.0])) == [0.0, 0.0, 0.0]
    assert block.numbers(block.levels([0.49, -0.49, 0.5])) == [0.0, 0.0, 0.5]
    assert block.levels([63.5, -63.5, 0.0]) == [0, 254, 0, 127]
    assert block.levels([64.0, -0.9, 0.0]) == [1, 127 + 64, 127, 127]


floats = st.builds(Float, st.floats(1e-12, 10.0), st.integers(1, 6), st.integers(0, 10), st.booleans())


@given(form=floats, data=st.data())
def test_a_float_is_off_by_a_share_of_itself(form: Float, data: st.DataObject) -> None:
    most = form.low * 2.0 ** (2**form.octaves - 1) * (2.0 - 2.0**-form.digits)
    magnitude = data.draw(st.floats(form.low, most))
    number = magnitude * (data.draw(st.sampled_from([-1.0, 1.0])) if form.signed else 1.0)
    level = form.level(number)
    assert 0 <= level < 2**form.width
    said = form.number(level)
    least = 0.0
    if form.signed and magnitude < form.low * (1.0 + 2.0 ** -(form.digits + 1)) and number > 0.0:
        # The smallest of a positive number would be the level of 0: it is said as the next.
        least = 2.0**-form.digits
    assert abs(said / number - 1.0) <= max(least, 2.0 ** -(form.digits + 1)) * (1.0 + 1e-9)


@given(form=floats, data=st.data())
def test_what_a_float_says_it_says_again(form: Float, data: st.DataObject) -> None:
    level = data.draw(st.integers(0, 2**form.width - 1))
    assert form.number(form.level(form.number(level))) == form.number(level)


@given(form=floats, number=st.floats(0.0, 1.0, exclude_max=True))
def test_below_its_least_a_float_is_nothing_or_the_least(form: Float, number: float) -> None:
    said = form.number(form.level(number * form.low))
    assert said == (0.0 if form.signed else form.low)


@pytest.mark.parametrize("number", [1e9, 1e300, inf])
def test_a_float_saturates(number: float) -> None:
    form = Float(1.0, 3, 2, signed=True)
    assert form.number(form.level(number)) == 128.0 * 1.75
    assert form.number(form.level(-number)) == -128.0 * 1.75
    assert Float(1.0, 3, 2).number(Float(1.0, 3, 2).level(number)) == 128.0 * 1.75
    assert form.level(float("nan")) == 0


def test_the_levels_of_a_float() -> None:
    form = Float(2.0, 2, 1)
    assert [form.number(level) for level in range(8)] == [2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0, 24.0]
    assert [form.level(number) for number in (2.0, 2.4, 2.6, 3.6, 19.0, 21.0)] == [0, 0, 1, 2, 6, 7]
    signed = Float(2.0, 1, 1, signed=True)
    assert [signed.number(level) for level in range(8)] == [0.0, -2.0, 3.0, -3.0, 4.0, -4.0, 6.0, -6.0]
    assert [signed.level(number) for number in (0.0, -2.0, 2.0, 3.0, -6.0)] == [0, 1, 2, 2, 7]


@given(form=st.builds(Uniform, st.floats(-10.0, 10.0), st.floats(1e-6, 1.0), st.integers(1, 16)), number=finite)
def test_a_uniform_number_is_within_half_a_step_or_saturated(form: Uniform, number: float) -> None:
    level, most = form.level(number), form.low + form.step * (2**form.width - 1)
    assert 0 <= level < 2**form.width
    nearest = min(max(number, form.low), most)
    assert abs(form.number(level) - nearest) <= 0.5 * form.step * (1.0 + 1e-6) + 1e-12
