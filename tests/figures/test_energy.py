"""Work at the port of the operator, as laws; figures of whole sessions are in test_session."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from weberlink.figures.channel import Records
from weberlink.figures.energy import PortWork
from weberlink.telemetry.reader import DTYPE


def records(force: np.ndarray, position: np.ndarray) -> Records:
    made = np.zeros(len(force), DTYPE)
    made["tick"] = np.arange(len(force))
    made["output"], made["position"] = force, position
    return made


@given(st.integers(0, 2**32 - 1), st.integers(2, 50), st.integers(1, 20))
def test_work_does_not_depend_on_the_pieces(seed: int, ticks: int, pieces: int) -> None:
    rng = np.random.default_rng(seed)
    made = records(rng.normal(size=(ticks, 3)), rng.normal(size=(ticks, 3)))
    whole, parts = PortWork(), PortWork()
    series = np.concatenate([parts.add(piece) for piece in np.array_split(made, pieces)])
    assert series == pytest.approx(whole.add(made))
    assert parts.total == pytest.approx(whole.total)
    assert parts.least == pytest.approx(whole.least)
    assert parts.least <= min(0.0, parts.total)


def test_a_force_is_held_until_the_next_tick() -> None:
    """1 N, then 3 N, over 1 m towards the force: 1 J."""
    force, way = np.zeros((2, 3)), np.zeros((2, 3))
    force[:, 0], way[:, 0] = (1.0, 3.0), (0.0, 1.0)
    port = PortWork()
    assert port.add(records(force, way)) == pytest.approx([0.0, -1.0])
    assert port.least == -1.0
