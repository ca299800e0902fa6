"""The codec in extreme cases: a table of signals with their expected results, and what no peer can make it display."""

from collections.abc import Callable, Sequence
from functools import partial
from math import cos, inf, nan, sin
from sys import float_info
from typing import Any, NamedTuple

import pytest
from hypothesis import given, strategies as st

from tests.codec.law import FORCE_PREDICTORS, Law, make_channel
from tests.codec.signals import up
from tests.examples import examples
from weberlink.codec import Channel, Decoder, Update, force_channel
from weberlink.codec.choice import CHOICES
from weberlink.codec.predictors import PREDICTORS
from weberlink.codec.sample import INT16_MAX, Quantizer
from weberlink.geometry.vector import ZERO, Vector, is_finite, scale
from weberlink.update import ModelParameters, Payload, PreviousSample

Samples = Sequence[tuple[int, Vector, Vector]]
"""Tick, force [N] (position [m] on a position channel), commanded position [m]."""

WEBER = 0.10
FULL = 1e-3 * INT16_MAX  # Range of a force on one axis [N]

NO_FLOOR = partial(force_channel, floor=0.0)


def exact(predictor: str, weber: float, axes: str = "xyz") -> Channel:
    value, position = (Quantizer(step, axes, largest_level=inf) for step in (1e-9, 1e-12))
    return make_channel(predictor, weber=weber, value_quantizer=value, position_quantizer=position)


class Case(NamedTuple):
    """A signal, and the expected result at k = 0.10."""

    name: str
    samples: Samples
    sent: int | dict[str, int]  # updates, by predictor or the same for all; a model that is used saves most of them
    decoded: Vector | None = None  # at the other end at the last sample; None if it depends on the predictor
    channel: Callable[..., Channel] = force_channel  # of a predictor
    rejected: int = 0  # samples that are not finite


def steady(value: Vector, position: Vector = ZERO) -> Samples:
    return [(tick, value, position) for tick in range(50)]


def at_rest(*forces: Vector) -> Samples:
    """A hand that does not move, one force a tick."""
    return [(tick, force, ZERO) for tick, force in enumerate(forces)]


def press(*, start: int = 0, force: float = 1.0) -> Samples:
    """At constant speed into a flat wall of 500 N/m, from 2 mm to 12 mm deep; forces are multiplied by `force`."""
    depths = [2e-3 + 5e-5 * tick for tick in range(200)]
    return [(start + tick, up(force * 500.0 * depth), up(-depth)) for tick, depth in enumerate(depths)]


def roll(radius: float) -> Samples:
    """Over the top of a ball of 500 N/m, from 2 mm to 4 mm deep."""
    samples = []
    for tick in range(200):
        angle = (0.02 - 2e-4 * tick) / radius
        depth = 2e-3 + 1e-5 * tick
        direction = (sin(angle), 0.0, cos(angle))
        x, _, z = scale(direction, radius - depth)
        samples.append((tick, scale(direction, 500.0 * depth), (x, 0.0, z - radius)))
    return samples


def oblique() -> Samples:
    """`press` from 10 N on, on a wall whose normal is (0.6, 0, 0.8)."""
    normal = (0.6, 0.0, 0.8)
    return [(tick, scale(normal, force[2]), scale(normal, position[2])) for tick, force, position in press(force=10.0)]


ON_A_WALL = {"zoh": 16, "linear": 2, "plane": 2, "sphere": 16, "hybrid": 3}
ON_A_BALL = {"zoh": 11, "linear": 4, "plane": 15, "sphere": 2, "hybrid": 3}
HOLES = [sample if sample[0] % 7 else (sample[0], up(nan), sample[2]) for sample in press()]
WRAP = 1 << 16

CASES = [
    # Nothing, almost nothing, far too much.
    Case("no force", steady(ZERO), 0, ZERO),
    Case("the largest number on every axis", steady((float_info.max,) * 3), 1, (FULL,) * 3),
    Case("1e300 N, off the wire", steady(up(1e300)), 1, up(1e141), exact),
    Case("from one end of the range to the other", at_rest(*[up(1e300), up(-1e300)] * 25), 50, up(-FULL)),
    Case("pressed 1e300 m aside", steady(up(1.0), (1e300, -1e300, 0.0)), 1, up(1.0)),
    # Not a number.
    Case("never a number", steady((nan, 0.0, 0.0)), 0, ZERO, rejected=50),
    Case("infinite after 1 N", at_rest(up(1.0), *[up(inf), up(-inf)] * 10), 1, up(1.0), rejected=20),
    Case("a ramp with holes", HOLES, ON_A_WALL, rejected=29),
    # The same again.
    Case("identical samples between two levels, without a floor", steady(up(0.0034)), 1, up(0.003), NO_FLOOR),
    Case("off by the floor exactly", steady(up(0.5)), 0, ZERO, partial(force_channel, floor=0.5)),
    # Time.
    Case("two forces at one time", [(i // 2, up(1.0 + i % 2), ZERO) for i in range(40)], 40, up(2.0)),
    Case("a ramp from tick 0 on", press(), ON_A_WALL),
    Case("the same ramp while 24 bits of tick wrap", press(start=WRAP - 100), ON_A_WALL),
    Case("65,535 ticks apart", [(0, up(1.0), ZERO), (65_535, up(2.0), ZERO)], 2, up(2.0)),
    Case("a ball of 50 mm", roll(0.05), ON_A_BALL),
    # The range of the wire.
    Case("a wall beyond the range", press(force=50.0), 1, up(FULL)),
    Case("a wall through the limit of the range", press(force=10.0), {**ON_A_WALL, "zoh": 11, "sphere": 11}),
    # The axis that saturates first turns the force, as a ball would.
    Case("an oblique wall through a corner of the range", oblique(), {**ON_A_WALL, "zoh": 15}),
]


@pytest.mark.parametrize("predictor", FORCE_PREDICTORS)
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_what_is_sent_and_decoded_under_the_law(case: Case, predictor: str) -> None:
    tick, _, position = case.samples[-1]
    is_tuned = predictor not in ON_A_WALL  # the number of its updates may change
    for weber, axes in ((WEBER, "xyz"), (0.0, "xyz"), (0.30, "z"))[: 1 if is_tuned else 3]:
        law = Law(case.channel(predictor=predictor, weber=weber, **({"axes": axes} if weber != WEBER else {})))
        coded = [law.tick(tick, (value, place)) for tick, value, place in case.samples]
        sent = sum(each is not None and each.update is not None for each in coded)
        if weber != WEBER or is_tuned:
            continue
        assert sent == (case.sent if isinstance(case.sent, int) else case.sent[predictor])
        assert law.encoder.rejected == case.rejected
        if case.decoded is not None:
            assert law.decoder.value(tick, position) == pytest.approx(case.decoded, rel=1e-12)


int16 = st.integers(-INT16_MAX - 1, INT16_MAX)
levels = st.sampled_from([-INT16_MAX - 1, -INT16_MAX, -1, 0, 1, INT16_MAX]) | int16
ticks = st.integers(0, 2**25) | st.integers(2**53 - 9, 2**53 + 9)
numbers = st.floats(allow_nan=True, allow_infinity=True)
axes_sets = st.sampled_from(["xyz", "xz", "z"])
bodies = st.tuples(*[levels] * 6), st.integers(0, 65_535), st.tuples(*[levels] * 6), st.binary(max_size=20)
LEAST_PARAMETERS = 2  # Every estimated predictor of one axis reads as many bytes of parameters
probes = st.lists(st.tuples(ticks | numbers, st.tuples(numbers, numbers, numbers)), min_size=1, max_size=5)


@pytest.mark.parametrize("of_force", [True, False])
@given(updates=st.lists(st.tuples(ticks, st.integers(0, 15), *bodies), max_size=5), probes=probes, axes=axes_sets)
@examples(80)
def test_no_peer_can_make_a_decoder_display_what_it_must_not(
    of_force: bool, updates: list[Any], probes: list[tuple[float, Vector]], axes: str
) -> None:
    """With any levels, gap, selector and time; an update that does not fit is refused and changes nothing."""
    choice = [*CHOICES][-1]
    bank = [name for name in PREDICTORS if of_force and CHOICES[choice].takes(PREDICTORS[name])] or None
    channel = make_channel(choice, position=not of_force, axes=axes, bank=bank)
    decoder, forms = Decoder(channel), channel.forms
    for tick, selector, newest, gap, previous, data in updates:
        form = forms[selector % len(forms)]
        payload: Payload = None
        if gap:
            payload = (
                ModelParameters(data) if form.previous is None else PreviousSample(gap, previous[: sum(form.previous)])
            )
        before = decoder.state
        try:
            decoder.apply(Update(tick, selector, newest[: sum(form.newest)], payload))
        except ValueError:
            assert selector >= len(channel.bank) or len(data) > LEAST_PARAMETERS
            assert repr(decoder.state) == repr(before)
        else:
            assert selector < len(channel.bank)
    for at, position in probes:
        shown = decoder.value(at, position)
        assert (shown is None and channel.rest is None) or (shown is not None and is_finite(shown))
        assert shown is None or channel.value_quantizer.confine(shown) == shown, "0 on unused axes and within range"
