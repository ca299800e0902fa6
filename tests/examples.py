"""Settings of hypothesis: the suite uses the same examples in every run; `make hunt` uses more, random ones."""

from math import log10
from typing import Any

from hypothesis import HealthCheck, settings, strategies as st

COUNT = 40  # examples of a test that does not set a number

FEWEST = 5  # examples of a test, however small the share

_times = 1.0


def hunt(times: int, share: float = 1.0) -> None:
    """Set the number and choice of examples, before any test is imported; 0 for that share of the fixed examples."""
    global _times  # noqa: PLW0603 - decorators run at the import of a test and take no argument from here
    _times = times or share
    patient = [HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.filter_too_much] if times else []
    # No deadline: a busy machine is slow, which says nothing about an example.
    settings.register_profile(
        "weberlink", deadline=None, derandomize=not times, max_examples=_number(COUNT), suppress_health_check=patient
    )
    settings.load_profile("weberlink")


def examples(count: int, **others: Any) -> settings:
    """Decorate a test to use `count` examples; `others` as of `hypothesis.settings`."""
    return settings(max_examples=_number(count), **others)


def tenfold(low: float, high: float) -> st.SearchStrategy[float]:
    """Numbers > 0 of every power of ten alike."""
    return st.floats(log10(low), log10(high)).map(lambda exponent: 10.0**exponent)


def _number(count: int) -> int:
    return max(min(count, FEWEST), round(count * _times))
