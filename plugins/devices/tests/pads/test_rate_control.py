"""Rate control: the law of its module, with walls and delays in virtual time; the contract is in `test_contract`."""

from collections import deque
from collections.abc import Iterator
from math import e, hypot, pi, sqrt
from time import monotonic, sleep

import pytest
from hypothesis import given, strategies as st

from weberlink.geometry.vector import ZERO, Vector
from weberlink.testing.devices import drive
from weberlink_devices.rate_control import (
    LIVE_S,
    LONGEST_STEP,
    Deflection,
    RateDevice,
    RateOptions,
    beyond_dead_zone,
    moved,
)

TICK = 0.001
share = st.floats(-1.0, 1.0)


def pressed(depth: float, *, height: float = 0.002, delay: int = 1, seconds: float = 3.0) -> list[float]:
    """Forces [N] of a wall of 800 N/m at z = 0, ticks later, on a control that is deflected downwards by `depth`."""
    at, waiting, forces = (0.0, 0.0, height), deque([0.0] * delay), list[float]()
    for _ in range(round(seconds / TICK)):
        force = waiting.popleft()
        at = moved(at, (0.0, 0.0, -depth), (0.0, 0.0, force), TICK, RateOptions())
        waiting.append(max(0.0, -800.0 * at[2]))
        forces.append(force)
    return forces


@pytest.mark.parametrize(
    ("depth", "height", "held"), [(1.0, 0.002, 3.0), (0.55, 0.002, 1.5), (0.1, 0.002, 0.0), (0.0, -0.003, 0.0)]
)
def test_deflection_holds_its_share_of_the_push(depth: float, height: float, held: float) -> None:
    forces = pressed(depth, height=height)
    assert max(forces) <= max(held, -800.0 * height) + 1e-3
    assert forces[-1] == pytest.approx(held, abs=1e-3)


def test_force_settles_below_the_stated_delay() -> None:
    damping = RateOptions().push_n / RateOptions().speed_m_s
    aperiodic, unstable = round(damping / e / 800.0 / TICK), round(damping * pi / 2.0 / 800.0 / TICK)
    assert max(pressed(1.0, delay=aperiodic - 1)) <= 3.0 * 1.01
    late = pressed(1.0, delay=unstable * 2, seconds=10.0)
    assert max(late[-2000:]) - min(late[-2000:]) > 1.0, "the limit is one"


@given(deflection=st.tuples(share, share, share), force=st.tuples(*[st.floats(-1e6, 1e6)] * 3))
def test_speed_and_workspace_are_never_exceeded(deflection: Vector, force: Vector) -> None:
    options, after = RateOptions(), RateOptions().home_m
    for _ in range(50):
        before, after = after, moved(after, deflection, force, 0.02, options)
        assert hypot(*(b - a for a, b in zip(before, after, strict=True))) <= options.speed_m_s * 0.02 * (1 + 1e-9)
        assert max(map(abs, after)) <= options.workspace_m


@given(deflection=st.tuples(share, share, share), dead=st.floats(0.0, 0.9))
def test_dead_zone_keeps_the_direction(deflection: Vector, dead: float) -> None:
    shaped = beyond_dead_zone(deflection, dead)
    length, given_length = hypot(*shaped), hypot(*deflection)
    assert length == pytest.approx(max(0.0, min(1.0, (given_length - dead) / (1.0 - dead))))
    assert [part * given_length for part in shaped] == pytest.approx([part * length for part in deflection], abs=1e-12)


class Pushed:
    """An exchange that gives what a test sets, and hangs while it says so."""

    def __init__(self) -> None:
        self.deflection = Deflection()
        self.hangs = False
        self.felt: list[Vector] = []

    def open(self) -> Deflection:
        return self.deflection

    def exchange(self, command: Vector) -> Deflection:
        while self.hangs:
            sleep(0.001)
        self.felt.append(command)
        sleep(0.0005)
        return self.deflection

    def close(self) -> None: ...


@pytest.fixture
def exchange() -> Pushed:
    return Pushed()


@pytest.fixture
def device(exchange: Pushed) -> Iterator[RateDevice]:
    device = RateDevice("stick", RateOptions(), exchange, TICK, buttons=2, spin=pi)
    device.open(monotonic())
    yield device
    exchange.hangs = False
    device.close()


def run(device: RateDevice, seconds: float, force: Vector = ZERO) -> float:
    """The position along y afterwards."""
    until = monotonic() + seconds
    drive(device, lambda: monotonic() >= until, force)
    return device.latest(monotonic()).position[1]


def test_device_moves_turns_and_gives_way_to_the_force(device: RateDevice, exchange: Pushed) -> None:
    start = device.latest(monotonic())
    exchange.deflection = Deflection((0.0, 1.0, 0.0), (0.0, 0.0, 1.0), 0b10)
    run(device, 0.3)
    end = device.latest(monotonic())
    assert 0.0 < end.position[1] <= 0.08 * (end.at - start.at) + 1e-9  # a sum of steps is rounded
    assert (end.position[0], end.buttons, end.ended) == (start.position[0], 0b10, False)
    assert end.orientation is not None
    assert end.orientation[3] > 0.1, "about +z"
    assert sqrt(sum(part * part for part in end.orientation)) == pytest.approx(1.0)
    held = run(device, 0.1, (0.0, -3.0, 0.0))
    assert run(device, 0.1, (0.0, -3.0, 0.0)) == pytest.approx(held, abs=1e-9)
    assert (0.0, -3.0, 0.0) in exchange.felt


def test_hanging_device_makes_readings_old_and_a_long_gap_is_a_pause(device: RateDevice, exchange: Pushed) -> None:
    exchange.deflection = Deflection((0.0, 1.0, 0.0))
    before = run(device, 0.05)
    sleep(0.2)
    assert device.latest(monotonic()).position[1] - before <= 0.08 * LONGEST_STEP * 1.001
    exchange.hangs = True
    run(device, 0.1)
    old = device.latest(monotonic())
    assert monotonic() - old.at > LIVE_S
    run(device, 0.05)
    assert device.latest(monotonic()) == old
