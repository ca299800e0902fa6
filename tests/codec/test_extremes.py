"""The codec in extreme cases: a table of signals with their expected results, and laws that hold for all of them.

Every update passes through the wire layout, with a truncated tick, before the decoder gets it.
"""

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass
from functools import partial
from math import cos, inf, nan, sin
from sys import float_info
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.codec.law import ESTIMATED, FORCE_PREDICTORS, POSITION_BANKS, POSITION_PREDICTORS, half_step, make_channel
from tests.examples import examples
from weberlink.codec import Channel, Decoder, Encoder, Update, force_channel, position_channel
from weberlink.codec.predictors import PREDICTORS
from weberlink.codec.predictors.model import Hold
from weberlink.codec.quantizer import INT16_MAX
from weberlink.compiled import is_compiled
from weberlink.geometry.vector import ZERO, Vector, distance, is_finite, norm, scale
from weberlink.master.safety import ForceLimiter
from weberlink.protocol.wire import CLEAR_BYTES, DirectionLayout, UpdateContent, UpdateLayout
from weberlink.update import ModelParameters, Payload, PreviousSample

Samples = Sequence[tuple[int, Vector, Vector]]
"""Tick, force [N] (position [m] on a position channel), commanded position [m]."""

WEBER = 0.10
FULL = 1e-3 * INT16_MAX
"""Range of a force on one axis [N]."""
LATENCY = 7
"""Age of a sample when it is sent [ticks]."""
FORCE_LIMIT = 10.0

NO_FLOOR = partial(force_channel, floor=0.0)
EXACT = partial(force_channel, force_step=1e-9, position_step=1e-12, saturates=False)
NO_BOUND = partial(position_channel, bound=0.0)
FINE = partial(position_channel, position_step=2e-6)
TWO_AXES = partial(force_channel, axes="xz", position_step=2e-6)


@dataclass(frozen=True)
class Case:
    """A signal, and the expected result at k = 0.10.

    Args:
        name: description of the signal.
        samples: the signal.
        sent: number of updates, by predictor or the same for all.
        decoded: value at the other end at the last sample; None if it depends on the predictor.
        believed: predictors that use a fitted model then; all others hold a sample, or have none.
        channel: makes the channel of a predictor.
        rejected: number of samples that are not finite.
    """

    name: str
    samples: Samples
    sent: int | dict[str, int]
    decoded: Vector | None
    believed: frozenset[str] = frozenset()
    channel: Callable[..., Channel] = force_channel
    rejected: int = 0

    @property
    def of_force(self) -> bool:
        return self.channel(predictor="zoh").position_quantizer is not None

    @property
    def predictors(self) -> tuple[str, ...]:
        return FORCE_PREDICTORS if self.of_force else POSITION_PREDICTORS

    @property
    def fitted(self) -> tuple[str, ...]:
        """The predictors with an expected number of updates; that of an estimated predictor may change by tuning."""
        return tuple(name for name in self.predictors if name not in (*ESTIMATED, "adaptive"))

    def build(self, predictor: str, **options: Any) -> Channel:
        if predictor == "adaptive" and not self.of_force:
            options["bank"] = POSITION_BANKS[predictor]
        return self.channel(predictor=predictor, **options)


def up(force: float) -> Vector:
    return (0.0, 0.0, force)


def steady(value: Vector, position: Vector = ZERO, *, ticks: int = 50) -> Samples:
    return [(tick, value, position) for tick in range(ticks)]


def at_rest(*forces: Vector) -> Samples:
    """A hand that does not move, one force a tick."""
    return [(tick, force, ZERO) for tick, force in enumerate(forces)]


def press(*, start: int = 0, ticks: int = 200, force: float = 1.0) -> Samples:
    """At constant speed into a flat wall of 500 N/m, from 2 mm to 12 mm deep; forces are multiplied by `force`."""
    depths = [2e-3 + 5e-5 * tick for tick in range(ticks)]
    return [(start + tick, up(force * 500.0 * depth), up(-depth)) for tick, depth in enumerate(depths)]


def roll(radius: float, *, aside: float = 0.0) -> Samples:
    """Over the top of a ball of 500 N/m, from 2 mm to 4 mm deep; the y of the position is `aside` [m] off."""
    samples = []
    for tick in range(200):
        angle = (0.02 - 2e-4 * tick) / radius
        depth = 2e-3 + 1e-5 * tick
        direction = (sin(angle), 0.0, cos(angle))
        x, _, z = scale(direction, radius - depth)
        samples.append((tick, scale(direction, 500.0 * depth), (x, aside, z - radius)))
    return samples


def wire(update: Update, layout: UpdateLayout) -> Update:
    """An update as the receiver decodes it, sent `LATENCY` ticks after its sample."""
    layout.check(update)
    data = layout.pack((0, 0, 0, 0, (None,)), LATENCY, update)
    head, content = DirectionLayout([layout.forms]).read(data[0], data[CLEAR_BYTES:])
    assert isinstance(content, UpdateContent)
    return Update(update.tick + LATENCY - content.lag, head.selector, content.newest, content.payload)


def oblique() -> Samples:
    """`press` from 10 N on, on a wall whose normal is (0.6, 0, 0.8)."""
    normal = (0.6, 0.0, 0.8)
    return [(tick, scale(normal, force[2]), scale(normal, position[2])) for tick, force, position in press(force=10.0)]


ON_A_WALL = {"zoh": 16, "linear": 2, "plane": 2, "sphere": 16, "hybrid": 3}
ON_A_BALL = {"zoh": 11, "linear": 4, "plane": 15, "sphere": 2, "hybrid": 3}
BALL = frozenset({"linear", "plane", "sphere", "hybrid"})
WALL = frozenset({"linear", "plane", "hybrid"})
LINEAR = frozenset({"linear"})
WRAP = 1 << 16

CASES = [
    # Nothing, almost nothing, far too much.
    Case("no force", steady(ZERO), 0, ZERO),
    Case("the largest number on every axis", steady((float_info.max,) * 3), 1, (FULL,) * 3),
    Case("1e300 N, off the wire", steady(up(1e300)), 1, up(1e141), channel=EXACT),
    Case("from one end of the range to the other", at_rest(*[up(1e300), up(-1e300)] * 25), 50, up(-FULL), LINEAR),
    Case("pressed 1e300 m aside", steady(up(1.0), (1e300, -1e300, 0.0)), 1, up(1.0)),
    # Not a number.
    Case("never a number", steady((nan, 0.0, 0.0)), 0, ZERO, rejected=50),
    Case("infinite after 1 N", at_rest(up(1.0), *[up(inf), up(-inf)] * 10), 1, up(1.0), rejected=20),
    Case(
        "a ramp with holes",
        [s if s[0] % 7 else (s[0], up(nan), s[2]) for s in press()],
        ON_A_WALL,
        None,
        WALL,
        rejected=29,
    ),
    # The same again.
    Case("identical samples between two levels, without a floor", steady(up(0.0034)), 1, up(0.003), channel=NO_FLOOR),
    Case("off by the floor exactly", steady(up(0.5)), 0, ZERO, channel=partial(force_channel, floor=0.5)),
    # Time.
    Case("two forces at one time", [(i // 2, up(1.0 + i % 2), ZERO) for i in range(40)], 40, up(2.0)),
    Case("a ramp from tick 0 on", press(), ON_A_WALL, None, WALL),
    Case("the same ramp while 24 bits of tick wrap", press(start=WRAP - 100), ON_A_WALL, None, WALL),
    Case("65,535 ticks apart", [(0, up(1.0), ZERO), (65_535, up(2.0), ZERO)], 2, up(2.0), LINEAR),
    # Geometry that is none.
    Case("a ball of 50 mm", roll(0.05), ON_A_BALL, None, BALL),
    # The range of the wire.
    Case("a wall beyond the range", press(force=50.0), 1, up(FULL)),
    Case(
        "a wall through the limit of the range", press(force=10.0), {**ON_A_WALL, "zoh": 11, "sphere": 11}, None, WALL
    ),
    Case(  # the axis that saturates first turns the force, as a ball would
        "an oblique wall through a corner of the range",
        oblique(),
        {**ON_A_WALL, "zoh": 15, "sphere": 16},
        None,
        WALL | {"sphere"},
    ),
]


def code(case: Case, channel: Channel) -> tuple[int, int, Decoder]:
    """Run a case and assert the laws of all cases; returns updates sent, samples rejected, and the decoder."""
    encoder, decoder = Encoder(channel), Decoder(channel)
    quantizer = channel.value_quantizer
    layout = UpdateLayout(channel.forms) if quantizer.limit < 1e6 else None
    sent = 0
    for tick, value, position in case.samples:
        update = encoder.encode(tick, value, position)
        if update is not None:
            sent += 1
            decoder.apply(wire(update, layout) if layout is not None else update)
        for later in (tick, tick + 0.5, tick + 1, tick + 100):
            if not is_compiled():  # its objects refuse to be copied
                check_displayable(copy(decoder).value(later, position), channel)
        if is_finite(value) and is_finite(position):
            decoded = decoder.value(tick, position)
            assert decoded is not None
            assert decoded == (encoder.predicted if update is None else encoder.mirror.value(tick, position))
            error = distance(decoded, quantizer.confine(value))
            assert error <= max(encoder.bound * (1.0 + 1e-12), half_step(channel))
        assert repr(decoder.state) == repr(encoder.mirror.state)  # an unknown position is not equal to itself
    return sent, encoder.rejected, decoder


def check_displayable(decoded: Vector | None, channel: Channel) -> None:
    """Assert that a value is finite, 0 on unused axes and within range, and that the force limiter limits it."""
    if decoded is None:
        assert channel.rest is None
        return
    assert is_finite(decoded)
    assert channel.value_quantizer.confine(decoded) == decoded
    assert norm(ForceLimiter(FORCE_LIMIT).limit(decoded)) <= FORCE_LIMIT * (1.0 + 1e-15)


LAWS = [pytest.param(case, predictor, id=f"{case.name}-{predictor}") for case in CASES for predictor in case.predictors]


@pytest.mark.parametrize(("case", "predictor"), LAWS)
def test_what_is_sent_decoded_and_believed_under_the_laws(case: Case, predictor: str) -> None:
    tick, _, position = case.samples[-1]
    if is_compiled() and tick > 2**53:
        pytest.skip("compiled code takes ticks as floats, exact up to 2^53")
    for weber, axes in ((WEBER, "xyz"), (0.0, "xyz"), (0.30, "z")):
        options = {"axes": axes} if weber != WEBER else {}
        sent, rejected, decoder = code(case, case.build(predictor, weber=weber, **options))
        _, model, newest, _ = decoder.state
        assert (newest is None) == (sent == 0)
        if weber != WEBER or predictor not in case.fitted:
            continue
        assert sent == (case.sent if isinstance(case.sent, int) else case.sent[predictor])
        assert rejected == case.rejected
        assert (model is not None and not isinstance(model, Hold)) == (predictor in case.believed)
        if case.decoded is not None:
            assert decoder.value(tick, position) == pytest.approx(case.decoded, rel=1e-12)


int16 = st.integers(-INT16_MAX - 1, INT16_MAX)
levels = st.sampled_from([-INT16_MAX - 1, -INT16_MAX, -1, 0, 1, INT16_MAX]) | int16
ticks = st.integers(0, 2**25) | st.integers(2**53 - 9, 2**53 + 9)
numbers = st.floats(allow_nan=True, allow_infinity=True)
axes_sets = st.sampled_from(["xyz", "xz", "z"])
bodies = st.tuples(*[levels] * 6), st.integers(0, 65_535), st.tuples(*[levels] * 6), st.binary(max_size=20)
LEAST_PARAMETERS = 2
"""Every estimated predictor of one axis reads as many bytes of parameters."""
probes = st.lists(st.tuples(ticks | numbers, st.tuples(numbers, numbers, numbers)), min_size=1, max_size=5)


@pytest.mark.parametrize("of_force", [True, False])
@given(updates=st.lists(st.tuples(ticks, st.integers(0, 15), *bodies), max_size=5), probes=probes, axes=axes_sets)
@examples(80)
def test_no_peer_can_make_a_decoder_display_what_it_must_not(
    of_force: bool, updates: list[Any], probes: list[tuple[float, Vector]], axes: str
) -> None:
    """With any levels, gap, selector and time; an update that does not fit is refused and changes nothing."""
    channel = make_channel(
        "adaptive", position=not of_force, axes=axes, **({"bank": tuple(PREDICTORS)} if of_force else {})
    )
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
        check_displayable(decoder.value(at, position), channel)
