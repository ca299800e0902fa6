"""The ticks of encoder and decoder over arrays, in such Python as numba can compile; interpreted it does the same.

Owns the order of a tick, as `codec.encoder` and `codec.decoder` have it, and what is kept from tick to tick. Of the
codec's numbers it computes none itself. Numba is not known here.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from weberlink.codec import Channel
from weberlink.codec.predictors import Trust, contact, linear, plane, sphere, zoh
from weberlink.codec.predictors.hold import Hold
from weberlink.codec.predictors.linear import Line
from weberlink.codec.predictors.plane import Plane
from weberlink.codec.predictors.sphere import Sphere
from weberlink.codec.quantizer import Quantizer, level
from weberlink.codec.sample import Sample
from weberlink.codec.update import MAX_GAP
from weberlink.geometry.vector import ZERO, Vector, distance, is_finite

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

ZOH, LINEAR, PLANE, SPHERE = range(4)
CODES = {"zoh": ZOH, "linear": LINEAR, "plane": PLANE, "sphere": SPHERE}
"""The predictors that this loop knows, by what a bank counts as data calls them."""


class Ticks(NamedTuple):
    """What is noted of every tick; arrays of shape (n,), filled by `run`. As in `studies.evaluate.replay.Replay`."""

    error_n: Array
    bound_n: Array
    deviation_n: Array


class Sends(NamedTuple):
    """What is noted of every send, in the fields of an `Update`; filled by `run` from the first place on.

    Args:
        tick: shape (n,).
        selector: shape (n,).
        gap: shape (n,); 0 where no previous sample travels, and else that of the send before does.
        value_levels: whole numbers, 0 on an axis that does not travel; shape (n, 3).
        position_levels: likewise.
    """

    tick: Integers
    selector: Integers
    gap: Integers
    value_levels: Array
    position_levels: Array


class Fitted(NamedTuple):
    """The model in use. No compiler here has a type for one of several classes: `kind` says which of these it is."""

    kind: int
    hold: Hold
    line: Line
    plane: Plane
    sphere: Sphere


class State(NamedTuple):
    """Of encoder and decoder, which on a link without loss are one.

    Args:
        sent: whether anything was; nothing else says anything before.
        newest: sample sent.
        earlier: the sample sent before it.
        paired: whether the two are near enough in time to predict from.
        fitted: the model that the newest update carries.
    """

    sent: bool
    newest: Sample
    earlier: Sample
    paired: bool
    fitted: Fitted


def run(channel: Channel, bank: Integers, force: Array, position: Array, ticks: Ticks, sends: Sends) -> int:
    """Code a signal from its start.

    Args:
        channel: a force channel.
        bank: its predictors, as `CODES`.
        force: shape (n, 3) [N]; a sample that is not finite is rejected.
        position: shape (n, 3) [m].
        ticks: where to.
        sends: where to.

    Returns:
        How many samples were sent.
    """
    deadband = channel.deadband
    state, count, bound = at_rest(), 0, 0.0
    known, last = False, ZERO
    for tick in range(len(force)):
        value = (force[tick, 0], force[tick, 1], force[tick, 2])
        place = (position[tick, 0], position[tick, 1], position[tick, 2])
        held = displayed(channel, state, tick, place)
        if is_finite(value) and is_finite(place):
            actual = channel.value_quantizer.confine(value)
            moved = 0.0
            if deadband.reads_motion:
                moved, known, last = distance(place, last if known else place), True, place
            bound = deadband.bound(actual, held, state.newest.value if state.sent else held, moved)
            error = deadband.error(held, actual)
            if not error <= bound:
                sample = transmitted(channel, tick, actual, place)
                if not error <= deadband.error(sample.value, actual):
                    selector = choose(channel, bank, state, actual, tick, place)
                    gap, state = sent(channel.trust, bank[selector], state, sample)
                    note(channel, sends, count, (tick, selector, gap), (actual, place))
                    held, count = sample.value, count + 1
        ticks.error_n[tick] = distance(held, value)
        ticks.bound_n[tick] = bound
        ticks.deviation_n[tick] = deadband.error(held, value)
    return count


def at_rest() -> State:
    nothing = Sample(0, ZERO, ZERO)
    return State(False, nothing, nothing, False, holding(nothing))


def displayed(channel: Channel, state: State, tick: int, position: Vector) -> Vector:
    """`Decoder.value`, at a tick after that of the newest sample; a force channel rests at zero."""
    if not state.sent:
        return ZERO
    return channel.displayable(predicted(state.fitted, tick, channel.place(position)), state.newest)


def transmitted(channel: Channel, tick: int, actual: Vector, position: Vector) -> Sample:
    """`Channel.sample` of the levels of both."""
    return Sample(tick, channel.value_quantizer.rounded(actual), position_quantizer(channel).rounded(position))


def choose(channel: Channel, bank: Integers, state: State, actual: Vector, tick: int, position: Vector) -> int:
    """`Encoder._choose`."""
    if not state.sent or len(bank) == 1:
        return 0
    place = channel.place(position)
    best, least = 0, np.inf
    for selector in range(len(bank)):
        fitted = fit(channel.trust, bank[selector], state.newest, state.earlier, state.paired)
        error = distance(channel.displayable(predicted(fitted, tick, place), state.newest), actual)
        if error < least:
            best, least = selector, error
    return best


def sent(trust: Trust, code: int, state: State, sample: Sample) -> tuple[int, State]:
    """`Encoder._send`: the gap that the update says, and what both ends know after it."""
    gap = sample.tick - state.newest.tick
    usable = state.sent and 0 < gap <= MAX_GAP
    paired = usable and needs_previous(code, sample, state.newest)
    fitted = fit(trust, code, sample, state.newest, paired)
    return gap if paired else 0, State(True, sample, state.newest, usable, fitted)


def fit(trust: Trust, code: int, newest: Sample, earlier: Sample, paired: bool) -> Fitted:
    """`Predictor.model`; a fit that is not paired is one of the newest sample alone."""
    hold = holding(newest)
    if code == LINEAR:
        line = linear.fit(newest, earlier, trust) if paired else linear.fit(newest, None, trust)
        if line is not None:
            ramp = Line(line.value, line.slope, line.tick)
            return Fitted(LINEAR, hold.hold, ramp, hold.plane, hold.sphere)
    elif code == PLANE:
        flat = plane.fit(newest, earlier, trust) if paired else plane.fit(newest, None, trust)
        if flat is not None:
            wall = Plane(flat.normal, flat.offset, flat.stiffness)
            return Fitted(PLANE, hold.hold, hold.line, wall, hold.sphere)
    elif code == SPHERE:
        ball = sphere.fit(newest, earlier, trust) if paired else sphere.fit(newest, None, trust)
        if ball is not None:
            solid = Sphere(ball.centre, ball.radius, ball.stiffness, ball.newest)
            return Fitted(SPHERE, hold.hold, hold.line, hold.plane, solid)
    return hold


def holding(newest: Sample) -> Fitted:
    nothing = Line(ZERO, ZERO, 0), Plane(ZERO, 0.0, 0.0), Sphere(ZERO, 0.0, 0.0, ZERO)
    return Fitted(ZOH, Hold(newest.value), nothing[0], nothing[1], nothing[2])


def predicted(fitted: Fitted, tick: int, place: Vector) -> Vector:
    if fitted.kind == LINEAR:
        return fitted.line.at(tick, place)
    if fitted.kind == PLANE:
        return fitted.plane.at(tick, place)
    if fitted.kind == SPHERE:
        return fitted.sphere.at(tick, place)
    return fitted.hold.at(tick, place)


def needs_previous(code: int, newest: Sample, previous: Sample) -> bool:
    if code == LINEAR:
        return linear.needs_previous(newest, previous)
    if code in (PLANE, SPHERE):
        return contact.same_contact(newest, previous)
    return zoh.needs_previous(newest, previous)


def note(
    channel: Channel, sends: Sends, place: int, update: tuple[int, int, int], vectors: tuple[Vector, Vector]
) -> None:
    """Tick, selector and gap of a send; force and position that its levels say."""
    sends.tick[place], sends.selector[place], sends.gap[place] = update
    force = channel.value_quantizer.confine(vectors[0])
    position = position_quantizer(channel).confine(vectors[1])
    for axis in range(3):
        sends.value_levels[place, axis] = level(force[axis], channel.value_quantizer.step)
        sends.position_levels[place, axis] = level(position[axis], position_quantizer(channel).step)


def position_quantizer(channel: Channel) -> Quantizer:
    assert channel.position_quantizer is not None
    return channel.position_quantizer
