"""The contract that every device driver keeps, those of hardware against emulated hardware."""

from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from statistics import median
from time import monotonic

import pytest

from tests.master.devices.benches import BENCHES, FAULTS, ON_A_WIRE, RATE_CONTROLLED, RECONNECTS, Bench
from tests.wait import PATIENCE
from weberlink.geometry.vector import ZERO, Vector, distance, is_finite, norm
from weberlink.master.devices import BUILT_IN
from weberlink.master.devices.contract import DeviceFault, ReportsTrouble, TorqueDevice

FORCES: list[Vector] = [(0.5, 0.0, 0.0), (0.0, -0.5, 0.0), (0.3, 0.3, 0.3)]


@pytest.fixture(params=sorted(BENCHES))
def name(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def bench(name: str, tmp_path: Path) -> Iterator[Bench]:
    with BENCHES[name](tmp_path) as bench:
        yield bench


def test_every_driver_has_a_bench() -> None:
    assert set(BENCHES) == set(BUILT_IN)


def test_the_spec_is_there_before_opening(name: str, bench: Bench) -> None:
    spec = bench.device.spec
    assert spec.name == name
    assert spec.axes
    assert set(spec.axes) <= set("xyz")
    assert (spec.force_n > 0.0) == spec.force_feedback
    assert spec.torque_n_m >= 0.0
    assert spec.torque_n_m == 0.0 or (spec.orientation and isinstance(bench.device, TorqueDevice))
    assert spec.rate_hz > 0.0
    lower, upper = spec.workspace_m
    assert all(a < b for a, b in zip(lower, upper, strict=True))
    assert "\n" not in spec.note


def test_only_open_device_is_read_close_is_idempotent(name: str, bench: Bench) -> None:
    device = bench.device
    device.close()
    with pytest.raises(DeviceFault, match=name):
        device.latest(bench.tick())
    device.command(ZERO, bench.tick())
    for _ in range(2):  # a second session is like the first
        now = bench.tick()
        device.open(now)
        assert device.latest(bench.tick()).at >= now
        device.close()
        device.close()
        device.command(ZERO, bench.tick())
        with pytest.raises(DeviceFault, match=name):
            device.latest(bench.tick())


def test_readings_advance_without_jumps(bench: Bench) -> None:
    device = bench.device
    device.open(bench.tick())
    lower, upper = device.spec.workspace_m
    readings, away = [], [0.0]
    for now in bench.hold(ZERO, 1000 if bench.displayed is None else 300):
        reading = device.latest(now)
        assert device.latest(now) == reading
        assert reading.at <= (now if bench.displayed is None else monotonic()), "not of the future"
        assert is_finite(reading.position)
        assert all(a <= p <= b for a, p, b in zip(lower, reading.position, upper, strict=True))
        assert (reading.orientation is not None) == device.spec.orientation
        assert 0 <= reading.buttons < 1 << device.spec.buttons
        if bench.hand is not None:
            away.append(distance(bench.hand(), reading.position))
        readings.append(reading)
    # In real time an answer may have waited for a machine that stalls, and the hand has gone on.
    slack = 1e-6 if bench.displayed is None else 0.03
    for a, b in pairwise(readings):
        assert a.at <= b.at
        step = max(abs(p - q) for p, q in zip(a.position, b.position, strict=True))
        assert step <= 0.6 * (b.at - a.at) + slack, "a hand's speed"
    assert readings[0].position != readings[-1].position
    assert median(away) < 0.005, "the hand goes on while this machine stalls"


def test_force_that_is_not_finite_raises(bench: Bench) -> None:
    bench.device.open(bench.tick())
    with pytest.raises(ValueError, match="not finite"):
        bench.device.command((0.0, float("inf"), 0.0), bench.tick())
    assert is_finite(bench.device.latest(bench.tick()).position)


@pytest.mark.parametrize("name", ON_A_WIRE)
def test_motors_follow_commands_within_limit_until_close(bench: Bench) -> None:
    device, felt, displayed = bench.device, bench.felt, bench.displayed
    assert displayed is not None
    device.open(bench.tick())
    for force in FORCES:
        x, y, z = (part if axis in device.spec.axes else 0.0 for axis, part in zip("xyz", force, strict=True))
        if felt is not None:
            wait(bench, force, lambda felt=felt, along=(x, y, z): distance(felt(), along) < 0.05)
        else:
            wait(bench, force, lambda along=(x, y, z): abs(displayed() - norm(along)) < 0.05)
    forces: list[float] = []

    def is_at_the_limit() -> bool:
        forces.append(displayed())
        return forces[-1] > 0.5 * device.spec.force_n

    for _ in range(20):  # 20 ms there at the least
        wait(bench, (100.0, -100.0, 100.0), is_at_the_limit)
    assert max(forces) <= device.spec.force_n * 1.1 + 0.02
    device.close()
    assert displayed() == 0.0


@pytest.mark.parametrize("name", ON_A_WIRE)
def test_without_checked_signs_the_motors_stay_off(name: str, tmp_path: Path) -> None:
    with BENCHES[name](tmp_path, checked=False) as bench:
        bench.device.open(bench.tick())
        assert bench.felt is not None
        for now in bench.hold((1.0, -1.0, 1.0), 100):
            bench.device.latest(now)
            assert bench.felt() == ZERO


@pytest.mark.parametrize("name", ON_A_WIRE)
def test_silent_loop_ends_the_force(bench: Bench) -> None:
    device, displayed = bench.device, bench.displayed
    assert displayed is not None
    device.open(bench.tick())
    wait(bench, (0.0, 1.0, 0.0), lambda: displayed() > 0.5)
    gives_up = monotonic() + PATIENCE
    while displayed() > 0.0:
        assert monotonic() < gives_up
        bench.tick()


@pytest.mark.realtime  # a jump of the position is known by its speed, which a stalled host cannot tell
@pytest.mark.parametrize(("name", "fault"), FAULTS)
def test_fault_ends_session_with_reason_without_force(name: str, fault: str, bench: Bench) -> None:
    device, displayed = bench.device, bench.displayed
    assert displayed is not None
    device.open(bench.tick())
    start = device.latest(bench.tick()).position
    wait(bench, (0.0, 1.0, 0.0), lambda: displayed() > 0.5)
    # Far from where it was switched on, so that a device which has lost its place says something else than before.
    wait(bench, (0.0, 1.0, 0.0), lambda: distance(device.latest(bench.tick()).position, start) > 0.02)
    bench.faults[fault]()
    gives_up = monotonic() + PATIENCE
    with pytest.raises(DeviceFault, match=name) as caught:
        while monotonic() < gives_up:
            for now in bench.hold((0.0, 1.0, 0.0), 1):
                device.latest(now)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) > len(name) + 10, "says why"
    gives_up = monotonic() + PATIENCE
    while displayed() > 0.0 and not unheard(name, fault):
        assert monotonic() < gives_up
        device.command((0.0, 1.0, 0.0), bench.tick())
    with pytest.raises(DeviceFault):
        device.latest(bench.tick())


@pytest.mark.parametrize("name", [name for name, fault in FAULTS if fault == "garbled" and name != "force_dimension"])
def test_passing_garbled_answers_interrupt_the_force(bench: Bench) -> None:
    device, displayed = bench.device, bench.displayed
    assert displayed is not None
    device.open(bench.tick())
    wait(bench, (0.0, 1.0, 0.0), lambda: displayed() > 0.9)
    bench.faults["flicker"]()
    wait(bench, (0.0, 1.0, 0.0), lambda: displayed() == 0.0)
    wait(bench, (0.0, 1.0, 0.0), lambda: displayed() > 0.9)


@pytest.mark.parametrize("name", RECONNECTS)
def test_replugged_device_goes_on_and_its_force_ramps_from_zero(name: str, tmp_path: Path) -> None:
    with BENCHES[name](tmp_path, reconnect_s=PATIENCE) as bench:
        device, displayed, forces = bench.device, bench.displayed, [0.0]
        assert displayed is not None
        device.open(bench.tick())
        wait(bench, (0.0, 1.0, 0.0), lambda: displayed() > 0.9)
        bench.faults["unplug"]()
        # Behind a cut wire nothing hears of it; the reading stays as it was.
        wait(bench, ZERO, lambda: isinstance(device, ReportsTrouble) and device.trouble is not None)
        bench.faults["plug"]()
        wait(bench, (0.0, 1.0, 0.0), lambda: displayed() == 0.0)

        def is_back() -> bool:
            forces.append(displayed())
            return forces[-1] > 0.9

        wait(bench, (0.0, 1.0, 0.0), is_back)
        assert any(0.05 < force < 0.7 for force in forces), "on the way up"


@pytest.mark.parametrize("name", RATE_CONTROLLED)
def test_unplugged_device_is_a_fault_in_time(name: str, bench: Bench) -> None:
    device = bench.device
    device.open(bench.tick())
    start = device.latest(bench.tick()).position
    wait(bench, ZERO, lambda: distance(device.latest(bench.tick()).position, start) > 0.005)
    bench.faults["unplug"]()
    unplugged_at = monotonic()
    with pytest.raises(DeviceFault, match=f"{name}: /dev/.*: unplugged"):
        while monotonic() < unplugged_at + PATIENCE:
            device.latest(bench.tick())
    assert monotonic() - unplugged_at < 0.5
    device.close()


@pytest.mark.parametrize("name", RATE_CONTROLLED)
def test_force_slows_a_rate_controlled_device(name: str, bench: Bench) -> None:
    device = bench.device
    assert device.spec.push_n > 0.0
    device.open(bench.tick())
    wait(bench, (0.0, 0.0, 100.0), lambda: device.latest(bench.tick()).position[2] == device.spec.workspace_m[1][2])
    wait(bench, (0.0, 0.0, -100.0), lambda: device.latest(bench.tick()).position[2] == device.spec.workspace_m[0][2])


def unheard(name: str, fault: str) -> bool:
    """A board without a watchdog whose wire is cut: no host can help, and the driver's note says so."""
    return fault == "unplug" and name in ("haply_2diy", "touch")


def wait(bench: Bench, force: Vector, condition: object) -> None:
    """Command a force until a condition holds."""
    assert callable(condition)
    gives_up = monotonic() + PATIENCE
    while not condition():
        assert monotonic() < gives_up
        for now in bench.hold(force, 1):
            bench.device.latest(now)
