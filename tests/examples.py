"""What hypothesis tries: the same examples in every run of the suite, others and more of them where one hunts.

A run that says whether a change is sound must not say it by chance; what chance finds is found by `make hunt`.
"""

from typing import Any

from hypothesis import HealthCheck, settings

COUNT = 100
"""Of a test that does not say how many."""

_times = 1


def hunt(times: int) -> None:
    """Before any test is imported: so many times the examples, chosen by chance; for 0 once, and always the same."""
    global _times  # noqa: PLW0603 - decorators are evaluated by the import of a test, and no argument reaches them
    _times = max(1, times)
    patient = [HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.filter_too_much] if times else []
    # A machine that is busy with other work is slow, which says nothing about an example.
    settings.register_profile(
        "weberlink",
        deadline=None,
        derandomize=not times,
        max_examples=COUNT * _times,
        suppress_health_check=patient,
    )
    settings.load_profile("weberlink")


def examples(count: int, **others: Any) -> settings:
    """Decorator of a test that is worth `count` examples; `others` as of `hypothesis.settings`."""
    return settings(max_examples=count * _times, **others)
