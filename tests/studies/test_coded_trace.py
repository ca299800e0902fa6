"""A signal through the codec tick by tick: against the replay of the evaluation, and the choice of a window."""

import numpy as np
import pytest

from tests.studies.coded import own, run
from weberlink.codec import force_channel
from weberlink.studies.evaluate.replay import replay, signal_of

PREDICTORS = ("zoh", "hybrid")


@pytest.mark.parametrize("predictor", PREDICTORS)
def test_ticks_are_those_of_the_replay(predictor: str) -> None:
    counted, coded = replay(signal_of(own()), force_channel(predictor=predictor)), run(predictor)
    assert coded.predictor == predictor
    assert coded.sent.sum() == len(counted.updates)
    assert np.flatnonzero(coded.sent).tolist() == [update.tick for update in counted.updates]
    assert coded.selected[coded.sent].tolist() == [update.selector for update in counted.updates]
    assert np.linalg.norm(coded.displayed_n - coded.trace.force_n, axis=1) == pytest.approx(counted.error_n)
    assert coded.bound_n == pytest.approx(counted.bound_n)


# --- the window
