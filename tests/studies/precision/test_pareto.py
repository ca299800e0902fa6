"""The Pareto front: what is on it, what is not, and what is as good for less."""

from math import inf

from hypothesis import given
from hypothesis import strategies as st

from weberlink.studies.precision.pareto import Point, cheapest_as_good, front

values = st.one_of(st.sampled_from([1.0, 2.0, 3.0]), st.floats(1e-6, 1e6))
points = st.lists(st.tuples(values, st.one_of(values, st.just(inf))), max_size=12)


def dominates(a: Point, b: Point) -> bool:
    return a[0] <= b[0] and a[1] <= b[1] and a != b


@given(points)
def test_the_front_is_what_nothing_dominates(cloud: list[Point]) -> None:
    expected = {i for i, b in enumerate(cloud) if b[1] < inf and not any(dominates(a, b) for a in cloud)}
    found = front(cloud)
    assert set(found) == expected
    assert [cloud[i][0] for i in found] == sorted(cloud[i][0] for i in found)


@given(points, values)
def test_the_cheapest_as_good_is_good_and_cheapest(cloud: list[Point], error: float) -> None:
    index = cheapest_as_good(cloud, error)
    good = [time for time, wrong in cloud if wrong <= error]
    if index is None:
        assert not good
    else:
        assert cloud[index][1] <= error
        assert cloud[index][0] == min(good)


def test_what_diverged_is_never_on_the_front_however_fast() -> None:
    assert front([(1.0, inf), (5.0, 0.1), (6.0, 0.2), (9.0, 0.01)]) == [1, 3]
