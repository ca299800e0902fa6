"""A hand that turns: closed form about one axis, energy about any, and the loop with a spring that turns it back."""

from itertools import pairwise
from math import degrees, radians
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.examples import examples
from weberlink.geometry.rotation import IDENTITY, Quaternion, inverse, product, quaternion, vector
from weberlink.geometry.vector import ZERO, Vector, distance, dot, norm, scale, unit
from weberlink.master.devices.contract import TorqueDevice
from weberlink.master.devices.hand import modelled_hand
from weberlink.master.devices.hand_options import HandOptions, Oscillator, WristOptions
from weberlink.master.devices.operator import OperatorDevice, OperatorOptions
from weberlink.master.devices.turning import Wrist

TICK = 0.001
STIFFNESS = WristOptions().stiffness_n_m_rad
CALM: dict[str, Any] = {"tremor_m": 0.0, "wrist": {"tremor_rad": 0.0}}
axes = st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda v: norm(v) > 0.1).map(unit)


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


@examples(15)
@given(axes, st.floats(0.0, 0.5), axes, st.floats(0.0, 3.0))
def test_it_yields_by_torque_over_stiffness(about: Vector, torque: float, axis: Vector, angle: float) -> None:
    wrist, intended = Wrist(WristOptions().oscillator), quaternion(scale(axis, angle))
    for _ in range(3000):
        wrist.advance(intended, scale(about, torque), TICK)
    away = vector(product(wrist.orientation, inverse(intended)))
    assert away == pytest.approx(scale(about, torque / STIFFNESS), abs=1e-6)


def energy(wrist: Wrist, intended: Quaternion, oscillator: Oscillator) -> float:
    away = vector(product(wrist.orientation, inverse(intended)))
    turning, spring = 0.5 * oscillator.inertia, 0.5 * oscillator.stiffness
    return turning * dot(wrist.velocity, wrist.velocity) + spring * dot(away, away)


@examples(15)
@given(axes, st.floats(0.1, 2.5), axes, st.floats(0.0, 30.0), st.floats(0.02, 1.0))
def test_left_alone_it_loses_energy_and_gains_none(
    axis: Vector, angle: float, spin: Vector, speed: float, damping: float
) -> None:
    oscillator = WristOptions(damping_n_m_s_rad=damping).oscillator
    wrist = Wrist(oscillator)
    wrist.orientation, wrist.velocity = quaternion(scale(axis, angle)), scale(spin, speed)
    before = first = energy(wrist, IDENTITY, oscillator)
    for _ in range(1000):
        wrist.advance(IDENTITY, ZERO, TICK)
        now = energy(wrist, IDENTITY, oscillator)
        assert now <= before + 2e-3 * first, "the step is small, not infinitely small"
        before = now
    assert before < 0.7 * first


# --- on the device


def operator(**options: Any) -> OperatorDevice:
    device = OperatorDevice(OperatorOptions(**(CALM | options)), TICK)
    device.open(0.0)
    return device


def turned(device: OperatorDevice, now: float) -> Vector:
    orientation = device.latest(now).orientation
    assert orientation is not None
    return vector(orientation)


def test_spec_shows_torque_before_open() -> None:
    with_wrist = OperatorDevice(OperatorOptions(wrist={}, torque_n_m=0.3), TICK)
    assert with_wrist.spec.orientation
    assert with_wrist.spec.torque_n_m == 0.3
    assert isinstance(with_wrist, TorqueDevice)
    without = OperatorDevice(OperatorOptions(), TICK)
    assert not without.spec.orientation
    assert without.spec.torque_n_m == 0.0


def test_wrist_does_not_change_hand_position() -> None:
    with_wrist, without = (
        OperatorDevice(OperatorOptions(wrist=wrist), TICK) for wrist in ({"wobble_deg": [9, 0, 9]}, None)
    )
    for device in (with_wrist, without):
        device.open(0.0)
    for tick in range(1, 2000):
        one, other = (device.latest(tick * TICK) for device in (with_wrist, without))
        assert one._replace(orientation=None) == other
        for device in (with_wrist, without):
            device.command((0.0, 0.1, 1.0), tick * TICK)
            device.turn((0.1, 0.2, 0.3), tick * TICK)


@pytest.mark.parametrize("turn", [[0.0, 40.0, 0.0], [90.0, 0.0, -60.0], [0.0, 0.0, 175.0]])
def test_script_turns_the_handle(turn: list[float]) -> None:
    script = [
        {"motion": "reach", "to_m": [0.02, 0.0, 0.01], "turn_deg": turn, "duration_s": 1.0},
        {"motion": "rest", "duration_s": 0.5},
        {"motion": "turn", "turn_deg": [0, 0, 0], "duration_s": 1.0},
    ]
    device = operator(script=script, repeat=False)
    turns = [turned(device, tick * TICK) for tick in range(1, 3501)]
    assert [degrees(part) for part in turns[1499]] == pytest.approx(turn, abs=0.5)
    assert turns[-1] == pytest.approx(ZERO, abs=1e-4)
    assert device.latest(3.5).position == pytest.approx((0.02, 0.0, 0.01), abs=1e-5)
    assert max(distance(a, b) for a, b in pairwise(turns)) < 2.5 * radians(norm((turn[0], turn[1], turn[2]))) * TICK


def test_repeated_script_turns_back_to_level() -> None:
    """Also where it did not move, so that positions and turns stay in step."""
    script = [
        {"motion": "turn", "turn_deg": [0.0, 0.0, 50.0], "duration_s": 1.0},
        {"motion": "press", "at_m": [0, 0, 0.01], "hold_s": 0.1},
        {"motion": "reach", "to_m": [0.0, 0.0, 0.03], "duration_s": 0.5},
    ]
    device = operator(script=script)
    turns = [turned(device, tick * TICK) for tick in range(1, 16_001)]
    whole = 1.0 + (0.8 + 0.6 + 0.1 + 0.6) + 0.5 + 1.0
    for start in (0.0, whole, 2.0 * whole):
        at = {share: degrees(turns[round((start + share) / TICK)][2]) for share in (1.5, 3.5, whole - 0.003)}
        assert at == pytest.approx({1.5: 50.0, 3.5: 50.0, whole - 0.003: 0.0}, abs=1.5)
    assert max(distance(a, b) for a, b in pairwise(turns)) < 0.003, "no jump anywhere"


def test_wrist_yields_to_torque_within_device_range() -> None:
    def under(torque: Vector) -> Vector:
        device = operator(torque_n_m=0.2)
        for tick in range(1, 1001):
            turn = turned(device, tick * TICK)
            device.turn(torque, tick * TICK)
        return turn

    assert under((0.0, 0.0, 0.1)) == pytest.approx((0.0, 0.0, 0.1 / STIFFNESS), abs=1e-4)
    assert under((0.0, 0.0, 1e300)) == under((0.0, 0.0, 0.2)) == pytest.approx((0.0, 0.0, 0.2 / STIFFNESS), abs=1e-4)


def test_closing_ends_torque_and_resets_orientation() -> None:
    device = operator()
    runs = []
    for _ in range(2):
        device.open(0.0)
        run = [turned(device, 0.0)]
        for tick in range(1, 300):
            run.append(turned(device, tick * TICK))
            device.turn((0.0, 0.3, 0.0), tick * TICK)
        device.close()
        device.turn((0.0, 0.3, 0.0), 1.0)  # of no effect on the next session
        runs.append(run)
    assert runs[0] == runs[1]
    assert runs[0][1] == ZERO
    assert runs[0][-1][1] > 0.05


# --- the loop
