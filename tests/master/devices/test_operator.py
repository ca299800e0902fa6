"""The computed devices: the scripted operator with its legs and its wrist, and the replay of a recording."""

from itertools import pairwise
from math import degrees, hypot, radians, sin
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, strategies as st

from tests.examples import examples
from weberlink.geometry.rotation import quaternion, vector
from weberlink.geometry.vector import ZERO, Vector, distance, norm, scale, unit
from weberlink.master.devices import DEVICES
from weberlink.master.devices.hand import modelled_hand
from weberlink.master.devices.hand_options import HandOptions, WristOptions
from weberlink.master.devices.operator import OperatorDevice, OperatorOptions
from weberlink.master.devices.replay import ReplayDevice, ReplayOptions
from weberlink.master.devices.turning import Wrist
from weberlink.testing.time import TICK

STIFFNESS = WristOptions().stiffness_n_m_rad
STIFF = HandOptions(mass_kg=0.01, damping_n_s_m=20.0, stiffness_n_m=10_000.0)
axes = st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda v: norm(v) > 0.1).map(unit)


def operator(**options: Any) -> OperatorDevice:
    device = OperatorDevice(OperatorOptions(**({"tremor_m": 0.0} | options)), TICK)
    device.open(0.0)
    return device


def test_a_script_ends_unless_it_is_repeated() -> None:
    script = [{"motion": "reach", "to_m": [0.03, 0, 0], "duration_s": 0.5}, {"motion": "rest", "duration_s": 0.5}]
    steps, once = (
        [device.latest(tick * TICK) for tick in range(1, ticks + 1)]
        for device, ticks in ((operator(script=script), 6000), (operator(script=script, repeat=False), 1100))
    )
    assert not any(step.ended for step in steps)
    assert [step.ended for step in once].index(True) in (999, 1000)
    assert all(distance(steps[i].position, (0.03, 0.0, 0.0)) < 1e-3 for i in (950, 2950, 4950))
    assert distance(steps[2050].position, (0.0, 0.0, 0.03)) < 2e-3, "back home in between"


# --- the wrist alone


@examples(30)
@given(axis=axes, step=st.floats(1e-4, 0.05), intended=st.floats(-1.0, 1.0), torque=st.floats(-1.0, 1.0))
def test_wrist_about_one_axis_matches_hand(axis: Vector, step: float, intended: float, torque: float) -> None:
    """Whose equation is solved exactly at any step."""
    like = HandOptions(mass_kg=0.002, damping_n_s_m=0.053, stiffness_n_m=2.0)
    wrist, hand = Wrist(WristOptions().oscillator), modelled_hand(like, ZERO)
    for _ in range(20):
        wrist.advance(quaternion(scale(axis, intended)), scale(axis, torque), step)
        hand.advance((intended, 0.0, 0.0), (torque, 0.0, 0.0), step)
        assert distance(vector(wrist.orientation), scale(axis, hand.position[0])) < 1e-9
        assert distance(wrist.velocity, scale(axis, hand.velocity[0])) < 1e-7


# --- the wrist on the device

CALM: dict[str, Any] = {"wrist": {"tremor_rad": 0.0}}


def turned(device: OperatorDevice, now: float) -> Vector:
    orientation = device.latest(now).orientation
    assert orientation is not None
    return vector(orientation)


@pytest.mark.parametrize("turn", [[0.0, 40.0, 0.0], [90.0, 0.0, -60.0], [0.0, 0.0, 175.0]])
def test_script_turns_the_handle(turn: list[float]) -> None:
    script = [
        {"motion": "reach", "to_m": [0.02, 0.0, 0.01], "turn_deg": turn, "duration_s": 1.0},
        {"motion": "rest", "duration_s": 0.5},
        {"motion": "turn", "turn_deg": [0, 0, 30], "duration_s": 1.0},
    ]
    device = operator(script=script, repeat=False, **CALM)
    turns = [turned(device, tick * TICK) for tick in range(1, 3501)]
    assert [degrees(part) for part in turns[1499]] == pytest.approx(turn, abs=0.5)
    assert [degrees(part) for part in turns[-1]] == pytest.approx((0.0, 0.0, 30.0), abs=0.01)
    assert device.latest(3.5).position == pytest.approx((0.02, 0.0, 0.01), abs=1e-5)
    assert max(distance(a, b) for a, b in pairwise(turns)) < 2.5 * radians(hypot(*turn)) * TICK


def test_wrist_yields_to_torque_within_device_range() -> None:
    def under(torque: float) -> Vector:
        device = operator(torque_n_m=0.2, **CALM)
        for tick in range(1, 1001):
            turn = turned(device, tick * TICK)
            device.turn((0.0, 0.0, torque), tick * TICK)
        return turn

    assert under(0.1) == pytest.approx((0.0, 0.0, 0.1 / STIFFNESS), abs=1e-4)
    assert under(1e300) == under(0.2) == pytest.approx((0.0, 0.0, 0.2 / STIFFNESS), abs=1e-4)


# --- a recording


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """Two seconds of a slow swing about (0.1, 0.2, 0.3), starting at t = 50 s."""
    path = tmp_path / "swing.csv"
    rows = [
        f"{50 + i * 0.01},{0.1 + 0.01 * sin(0.03 * i)},{0.2 + 0.00002 * i},{0.3 - 0.00003 * i},1,2,3"
        for i in range(201)
    ]
    path.write_text("\n".join(["t,px,py,pz,fx,fy,fz", *rows]) + "\n")
    return path


@pytest.mark.parametrize("scale", [1.0, 2.0])
def test_after_the_approach_it_follows_the_recording(recording: Path, scale: float) -> None:
    def swing(time: float) -> Vector:
        """The recording from its first sample moved to (0.01, 0.02, 0)."""
        i = time / 0.01
        return (0.01 + scale * 0.01 * sin(0.03 * i), 0.02 + scale * 0.00002 * i, -scale * 0.00003 * i)

    given: dict[str, Any] = {"trace": recording, "hand": STIFF, "tremor_m": 0.0, "anchor": "first", "scale": scale}
    device = ReplayDevice(ReplayOptions(**given, center_m=(0.01, 0.02, 0.0)), TICK)
    device.open(7.0)
    steps = [device.latest(7.0 + tick * TICK) for tick in range(1, 3501)]
    for tick in range(1200, 2900, 50):
        assert distance(steps[tick - 1].position, swing((tick - 1000) * TICK)) < 2e-4 * scale
    assert [reading.ended for reading in steps].index(True) in (2999, 3000)
    assert distance(steps[-1].position, swing(2.0)) < 1e-5


# --- both, in virtual time


@pytest.mark.parametrize("name", ["operator", "replay"])
def test_same_calls_give_identical_runs_and_a_long_gap_is_a_pause(name: str, recording: Path) -> None:
    def positions(seed: int) -> list[Vector]:
        driver, found = DEVICES.load(name), list[Vector]()
        needed = {"trace": recording, "center_m": ZERO} if name == "replay" else {}
        device = driver(driver.Options(**needed, seed=seed), TICK)
        for _ in range(2):  # a second session starts as afresh
            device.open(0.0)
            now = 0.0
            for tick in range(1, 1000):
                now += TICK * (1.0 + 0.3 * (tick % 3)) + (3600.0 if tick == 50 else 0.0)
                reading = device.latest(now)
                assert reading.at == now
                found.append(reading.position)
                device.command((0.0, 0.1 * (tick % 5), 0.5), now)
            device.close()
        assert found[:999] == found[999:]
        assert max(distance(a, b) for a, b in pairwise(found[:999])) < 0.02, "no jump"
        return found

    assert positions(1) == positions(1)
    assert positions(1) != positions(2)
