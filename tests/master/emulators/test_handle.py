"""The handle of an emulated device goes where a hand takes it, and where the force pushes that hand."""

from itertools import pairwise

import pytest

from weberlink.geometry.vector import ZERO, distance, subtract
from weberlink.master.devices.operator import OperatorDevice
from weberlink.master.emulators.handle import CARRY_M_S, STEP, Handle, HandleOptions

TICK = 0.001


def test_handle_moves_like_operator_about_its_origin() -> None:
    origin = (0.01, -0.02, 0.03)
    options = HandleOptions(origin_m=origin, seed=7)
    handle, operator = Handle(options), OperatorDevice(options, STEP)
    operator.open(50.0)
    forces = [(0.0, 0.1 * (i % 9), -0.5) for i in range(1500)]
    moved = 0.0
    for tick, force in enumerate(forces):
        now = 50.0 + tick * TICK
        operator.command(force, now)
        expected = operator.latest(now).position
        assert subtract(handle.advance(force, now), origin) == pytest.approx(expected, abs=1e-15)
        moved = max(moved, distance(expected, options.home_m))
    assert moved > 0.02


def test_carried_handle_returns_without_a_jump() -> None:
    handle = Handle(HandleOptions.model_validate({"script": [{"motion": "rest"}], "tremor_m": 0.0}))
    script, home = handle.position, (0.05, 0.02, 0.2)
    ways = [handle.advance(ZERO, 0.0)]
    handle.carry(home)
    assert not handle.arrived
    ways += [handle.advance((9.0, 9.0, 9.0), tick * TICK) for tick in range(1, 2000)]
    assert handle.arrived
    assert handle.position == home
    handle.carry(None)
    ways += [handle.advance(ZERO, tick * TICK) for tick in range(2000, 4000)]
    assert handle.arrived
    assert handle.position == pytest.approx(script, abs=1e-9)
    assert max(distance(a, b) for a, b in pairwise(ways)) < 1.001 * CARRY_M_S * TICK
