"""A saving at equal Weber factor and at equal quality, against numbers worked out by hand."""

from math import exp, log

import pytest
from hypothesis import given
from hypothesis import strategies as st

from weberlink.studies.curves import Observation
from weberlink.studies.paper.claims import CLAIMS, Claim
from weberlink.studies.paper.savings import rate_at, saving

AT_WEBER = Claim("hybrid", "zoh", "weber", 0.42)
AT_QUALITY = Claim("hybrid", "zoh", "quality", 0.60)


def unit(name, predictor, *points):
    """Observations of (weber, rate, error)."""
    return [Observation(name, predictor, weber, rate, error) for weber, rate, error in points]


def test_the_papers_claims_are_shares_of_predictors_that_there_are():
    assert {name for claim in CLAIMS for name in (claim.predictor, claim.reference)} <= {
        "zoh", "linear", "plane", "sphere", "hybrid",
    }  # fmt: skip
    assert all(0.0 < claim.fewer < 1.0 for claim in CLAIMS)


def test_at_equal_weber_factor_it_is_the_geometric_mean_of_the_ratios():
    observations = [
        *unit("a", "zoh", (0.1, 40.0, 0.5)), *unit("a", "hybrid", (0.1, 10.0, 0.5)),
        *unit("b", "zoh", (0.1, 20.0, 0.5)), *unit("b", "hybrid", (0.1, 20.0, 0.5)),
    ]  # fmt: skip
    found = saving(AT_WEBER, observations)
    assert found.units == 2
    assert found.ratios == {"a": 0.25, "b": 1.0}
    assert found.fewer.mean == pytest.approx(0.5)
    assert found.fewer.low == pytest.approx(0.0)
    assert found.fewer.high == pytest.approx(0.75)
    assert found.failing == ("b",)
    assert found.verdict == "holds"


@pytest.mark.parametrize(
    ("ratios", "verdict"),
    [
        ([0.5, 0.5], "holds"),
        ([0.8, 0.81], "saves less"),
        ([0.3, 1.4], "within the confidence"),
        ([1.2, 1.1], "no saving shown"),
        ([], "not measured"),
    ],
)
def test_the_verdict_says_how_the_measurement_stands_to_the_claim(ratios, verdict):
    observations = []
    for index, ratio in enumerate(ratios):
        observations += unit(str(index), "zoh", (0.1, 100.0, 0.5)) + unit(str(index), "hybrid", (0.1, 100 * ratio, 0.5))
    assert saving(AT_WEBER, observations).verdict == verdict


def test_units_without_packets_say_nothing():
    observations = unit("silent", "zoh", (0.1, 0.0, 0.0)) + unit("silent", "hybrid", (0.1, 0.0, 0.0))
    found = saving(AT_WEBER, observations)
    assert (found.units, found.fewer) == (0, None)


def test_at_equal_quality_the_rate_is_that_of_the_references_error():
    observations = [
        *unit("a", "zoh", (0.05, 60.0, 0.2), (0.1, 40.0, 0.4)),
        *unit("a", "hybrid", (0.05, 30.0, 0.2), (0.1, 16.0, 0.3), (0.15, 4.0, 0.5)),
    ]
    found = saving(AT_QUALITY, observations)
    # Half way between 0.3 and 0.5 JND: the geometric mean of 16 and 4 packets.
    assert found.ratios == {"a": pytest.approx(8.0 / 40.0)}
    assert found.fewer.mean == pytest.approx(0.8)
    assert (found.unreached, found.clipped) == ((), ())


def test_a_quality_that_is_never_reached_is_said_and_one_that_is_always_better_counts_at_its_fewest():
    worse = unit("a", "zoh", (0.1, 40.0, 0.1)) + unit("a", "hybrid", (0.05, 9.0, 0.2), (0.1, 8.0, 0.3))
    better = unit("b", "zoh", (0.1, 40.0, 0.9)) + unit("b", "hybrid", (0.05, 9.0, 0.2), (0.1, 8.0, 0.3))
    found = saving(AT_QUALITY, worse + better)
    assert found.unreached == ("a",)
    assert found.clipped == ("b",)
    assert found.ratios == {"b": pytest.approx(0.2)}


def test_of_several_crossings_the_largest_weber_factor_counts():
    assert rate_at([(0.2, 10.0), (0.6, 8.0), (0.2, 6.0), (0.6, 4.0)], 0.4)[0] == pytest.approx(
        exp((log(6) + log(4)) / 2)
    )


@given(
    st.lists(st.floats(0.01, 2.0), min_size=2, max_size=8).map(sorted),
    st.floats(0.0, 3.0),
    st.randoms(use_true_random=False),
)
def test_the_rate_lies_between_those_of_the_curve(errors, error, random):
    rates = sorted((random.uniform(1.0, 100.0) for _ in errors), reverse=True)
    rate, clipped = rate_at(list(zip(errors, rates, strict=True)), error)
    if rate is None:
        assert error < errors[0]
    else:
        assert rates[-1] <= rate * (1 + 1e-9) and rate <= rates[0] * (1 + 1e-9)
        assert clipped == (errors[-1] < error)
