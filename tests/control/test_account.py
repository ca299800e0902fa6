"""The account of a display: its bound, whatever is asked for, and how the force behaves within it."""

from math import sqrt
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.control.teleoperation import ACCOUNT, TICK
from tests.examples import examples
from weberlink.control.account import Account

STIFFNESS = 500.0


@given(seed=st.integers(0, 2**32), stiffness=st.floats(10.0, 1e5), fastest=st.floats(0.0, 2.0))
@examples(60)
def test_no_force_that_is_asked_for_gives_more_than_the_bound(seed: int, stiffness: float, fastest: float) -> None:
    """A hand that moves with the force whenever that gains energy, and turns as it likes."""
    random, account = Random(seed), Account(ACCOUNT)
    given_out = most = way = force = 0.0
    allowed = ACCOUNT.allowance
    for _ in range(2000):
        given = force * way
        supplied = random.choice((0.0, 0.0, 0.0, 1e-3))
        account.book(given, way * way, TICK, supplied)
        given_out += given
        most = max(most, given)
        allowed += ACCOUNT.refill * TICK + ACCOUNT.damping * way * way / TICK + supplied
        assert given_out <= allowed + most + 1e-12
        asked = random.uniform(0.0, 30.0)
        force = asked * account.share(asked, stiffness, TICK)
        way = fastest * TICK * random.uniform(-0.1, 1.0)


def pushed_out(stiffness: float, depth: float) -> float:
    """Energy that the hand gets from a wall that appears at a depth [m] and pushes it out slowly [J]."""
    account, out = Account(ACCOUNT), 0.0
    account.share(0.0, stiffness, TICK)
    held, before = 0.0, depth
    for step in range(4000):
        now = max(0.0, depth * (1.0 - step / 4000))
        given = held * (before - now)
        out += given
        account.book(given, (before - now) ** 2, TICK)
        held, before = stiffness * now * account.share(stiffness * now, stiffness, TICK), now
    return out


def test_a_wall_within_the_allowance_is_displayed_whole() -> None:
    depth = sqrt(2.0 * 0.5 * ACCOUNT.allowance / STIFFNESS)
    assert pushed_out(STIFFNESS, depth) == pytest.approx(0.5 * ACCOUNT.allowance, rel=0.05)


def test_a_wall_beyond_it_is_displayed_in_part() -> None:
    assert pushed_out(STIFFNESS, 0.03) == pytest.approx(ACCOUNT.allowance + 4.0 * ACCOUNT.refill, rel=0.1)


def test_what_the_hand_presses_in_is_displayed_at_once() -> None:
    account, held = Account(ACCOUNT), 0.0
    for step in range(1, 200):
        account.book(-held * 1e-4, 1e-8, TICK)
        assert account.share(STIFFNESS * 1e-4 * step, STIFFNESS, TICK) == 1.0
        held = STIFFNESS * 1e-4 * step


def test_a_force_that_the_hand_has_not_pressed_in_rises() -> None:
    account = Account(ACCOUNT)
    account.share(0.0, STIFFNESS, TICK)
    forces = [3.0 * account.share(3.0, STIFFNESS, TICK) for _ in range(60)]
    assert forces[:30] == pytest.approx([ACCOUNT.rise * TICK * tick for tick in range(1, 31)])
    assert forces[-1] == 3.0


def test_what_friction_took_is_not_kept() -> None:
    account = Account(ACCOUNT)
    account.book(-5.0, 0.0, TICK)
    account.share(2.0, STIFFNESS, TICK)
    assert account.energy == pytest.approx(ACCOUNT.allowance + 0.5 * 4.0 / STIFFNESS)


def test_an_interruption_leaves_no_energy_and_keeps_a_debt() -> None:
    account = Account(ACCOUNT)
    account.resume()
    assert account.energy == 0.0
    account.book(0.003, 0.0, 0.0)
    account.resume()
    assert account.energy == pytest.approx(-0.003)
    assert account.share(1.0, STIFFNESS, TICK) == 0.0
    account.reset()
    assert account.energy == ACCOUNT.allowance


def test_what_an_interruption_took_is_back_soon_after_it() -> None:
    account = Account(ACCOUNT)
    account.resume()
    levels = []
    for _ in range(200):
        account.book(0.0, 0.0, TICK)
        levels.append(account.energy)
    assert levels[0] < 1e-3
    assert levels[-1] == pytest.approx(ACCOUNT.allowance)


def test_many_interruptions_add_nothing_to_the_bound() -> None:
    account, out = Account(ACCOUNT), 0.0
    for tick in range(5000):
        if tick % 50 == 0:
            account.resume()
        given = 10.0 * account.share(10.0, STIFFNESS, TICK) * 1e-4
        account.book(given, 1e-8, TICK)
        out += given
    assert out <= ACCOUNT.allowance + 5.0 * (ACCOUNT.refill + ACCOUNT.damping * 1e-2) + 1e-3
