"""What is predicted of unheard credit is bounded in energy and in time."""

from math import isfinite

from hypothesis import example, given
from hypothesis import strategies as st
from pytest import approx

from weberlink.control.contract import CREDIT_STEP
from weberlink.control.energy import LONGEST, CreditPrediction

MOST = 1e-3
TICK = 1e-3


@example([(1, 5e-324), (0, 0.0)])
@given(st.lists(st.tuples(st.integers(0, 1000), st.one_of(st.floats(0.0, 0.1), st.just(5e-324))), max_size=60))
def test_never_ahead_by_more_than_the_most_and_never_behind(ticks: list[tuple[int, float]]) -> None:
    prediction, credit = CreditPrediction(MOST), 0
    for more, elapsed in ticks:
        credit += more
        ahead = prediction.ahead(credit, elapsed)
        assert isfinite(ahead)
        assert 0.0 <= ahead <= MOST


@given(st.lists(st.integers(1, 100), min_size=1, max_size=20), st.integers(0, 200))
def test_nothing_is_predicted_long_after_the_last_news(news: list[int], ticks: int) -> None:
    prediction, credit = CreditPrediction(MOST), 0
    for more in news:
        credit += more
        prediction.ahead(credit, TICK)
    since = 0.0
    for _ in range(ticks):
        since += TICK
        ahead = prediction.ahead(credit, TICK)
        if since > LONGEST + TICK:
            assert ahead == 0.0


def test_between_news_it_goes_on_at_the_rate_of_the_last_two_sums() -> None:
    prediction = CreditPrediction(MOST)
    for _ in range(3):
        known = prediction.ahead(0, 0.01)
        assert known == 0.0
    assert prediction.ahead(3, 0.01) == 0.0
    rate = 3 * CREDIT_STEP / 0.04
    assert prediction.ahead(3, 0.002) == approx(rate * 0.002)
    assert prediction.ahead(3, 0.002) == approx(rate * 0.004)


def test_an_old_sum_that_is_told_again_is_no_news() -> None:
    prediction = CreditPrediction(MOST)
    prediction.ahead(10, 0.01)
    first = prediction.ahead(10, 0.01)
    assert prediction.ahead(4, 0.0) == first


def test_reset_forgets() -> None:
    prediction = CreditPrediction(MOST)
    prediction.ahead(10, 0.01)
    assert prediction.ahead(10, 0.01) > 0.0
    prediction.reset()
    assert prediction.ahead(0, 0.01) == 0.0
    prediction.ahead(1, 0.01)
    assert prediction.ahead(1, 0.001) == approx(CREDIT_STEP / 0.02 * 0.001)
