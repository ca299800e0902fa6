"""Every shape of the deadband, compiled beside live: every update, error and bound the same, bit for bit."""

from importlib.util import find_spec
from math import inf, nan, pi

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.codec.signals import contact_stream
from tests.examples import examples
from tests.studies.evaluate.signals import walk, wall
from tests.studies.evaluate.test_compiled import assert_alike, check, compiled, interpreted, signal
from weberlink.codec import force_channel
from weberlink.codec.deadband import ConeDeadband, Deadband, ForceDeadband, LevelCrossingDeadband, VelocityDeadband
from weberlink.codec.deadband.shapes import SHAPES
from weberlink.geometry.vector import Vector
from weberlink.studies.evaluate.replay import replay, signal_of

pytestmark = pytest.mark.skipif(find_spec("numba") is None, reason="numba (extra: compiled) is not installed")

BANKS = [("zoh",), ("linear", "plane"), ("zoh", "linear", "plane", "sphere")]
DEADBANDS: list[Deadband] = [
    ConeDeadband(0.1, 0.02),
    ConeDeadband(0.0, 0.0, 0.01),
    ConeDeadband(0.3, 0.5, pi),
    LevelCrossingDeadband(0.1, 0.02),
    LevelCrossingDeadband(0.0, 1e-3, 0.01, 0.0),
    LevelCrossingDeadband(0.3, 0.5, pi, 1.0),
    VelocityDeadband(0.1, 0.02),
    VelocityDeadband(0.0, 0.0, "displayed", 20.0, 1.0),
    VelocityDeadband(0.1, 0.02, "sent", 0.0, 0.0, 1e-2),
]


def test_every_shape_of_a_force_can_be_compiled() -> None:
    from weberlink.studies.evaluate.compiled.compiler import DEADBANDS as KNOWN  # noqa: PLC0415 - heavy, an extra

    assert set(KNOWN) == set(SHAPES.values())
    assert {type(deadband) for deadband in DEADBANDS} == set(KNOWN) - {ForceDeadband}


@pytest.mark.parametrize("deadband", DEADBANDS, ids=repr)
@pytest.mark.parametrize("bank", BANKS, ids=",".join)
def test_contacts_of_all_kinds(bank: tuple[str, ...], deadband: Deadband) -> None:
    for axes in ("xyz", "z"):
        channel = force_channel(bank=bank, axes=axes, deadband=deadband)
        assert sum(check(signal(contact_stream(seed, ticks=300, axes=axes)), channel) for seed in range(3)) > 0


@given(
    deadband=st.sampled_from(DEADBANDS),
    bank=st.sampled_from(BANKS),
    saturates=st.booleans(),
    samples=st.lists(
        st.tuples(*[st.tuples(*[st.sampled_from([1.0, -2.0, 0.0, 0.02, inf, nan]) | st.floats()] * 3)] * 2),
        min_size=1,
        max_size=20,
    ),
)
@examples(150)
def test_any_numbers_and_what_is_none(
    deadband: Deadband, bank: tuple[str, ...], saturates: bool, samples: list[tuple[Vector, Vector]]
) -> None:
    made, channel = signal(samples), force_channel(bank=bank, saturates=saturates, deadband=deadband)
    found, expected = compiled(made, channel), replay(made, channel)
    assert list(found.updates) == list(expected.updates)
    for name in ("error_n", "bound_n", "deviation_n"):
        # To the last bit, but that there are several bit patterns that are no number.
        assert np.array_equal(getattr(found, name), getattr(expected, name), equal_nan=True)


@pytest.mark.parametrize("deadband", DEADBANDS, ids=repr)
def test_the_loop_interpreted_is_the_live_codec(deadband: Deadband) -> None:
    for made in (signal_of(wall(400)), signal_of(walk(300, seed=2))):
        channel = force_channel(deadband=deadband)
        ticks, sends = interpreted(made, channel)
        expected = replay(made, channel)
        assert_alike(compiled(made, channel), expected)
        assert ticks.deviation_n.tobytes() == expected.deviation_n.tobytes()
        assert sends.tick.tolist() == [update.tick for update in expected.updates]
