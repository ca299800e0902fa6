"""The contract of every channel: force, position and joints, with each predictor."""

from collections.abc import Sequence
from math import copysign, inf, nan
from random import Random
from typing import Any, get_args

import pytest
from hypothesis import given, strategies as st

from tests.codec.law import KINDS, Kind, Law, shaped, shown_by
from tests.examples import examples
from weberlink.codec import Channel, Decoder, Encoder, Update
from weberlink.codec.deadband import DEADBANDS, Deadband, ForceDeadband, PositionDeadband, Reference
from weberlink.codec.rate import UpdateRate
from weberlink.update import MAX_GAP, ModelParameters, PreviousSample

every = pytest.mark.parametrize("kind", KINDS, ids="-".join)
seeds = st.integers(0, 2**32 - 1)
SHAPES: list[tuple[str, Reference]] = [
    (shape, reference)
    for shape, kind in DEADBANDS.items()
    for reference in (("actual",) if kind.needs_actual else get_args(Reference))
]


def is_slow(kind: Kind) -> bool:
    """Whether the sender learns from all samples."""
    return kind.predictor in ("path", "elastic", "adaptive")


# The law.


@st.composite
def options(draw: st.DrawFn, kind: Kind) -> dict[str, Any]:
    """Of a channel."""
    weber = draw(st.sampled_from([0.0, 0.1]) | st.floats(0.005, 0.5))
    rate = draw(st.none() | st.builds(UpdateRate, st.floats(0.001, 1.5), st.floats(4.0, 40.0)))
    if kind.of == "joints":
        return {"weber": weber, "rate": rate, "axes": draw(st.integers(1, 7))}
    found: dict[str, Any] = {"axes": draw(st.sampled_from(["z", "xz", "xyz"])), "rate": rate}
    found["lookahead"] = draw(st.sampled_from([0, 0, 1, 2, 7] if is_slow(kind) else [0, 0, 1, 2, 7, 37]))
    if kind.of == "position":
        return found | {"weber": weber, "bound": draw(st.sampled_from([0.0, 1e-5, 2e-4]))}
    shape, reference = draw(st.sampled_from(SHAPES))
    found["deadband"] = shaped(shape, weber, draw(st.sampled_from([0.0, 0.002, 0.02])), reference)
    if found["deadband"].is_ball and not found["lookahead"]:
        found["smoothing"] = draw(st.integers(0, 30))
    return found


def retuned(
    kind: Kind, weber: float, selectors: set[int], channel: Channel
) -> tuple[Deadband, list[int], list[Deadband]]:
    """A live change: the deadband, the selectors, and the deadbands of further parts."""
    chosen = sorted({each % len(channel.bank) for each in selectors})
    if kind.of == "joints":
        first = kind.channel(axes=channel.joints, weber=weber)
        return first.deadband, chosen, [part.deadband for part in first.more]
    return (PositionDeadband(weber, 1e-4) if kind.of == "position" else ForceDeadband(weber, 0.01)), chosen, []


EVENTS = st.one_of(
    st.sampled_from(["restart", "restart and retune", "reset", "skip", "not finite", "no place", "huge", "limit"]),
    st.tuples(st.sampled_from([0.0, 0.05, 0.3]), st.sets(st.integers(0, 9), min_size=1)),
    st.sampled_from([2, 20, MAX_GAP, MAX_GAP + 1]),
)
"""A live change of Weber factor and predictors is a tuple; a number of ticks without a sample is a number."""


@every
@given(
    data=st.data(), seed=seeds, rubbing=st.booleans(), events=st.dictionaries(st.integers(0, 119), EVENTS, max_size=9)
)
@examples(20)
def test_at_every_tick_the_ends_hold_the_same_within_the_deadband(
    kind: Kind, data: st.DataObject, seed: int, rubbing: bool, events: dict[int, Any]
) -> None:
    """With any options, through restarts, live changes, gaps and samples that are none.

    And a sample is sent exactly if its prediction is outside the deadband, and no more often than the rate permits.
    """
    chosen = data.draw(options(kind))
    channel = kind.channel(**chosen)
    law, tick, selected = Law(channel), 0, range(len(channel.forms))
    ticks, axes = (60 if is_slow(kind) else 120), chosen["axes"]
    for index, (value, place) in enumerate(kind.stream(seed, ticks=ticks, axes=axes, rubbing=rubbing)):
        event = events.get(index)
        tick += 1 + (event if isinstance(event, int) else 0)
        if event in ("restart", "restart and retune"):
            law.restart()
        if event == "reset":
            law.reset()
        if isinstance(event, tuple) or event == "restart and retune":
            deadband, selected, more = retuned(kind, *(event if isinstance(event, tuple) else (0.1, {0})), channel)
            law.retune(deadband, selected, tick, more)
        lost = event == "no place" and kind.of != "joints"
        sample = None if event == "skip" else (spoilt(value, event), (place[0], nan, place[2]) if lost else place)
        found = law.tick(tick, sample, 1e-3 if event == "limit" else inf)
        assert found is None or found.update is None or found.update.selector in selected
    if law.rate is not None:
        assert law.beyond <= law.rate.burst + 1e-6


def spoilt(value: Sequence[float], event: object) -> tuple[float, ...]:
    """A value, or what an event makes of it."""
    if event == "not finite":
        return (nan, *value[1:]) if value[0] > 0.0 else (*value[:-1], copysign(inf, value[-1]))
    if event == "huge":
        return tuple(1e300 if each > 0.0 else -1e300 for each in value)
    return tuple(value)


@every
@pytest.mark.parametrize("lookahead", [0, 7])
def test_any_update_that_arrives_restores_the_state(kind: Kind, lookahead: int) -> None:
    """After loss and reordering the ends agree until an update is lost again; a decoder that starts late agrees too."""
    channel = kind.channel(**({} if kind.of == "joints" else {"lookahead": lookahead}))
    encoder, decoder, random = Encoder(channel), Decoder(channel), Random(7)
    agree, delayed, compared, lost = True, None, 0, 0
    stream = kind.stream(5, ticks=900, rubbing=kind.of != "joints")
    for tick, (value, place) in enumerate(stream):
        update = encoder.encode(tick, value, place)
        coded_at = stream[max(0, tick - channel.lookahead)][1]
        if update is not None:
            late_starter = Decoder(channel)
            late_starter.apply(update)
            assert repr(late_starter.state) == repr(encoder.mirror.state)
            if random.random() < 0.5:
                agree, delayed, lost = False, update, lost + 1
            else:
                if delayed is not None:
                    decoder.apply(delayed)
                decoder.apply(update)
                agree, delayed = True, None
        shown = shown_by(decoder, tick, coded_at)
        if agree and (encoder.predicted is not None or update is not None):
            compared += 1
            assert shown == (encoder.predicted if update is None else shown_by(encoder.mirror, tick, coded_at))
    assert compared > 150
    assert lost > 1


@every
def test_a_reset_encoder_sends_the_same_bits_as_a_fresh_one(kind: Kind) -> None:
    used, fresh = Encoder(kind.channel()), Encoder(kind.channel())
    for tick, (value, place) in enumerate(kind.stream(12, ticks=400)):
        used.encode(tick, value, place)
    used.reset()
    sent = 0
    for tick, (value, place) in enumerate(kind.stream(2, ticks=500, rubbing=True), 400):
        # A channel of positions or joints does not read the second position.
        update = used.encode(tick, value, place if kind.of == "force" else (float(tick), 1.0, -1e6))
        assert update == fresh.encode(tick, value, place)
        assert (used.bound, used.predicted, used.coded) == (fresh.bound, fresh.predicted, fresh.coded)
        sent += update is not None
    assert sent > 1


@every
def test_after_a_restart_the_next_sample_is_sent_once_without_history(kind: Kind) -> None:
    """Also one that the rest of the channel would display, and if the tuning changes in between."""
    channel = kind.channel()
    encoder = Encoder(channel)
    rest = (0.0,) * (5 if kind.of == "joints" else 3)
    first = encoder.encode(0, rest)
    assert (first is None) == (kind.of == "force")
    assert (encoder.predicted is None) == (kind.of != "force")
    for tick, retunes in ((1, False), (5, True)):
        encoder.restart()
        if retunes:
            encoder.retune(*retuned(kind, 0.1, {0}, channel))
        update = encoder.encode(tick, rest)
        assert update is not None
        assert not isinstance(update.payload, PreviousSample)
        assert [encoder.encode(tick + ahead, rest) for ahead in (1, 2)] == [None, None]


# Updates.


@every
def test_an_update_that_does_not_fit_is_refused_and_changes_nothing(kind: Kind) -> None:
    channel = kind.channel()
    encoder, decoder = Encoder(channel), Decoder(channel)
    for tick, sample in enumerate(kind.stream(5, ticks=60)):
        update = encoder.encode(tick, *sample)
        if update is not None:
            decoder.apply(update)
    before = repr((decoder.state, decoder.newest, decoder.first, decoder.selected))
    wrong = [Update(99, len(channel.forms), (0,) * 6), Update(99, -1, (0,) * 6)]
    for selector, form in enumerate(channel.forms):
        newest = (0,) * sum(form.newest)
        wrong += [Update(99, selector, (*newest, 0)), Update(99, selector, newest[1:])]
        if form.previous is None:
            wrong += [
                Update(99, selector, newest, PreviousSample(1, newest)),
                Update(99, selector, newest, ModelParameters(b"\x24" + bytes(99))),
            ]
        else:
            size = sum(form.previous)
            wrong += [
                Update(99, selector, newest, PreviousSample(1, (0,) * (size + 1))),
                Update(99, selector, newest, PreviousSample(1, (0,) * (size - 1))),
                Update(99, selector, newest, ModelParameters(b"")),
            ]
    for update in wrong:
        with pytest.raises(ValueError, match="update"):
            decoder.apply(update)
        assert repr((decoder.state, decoder.newest, decoder.first, decoder.selected)) == before


@pytest.mark.parametrize(
    ("kind", "reads"),
    [
        (Kind("force", "zoh"), False), (Kind("force", "linear"), True), (Kind("force", "plane"), True),
        (Kind("force", "sphere"), True), (Kind("position", "linear"), True), (Kind("joints", "zoh"), False),
        (Kind("joints", "linear"), True),
    ],
)  # fmt: skip
def test_the_previous_sample_travels_where_it_is_read_and_fits_in_the_gap(kind: Kind, reads: bool) -> None:
    size = 5 if kind.of == "joints" else 3
    for second, anew, carries in [
        (1, False, True), (MAX_GAP, False, True), (MAX_GAP + 1, False, False), (0, False, False), (-5, False, False),
        (1, True, False),
    ]:  # fmt: skip
        encoder, decoder = Encoder(kind.channel()), Decoder(kind.channel())
        encoder.encode(0, (0.3,) * size)
        if anew:
            encoder.reset()
        update = encoder.encode(second, (0.2,) * size)
        assert update is not None
        payload = update.payload
        assert isinstance(payload, PreviousSample) == (reads and carries)
        if isinstance(payload, PreviousSample):
            assert payload.gap == second
            assert payload.levels[:size] == tuple(round(0.3 / law_step(kind)) for _ in range(size))
        decoder.apply(update)
        assert repr(decoder.state) == repr(encoder.mirror.state)


def law_step(kind: Kind) -> float:
    return 1e-5 if kind.of == "position" else 1e-3


@every
@pytest.mark.parametrize("selectors", [[], [99], [-1], [0, 9], "len"])
def test_refuses_invalid_selectors_and_stays_as_it_was(kind: Kind, selectors: Any) -> None:
    channel = kind.channel()
    encoder, other = Encoder(channel), Encoder(channel)
    with pytest.raises(ValueError, match="selectors"):
        encoder.retune(ForceDeadband(0.5, 5.0), [len(channel.bank)] if selectors == "len" else selectors)
    for tick, sample in enumerate(kind.stream(4, ticks=30)):
        assert encoder.encode(tick, *sample) == other.encode(tick, *sample)
