"""The registry of control schemes: what each entry builds and imports."""

import pytest

from tests.control.teleoperation import ACCOUNT
from tests.control.walls import Wall
from weberlink.codec.sample import UNKNOWN
from weberlink.control.contract import SchemeParameters
from weberlink.control.table import SCHEMES, build_master_control

PARAMETERS = SchemeParameters(1e-3, 2500.0, ACCOUNT)


@pytest.mark.parametrize("name", [name for name, scheme in SCHEMES.items() if not scheme.reads_position])
def test_a_scheme_that_does_not_read_positions_does_the_same_without_them(name: str) -> None:
    ends = [build_master_control(name, PARAMETERS) for _ in range(2)]
    for tick in range(50):
        force, hand = (0.0, 0.0, 0.1 * tick), (0.0, 0.0, -1e-4 * tick)
        displayed = []
        for end, position in zip(ends, (hand, UNKNOWN), strict=True):
            end.learn(Wall() if tick % 3 == 1 else None, force, position)
            end.observe(hand, 1e-3, tick, 10 * tick, 0.01)
            displayed += [end.command(hand), end.render(force)]
            end.displayed(displayed[-1])
        assert displayed[:2] == displayed[2:]
