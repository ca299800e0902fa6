from weberlink.codec.adaptive.history import KEPT, History
from weberlink.geometry.vector import ZERO, Vector


def sample(tick: int) -> tuple[Vector, Vector]:
    return (float(tick), 0.0, 0.0), (0.0, float(tick), 0.0)


def test_the_newest_sample_is_the_last_and_as_many_are_kept_as_are_needed() -> None:
    history = History()
    for tick in range(1000):
        assert history.add(tick, *sample(tick)) == (tick > 0)
        assert len(history) == len(history.values) == len(history.places)
        assert min(tick + 1, KEPT) <= len(history) <= 2 * KEPT
        assert (history.values[-1], history.places[-1]) == sample(tick)
        first = tick + 1 - len(history)
        assert history.values == [sample(each)[0] for each in range(first, tick + 1)]
        assert history.places == [sample(each)[1] for each in range(first, tick + 1)]


def test_a_gap_a_repetition_or_a_step_back_ends_the_record() -> None:
    for other in (12, 10, 9, 0, 10**9):
        history = History()
        for tick in range(11):
            history.add(tick, *sample(tick))
        assert not history.add(other, ZERO, ZERO)
        assert (history.values, history.places) == ([ZERO], [ZERO])
        assert history.add(other + 1, ZERO, ZERO)
        assert len(history) == 2


def test_the_first_sample_follows_none_whatever_its_tick() -> None:
    for tick in (0, 1, 2, 2**53):
        assert not History().add(tick, ZERO, ZERO)
