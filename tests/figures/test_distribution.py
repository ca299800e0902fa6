from math import inf, nan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from weberlink.figures.distribution import RESOLUTION, Distribution
from weberlink.figures.tree import Median, Spread


@given(st.lists(st.floats(0.0, 5e8), min_size=1, max_size=200), st.sampled_from([0.0, 50.0, 99.0, 99.9, 100.0]))
def test_percentiles_agree_with_nearest_rank_to_the_resolution(values: list[float], p: float) -> None:
    distribution = Distribution()
    for piece in np.array_split(np.array(values), 3):
        distribution.add(piece)
    exact = float(np.percentile(values, p, method="inverted_cdf"))
    assert distribution.count == len(values)
    assert distribution.max == max(values)
    assert distribution.percentile(p) == pytest.approx(exact, rel=RESOLUTION, abs=1.0)


def test_of_nothing_there_is_nothing_to_say() -> None:
    empty = Distribution()
    empty.add([nan, inf])
    assert empty.count == 0
    assert empty.spread() == Spread() and empty.median() == Median()
