"""The account of a display: its bound, whatever is asked for, and how the force behaves within it."""

from math import inf
from random import Random

import pytest
from hypothesis import given, strategies as st

from tests.control.wall import ACCOUNT, SETTINGS, TICK, Wall
from tests.examples import examples
from weberlink.control.account import Account
from weberlink.control.axes import HANDLE, LEVER, BoundedAxes, build_axes
from weberlink.control.bounded import BoundedMaster
from weberlink.control.contract import CREDIT_STEP

STIFFNESS = 500.0


@given(seed=st.integers(0, 2**32), stiffness=st.floats(10.0, 1e5), fastest=st.floats(0.0, 2.0))
@examples(60)
def test_no_force_that_is_asked_for_gives_more_than_the_bound(seed: int, stiffness: float, fastest: float) -> None:
    """A hand that moves with the force whenever that gains energy, and turns as it likes; with interruptions."""
    random, account = Random(seed), Account(ACCOUNT)
    given_out = most = way = force = 0.0
    allowed = ACCOUNT.allowance
    for tick in range(2000):
        if tick % 50 == 49 and seed % 2:
            account.resume()
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


@given(seed=st.integers(0, 2**32), fastest=st.floats(0.05, 1.0), rtt=st.floats(0.0, 0.7), supplies=st.booleans())
@examples(60)
def test_no_update_makes_a_hand_get_more_than_the_bound(seed: int, fastest: float, rtt: float, supplies: bool) -> None:
    """Of any force and surface, right or wrong. It goes where it gains, and a limit shows less than is asked for."""
    random, master = Random(seed), BoundedMaster(SETTINGS)
    stiffness, limit = 10.0 ** random.uniform(1.0, 6.0), random.choice((0.5, 1.0))
    hand = force = given_out = most = 0.0
    allowed, credit = ACCOUNT.allowance, 0
    for tick in range(1500):
        if tick % 400 == 399 and seed % 5 == 0:
            master.resume(credit)
        way = fastest * TICK * random.uniform(-0.1, 1.0) * (-3.0 if seed % 3 == 0 and tick % 200 >= 150 else 1.0)
        hand, given, more = hand + way, force * way, random.choice((0, 0, 0, 10)) if supplies else 0
        credit += more
        if random.random() < 0.3:
            surface = Wall(stiffness * random.uniform(0.5, 2.0), hand + 0.02)
            pushed = surface.at(0.0, (0.0, 0.0, hand))
            master.learn(random.choice((surface, None)), pushed, (0.0, 0.0, hand + random.uniform(-0.002, 0.002)))
        master.observe((0.0, 0.0, hand), TICK, tick, credit, rtt)
        given_out, most = given_out + given, max(most, given)
        allowed += ACCOUNT.refill * TICK + ACCOUNT.damping * way * way / TICK + CREDIT_STEP * more
        assert given_out <= allowed + most + 1e-12
        master.command((0.0, 0.0, hand))
        force = limit * master.render((0.0, 0.0, random.choice((10.0, 30.0))))[2]
        master.displayed((0.0, 0.0, force))


@pytest.mark.parametrize("supplied", [0.0, 0.01])
def test_a_force_that_the_hand_has_not_pressed_in_rises(supplied: float) -> None:
    """Nor does what the scene supplies make it jump."""
    account = Account(ACCOUNT)
    account.share(0.0, STIFFNESS, TICK)
    account.book(0.0, 0.0, 0.0, supplied)
    forces = [3.0 * account.share(3.0, STIFFNESS, TICK) for _ in range(60)]
    assert forces[:30] == pytest.approx([ACCOUNT.rise * TICK * tick for tick in range(1, 31)])
    assert forces[-1] == 3.0


@pytest.mark.parametrize(
    ("booked", "energy"),
    [
        ([(0.005, 0.0, 0.0, 0.0)], 0.015),  # no time, no refill
        ([(0.005, 0.0, 0.1, 0.0)], 0.016), ([(0.005, 1e-6, 1e-3, 0.0)], 0.01601), ([(0.005, 0.0, 9.0, 0.0)], 0.02),
        ([(0.0, 1e-6, 1e-3, 0.0)], 0.02), ([(-0.003, 1e-6, 1e-3, 0.0)], 0.023),  # what was pressed in is on top
        ([(0.001, 0.0, 0.0, 0.004)], 0.023), ([(0.025, 0.0, 0.0, 0.0)], -0.005),
        ([(0.025, 0.0, 0.1, 0.0)], -0.004), ([(0.01, 0.0, 0.0, 0.0), (-0.01, 0.0, 0.0, 0.0)], 0.02),
    ],
)  # fmt: skip
def test_an_account_adds_up(booked: list[tuple[float, float, float, float]], energy: float) -> None:
    account = Account(ACCOUNT)
    for each in booked:
        account.book(*each)
    assert account.energy == pytest.approx(energy)


@pytest.mark.parametrize(
    ("given", "asked", "softest", "share", "left"),
    [
        (0.0, 0.0, inf, 1.0, 0.02), (0.0, 0.08, inf, 1.0, 0.02), (0.0, 0.16, inf, 0.5, 0.02),  # it rises by 80 N/s
        (-0.1, 0.0, inf, 1.0, 0.02),  # without a force nothing beyond the allowance is kept,
        (-5.0, 2.0, inf, 1.0, 0.024), (-5.0, 2.0, 100.0, 1.0, 0.04),  # and with one what its contact can store
        (-5.0, 2.0, 1000.0, 1.0, 0.024), (0.02, 2.0, inf, 0.0, 0.0), (0.03, 2.0, inf, 0.0, -0.01),
    ],
)  # fmt: skip
def test_a_share_is_what_the_account_pays_for(
    given: float, asked: float, softest: float, share: float, left: float
) -> None:
    account = Account(ACCOUNT)
    account.book(given, 0.0, 0.0)
    assert account.share(asked, STIFFNESS, TICK, softest) == pytest.approx(share)
    assert account.energy == pytest.approx(left)


def test_an_interruption_takes_the_energy_and_keeps_a_debt() -> None:
    """What it took is back with half a watt; what is asked for then begins at zero."""
    account = Account(ACCOUNT)
    account.resume()
    assert (account.energy, account.share(1.0, STIFFNESS, TICK)) == (0.0, 0.0)
    account.book(0.0, 0.0, 0.01)
    assert account.energy == pytest.approx(0.005)
    account.book(0.0, 0.0, 1.0)
    assert account.energy == pytest.approx(ACCOUNT.allowance)
    account.book(0.023, 0.0, 0.0)
    account.resume()
    assert account.energy == pytest.approx(-0.003)
    account.reset()
    assert account.energy == ACCOUNT.allowance
    account.book(0.0, 0.0, 1.0)
    assert account.energy == ACCOUNT.allowance


# Torques: one account of all axes.


@pytest.mark.parametrize("seed", range(5))
def test_no_torques_give_more_than_the_bound(seed: int) -> None:
    """Joints that move with the torques on them, whatever is asked for."""
    random, axes = Random(seed), BoundedAxes(LEVER, ACCOUNT)
    angles, torques = (0.0,) * 7, (0.0,) * 7
    out = most = 0.0
    allowed = ACCOUNT.allowance
    for _ in range(3000):
        ways = [2.0 * TICK * random.uniform(-0.1, 1.0) * (1.0 if torque >= 0.0 else -1.0) for torque in torques]
        given = sum(torque * way for torque, way in zip(torques, ways, strict=True))
        angles = tuple(angle + way for angle, way in zip(angles, ways, strict=True))
        axes.observe(angles, TICK, 0.0, 0, None)
        out, most = out + given, max(most, given)
        allowed += ACCOUNT.refill * TICK + ACCOUNT.damping * LEVER**2 * sum(way * way for way in ways) / TICK
        assert out <= allowed + most + 1e-9
        torques = axes.render(tuple(random.uniform(-2.0, 2.0) for _ in range(7)))
        axes.displayed(torques)
    assert out > ACCOUNT.allowance


@pytest.mark.parametrize("lever", [LEVER, HANDLE])
def test_torques_come_to_the_account_by_their_lever(lever: float) -> None:
    """A work of 5 mJ on both axes, less what a light damper at the lever gives back."""
    assert build_axes("none", lever, ACCOUNT).render((3.0, -2.0)) == (3.0, -2.0)
    axes = build_axes("bounded", lever, ACCOUNT)
    axes.observe((0.0, 0.0), TICK, 0.0, 0, None)
    axes.displayed((1.0, -2.0))
    axes.observe((0.003, -0.001), TICK, 0.0, 0, None)
    back = ACCOUNT.refill * TICK + ACCOUNT.damping * lever**2 * (0.003**2 + 0.001**2) / TICK
    assert axes.energy == pytest.approx(ACCOUNT.allowance - 0.005 + back)
    axes.resume(0)
    assert axes.energy == 0.0
    assert axes.render((3.0, 4.0)) == (0.0, 0.0)
    axes.reset()
    axes.observe((9.0, 9.0), TICK, 0.0, 0, None)
    rises = ACCOUNT.rise * TICK * lever / 5.0
    assert axes.render((3.0, 4.0)) == pytest.approx((3.0 * rises, 4.0 * rises))
