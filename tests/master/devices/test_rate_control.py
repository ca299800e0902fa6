"""Rate control: the law of its module, with walls, delays and readings in virtual time."""

from collections import deque
from collections.abc import Iterator
from itertools import pairwise
from math import e, hypot, pi, sqrt
from statistics import median
from time import monotonic, sleep

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.wait import PATIENCE
from weberlink.geometry.vector import ZERO, Vector
from weberlink.hardware.fault import HardwareFault
from weberlink.master.devices.contract import DeviceFault
from weberlink.master.devices.rate_control import (
    LIVE_S,
    LONGEST_STEP,
    Deflection,
    RateControl,
    RateDevice,
    RateOptions,
    beyond_dead_zone,
)

TICK = 0.001
share = st.floats(-1.0, 1.0)


def pressed(depth: float, *, stiffness: float = 800.0, delay: int = 1, seconds: float = 3.0) -> list[float]:
    """Forces [N] of a wall at z = 0, ticks later, on a control that is deflected downwards by `depth`."""
    control, waiting, forces = RateControl(RateOptions(home_m=(0.0, 0.0, 0.002))), deque([0.0] * delay), []
    for _ in range(round(seconds / TICK)):
        force = waiting.popleft()
        z = control.advance((0.0, 0.0, -depth), (0.0, 0.0, force), TICK)[2]
        waiting.append(max(0.0, -stiffness * z))
        forces.append(force)
    return forces


@pytest.mark.parametrize(("depth", "held"), [(1.0, 3.0), (0.55, 1.5), (0.1, 0.0)])
def test_deflection_holds_its_share_of_the_push(depth: float, held: float) -> None:
    forces = pressed(depth)
    assert max(forces) <= held + 1e-3
    assert forces[-1] == pytest.approx(held, abs=1e-3)


def test_force_settles_below_the_stated_delay() -> None:
    damping = RateOptions().push_n / RateOptions().speed_m_s
    aperiodic, unstable = round(damping / e / 800.0 / TICK), round(damping * pi / 2.0 / 800.0 / TICK)
    assert max(pressed(1.0, delay=aperiodic - 1)) <= 3.0 * 1.01
    late = pressed(1.0, delay=unstable * 2, seconds=10.0)
    assert max(late[-2000:]) - min(late[-2000:]) > 1.0, "the limit is one"


def test_released_control_gives_way_until_no_force() -> None:
    control = RateControl(RateOptions(home_m=(0.0, 0.0, -0.004)))
    for _ in range(1000):
        control.advance(ZERO, (0.0, 0.0, max(0.0, -800.0 * control.position[2])), TICK)
    assert control.position[2] == pytest.approx(0.0, abs=1e-6)


@given(deflection=st.tuples(share, share, share), force=st.tuples(*[st.floats(-1e6, 1e6)] * 3))
def test_speed_and_workspace_are_never_exceeded(deflection: Vector, force: Vector) -> None:
    options = RateOptions()
    control = RateControl(options)
    for _ in range(50):
        before = control.position
        after = control.advance(deflection, force, 0.02)
        assert hypot(*(b - a for a, b in zip(before, after, strict=True))) <= options.speed_m_s * 0.02 * (1 + 1e-9)
        assert max(map(abs, after)) <= options.workspace_m


@given(deflection=st.tuples(share, share, share), dead=st.floats(0.0, 0.9))
def test_dead_zone_keeps_the_direction(deflection: Vector, dead: float) -> None:
    shaped = beyond_dead_zone(deflection, dead)
    length, given_length = hypot(*shaped), hypot(*deflection)
    assert length <= 1.0 + 1e-12
    assert (length == 0.0) == (given_length <= dead) or given_length - dead < 1e-9
    cross = (
        deflection[1] * shaped[2] - deflection[2] * shaped[1],
        deflection[2] * shaped[0] - deflection[0] * shaped[2],
        deflection[0] * shaped[1] - deflection[1] * shaped[0],
    )
    assert hypot(*cross) < 1e-12


class Pushed:
    """An exchange that gives what a test sets, and fails with what it sets."""

    def __init__(self) -> None:
        self.deflection = Deflection()
        self.fault: HardwareFault | None = None
        self.hangs = False
        self.felt: list[Vector] = []

    def open(self) -> Deflection:
        return self.deflection

    def exchange(self, command: Vector) -> Deflection:
        while self.hangs:
            sleep(0.001)
        if self.fault is not None:
            raise self.fault
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


def run(device: RateDevice, seconds: float, force: Vector = ZERO) -> None:
    until = monotonic() + seconds
    while (now := monotonic()) < until:
        device.latest(now)
        device.command(force, now)
        sleep(0.001)


def test_device_moves_turns_and_reports_buttons(device: RateDevice, exchange: Pushed) -> None:
    start = device.latest(monotonic())
    exchange.deflection = Deflection((0.0, 1.0, 0.0), (0.0, 0.0, 1.0), 0b10)
    run(device, 0.3)
    end = device.latest(monotonic())
    assert 0.0 < end.position[1] <= 0.08 * (end.at - start.at)
    assert end.position[0] == start.position[0]
    assert end.buttons == 0b10
    assert end.orientation is not None
    assert end.orientation[3] > 0.1, "about +z"
    assert sqrt(sum(part * part for part in end.orientation)) == pytest.approx(1.0)


def test_force_resists_and_reaches_the_exchange(device: RateDevice, exchange: Pushed) -> None:
    exchange.deflection = Deflection((0.0, 1.0, 0.0))
    run(device, 0.1, (0.0, -3.0, 0.0))
    held = device.latest(monotonic()).position[1]
    run(device, 0.1, (0.0, -3.0, 0.0))
    assert device.latest(monotonic()).position[1] == pytest.approx(held, abs=1e-9)
    assert (0.0, -3.0, 0.0) in exchange.felt
    device.close()
    assert device.spec.push_n == 3.0


def test_fault_of_the_device_ends_readings(device: RateDevice, exchange: Pushed) -> None:
    exchange.fault = HardwareFault("/dev/stick: unplugged")
    with pytest.raises(DeviceFault, match=r"^stick: /dev/stick: unplugged$"):
        run(device, PATIENCE)
    device.close()
    with pytest.raises(DeviceFault, match="not open"):
        device.latest(monotonic())


def test_hanging_device_makes_readings_old(device: RateDevice, exchange: Pushed) -> None:
    exchange.deflection = Deflection((0.0, 1.0, 0.0))
    run(device, 0.05)
    exchange.hangs = True
    run(device, 0.1)
    now = monotonic()
    old = device.latest(now)
    assert now - old.at > LIVE_S
    run(device, 0.05)
    assert device.latest(monotonic()) == old


def test_long_gap_pauses_without_a_jump(device: RateDevice, exchange: Pushed) -> None:
    exchange.deflection = Deflection((1.0, 0.0, 0.0))
    run(device, 0.05)
    before = device.latest(monotonic()).position[0]
    sleep(0.2)
    assert device.latest(monotonic()).position[0] - before <= 0.08 * LONGEST_STEP * 1.001


@pytest.mark.parametrize("rate_hz", [20.0, 1000.0])
def test_speed_does_not_depend_on_the_rate(rate_hz: float, exchange: Pushed) -> None:
    options = RateOptions(workspace_m=1.0)
    device = RateDevice("stick", options, exchange, 1.0 / rate_hz, buttons=2)
    exchange.deflection = Deflection((0.0, 1.0, 0.0))
    device.open(monotonic())
    readings = []
    for _ in range(8):
        sleep(1.0 / rate_hz)
        readings.append(device.latest(monotonic()))
    device.close()
    speeds = [(b.position[1] - a.position[1]) / (b.at - a.at) for a, b in pairwise(readings)]
    assert median(speeds) == pytest.approx(options.speed_m_s)
