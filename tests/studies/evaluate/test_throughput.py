from importlib.util import find_spec

import numpy as np
import pytest

from weberlink.codec import force_channel
from weberlink.studies.evaluate.engine import Engine
from weberlink.studies.evaluate.replay import replay
from weberlink.studies.evaluate.throughput import contact, throughput


def test_the_signal_is_a_contact_that_every_predictor_is_chosen_for() -> None:
    signal = contact(10_000)
    found = replay(signal, force_channel(weber=0.10))
    touching = np.linalg.norm(signal.force_n, axis=1) > 0.0
    assert 0.2 < touching.mean() < 0.8
    assert float(np.abs(signal.force_n).max()) < 32.0
    assert set(found.selected.tolist()) == {0, 1, 2, 3}


def test_the_signal_is_always_the_same() -> None:
    assert contact(100).force_n.tobytes() == contact(100).force_n.tobytes()


@pytest.mark.parametrize("engine", ["python", "compiled"])
def test_a_rate_is_told(engine: Engine) -> None:
    if engine == "compiled" and find_spec("numba") is None:
        pytest.skip("numba (extra: compiled) is not installed")
    assert throughput(engine, 500) > 0.0
