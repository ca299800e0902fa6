"""A peer that holds the keys may send any parameters of a model: no tick of a side raises."""

from typing import Any

import pytest
from hypothesis import example, given, strategies as st

from tests.examples import examples
from tests.session.hostile import Content
from tests.session.systems import configuration
from tests.session.test_hostile_peer import LOCAL, SMOOTH, moves_with, payloads, play
from weberlink.update import MOST_PARAMETER_BYTES, ModelParameters
from weberlink_predictors.parameters import pack

MIXED = ("codec.force.predictor=adaptive", "codec.position.predictor=adaptive")
SYSTEMS: dict[str, tuple[str, ...]] = {
    "none": ("codec.force.predictor=adaptive", "control.scheme=none"),
    "smooth": (*MIXED, "control.scheme=none", *SMOOTH),
    "bounded": (*MIXED, "control.scheme=bounded"),
    "paths": ("codec.force.predictor=path", "codec.position.predictor=path", "control.scheme=none"),
}


@st.composite
def paths(draw: Any) -> ModelParameters:
    """Parameters of a path, most of which a sender with look-ahead could make: the first knot is at 0."""
    known, inner, count = draw(st.integers(0, 127)), draw(st.integers(0, 7)), draw(st.integers(0, 6))
    width, exponent = draw(st.integers(0, 15)), draw(st.integers(0, 63))
    chords = sorted(draw(st.sets(st.integers(1, 127), min_size=inner, max_size=inner)))
    numbers = draw(st.lists(st.integers(0, (1 << width) - 1), max_size=24))
    fields = [7, width, exponent, known, inner, count, *chords, *numbers]
    widths = [3, 4, 6, 7, 3, 3, *[7] * len(chords), *[width] * len(numbers)]
    return ModelParameters(pack(fields, widths)[:MOST_PARAMETER_BYTES])


FROM_THE_START = Content(0, 0, 1, (1000,), ModelParameters(pack([7, 1, 0, 1, 0, 0], [3, 4, 6, 7, 3, 3])))
"""A path whose first knot is at 0, of a sample that is still to come."""


@pytest.mark.parametrize("hero", ["master", "slave"])
@pytest.mark.parametrize("name", SYSTEMS)
@given(played=moves_with(payloads | paths()))
@example(played=[("update", FROM_THE_START)])
@examples(15)
def test_no_tick_raises_whatever_an_authentic_peer_says(name: str, hero: str, played: list[Any]) -> None:
    play(configuration(*LOCAL, *SYSTEMS[name]), hero, played)
