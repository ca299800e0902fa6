"""A link that fails stops both ends, and what it held is not executed: one of many cases of `make safety`."""

import pytest

from trials.safety.held import ALL, ALONE, WRAP_S, delay, hold
from trials.safety.run import TO_MASTER, TO_SLAVE, Case, every, run

CASES = list(every())
CHOSEN = [*CASES[: -len(CASES) // 20 : 301], *CASES[-36::7]]
"""Of the last ones, each kind: a robot that retracts, a session that ends, a slow way to either end."""


@pytest.mark.parametrize("case", CHOSEN, ids=lambda case: f"{case.fault}, {case.scheme}, {case.force}, {case.motion}")
def test_no_law_is_broken(case: Case) -> None:
    assert run(case).violations == ()


@pytest.mark.parametrize(
    ("direction", "mode", "age"), [(TO_SLAVE, ALL, 0.105), (TO_MASTER, ALONE, 0.4), (TO_MASTER, ALL, WRAP_S)]
)
def test_a_held_batch_is_executed_only_within_the_limit(direction: str, mode: str, age: float) -> None:
    row = hold(direction, mode, age)
    assert row.too_old == 0
    assert row.held > 5
    assert row.executed > 20  # before the batch and after it, the session carries updates


@pytest.mark.parametrize(("to_slave", "to_master"), [(0.152, 0.001), (0.001, 0.152)])
def test_asymmetric_path_executes_nothing_too_old(to_slave: float, to_master: float) -> None:
    assert delay(to_slave, to_master).too_old == 0


def test_a_batch_that_is_delivered_in_time_is_executed() -> None:
    assert hold(TO_SLAVE, ALONE, 0.03).oldest_ms == pytest.approx(30.0)
