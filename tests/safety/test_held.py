"""No datagram is executed that is older than the limit, whatever held it for whatever time."""

import pytest

from tests.safety.cases import TO_MASTER, TO_SLAVE
from tests.safety.held import ALL, ALONE, WRAP_S, delay, hold


@pytest.mark.parametrize(
    ("direction", "mode", "age"),
    [
        (TO_SLAVE, ALL, 0.105),
        (TO_MASTER, ALL, WRAP_S),
        *(
            pytest.param(*row, marks=pytest.mark.hunt)
            for row in (
                (TO_MASTER, ALL, 0.105),
                (TO_SLAVE, ALONE, 0.4),
                (TO_MASTER, ALL, 1.2),
                (TO_SLAVE, ALL, 3.1),
                (TO_SLAVE, ALL, WRAP_S),
            )
        ),
    ],
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
    row = hold(TO_SLAVE, ALONE, 0.03)
    assert row.oldest_ms == pytest.approx(30.0)
