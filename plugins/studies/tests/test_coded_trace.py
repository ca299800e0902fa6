"""A signal through the codec tick by tick is the replay of the evaluation."""

import numpy as np
import pytest

from tests.session.systems import CONFIGS
from weberlink.codec import force_channel
from weberlink.master.trace import read_trace
from weberlink_studies.coded_trace import CodedTrace
from weberlink_studies.evaluate.replay import replay, signal_of


@pytest.mark.parametrize("predictor", ["zoh", "hybrid"])
def test_ticks_are_those_of_the_replay(predictor: str) -> None:
    trace, channel = read_trace(CONFIGS / "traces" / "operator.npz"), force_channel(predictor=predictor)
    counted, coded = replay(signal_of(trace), channel), CodedTrace(trace, channel)
    assert coded.predictor == predictor
    assert np.flatnonzero(coded.sent).tolist() == [update.tick for update in counted.updates]
    assert coded.selected[coded.sent].tolist() == [update.selector for update in counted.updates]
    assert np.linalg.norm(coded.displayed_n - coded.trace.force_n, axis=1) == pytest.approx(counted.error_n)
    assert coded.bound_n == pytest.approx(counted.bound_n)
