"""Settings of hypothesis: the suite uses the same examples in every run; `make hunt` uses more, random ones."""

from typing import Any

from hypothesis import HealthCheck, settings

COUNT = 40
"""Examples of a test that does not set a number."""

_times = 1


def hunt(times: int) -> None:
    """Set the number and choice of examples, before any test is imported; 0 for the fixed examples."""
    global _times  # noqa: PLW0603 - decorators run at the import of a test and take no argument from here
    _times = max(1, times)
    patient = [HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.filter_too_much] if times else []
    # No deadline: a busy machine is slow, which says nothing about an example.
    settings.register_profile(
        "weberlink",
        deadline=None,
        derandomize=not times,
        max_examples=COUNT * _times,
        suppress_health_check=patient,
    )
    settings.load_profile("weberlink")


def examples(count: int, **others: Any) -> settings:
    """Decorate a test to use `count` examples; `others` as of `hypothesis.settings`."""
    return settings(max_examples=count * _times, **others)
