"""The figures of the rotation, on records made by hand."""

from math import pi

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from weberlink.geometry.rotation import angle_between, quaternion
from weberlink.protocol.states import State
from weberlink.system.scoring.energy import PortWork
from weberlink.system.scoring.rotation import angles_between, turns, turns_between
from weberlink.system.scoring.session import Records, SessionScore
from weberlink.telemetry.reader import DTYPE

RATE = 1000.0
components = st.floats(-3.2, 3.2)
rotations = st.tuples(components, components, components)


def records(ticks: int) -> Records:
    made = np.zeros(ticks, DTYPE)
    made["tick"] = np.arange(ticks)
    made["at"] = 10.0 + np.arange(ticks) / RATE
    made["state"] = State.ENGAGED.value
    made["rtt_us"] = made["one_way_us"] = np.nan
    return made


def score(master: Records, slave: Records) -> dict[str, dict[str, object]]:
    scored = SessionScore(RATE, ("zoh",), ("zoh", "linear"))
    for one, other in zip(np.array_split(master, 7), np.array_split(slave, 7), strict=True):
        scored.add(one, other)
    return scored.summary()


@given(rotations, rotations)
def test_angles_are_those_of_the_codec(a: tuple[float, ...], b: tuple[float, ...]) -> None:
    (angle,) = angles_between(np.array([a]), np.array([b]))
    assert angle == pytest.approx(angle_between(quaternion(a), quaternion(b)), abs=1e-7)  # type: ignore[arg-type]


@given(rotations, rotations)
def test_a_turn_leads_from_one_to_the_other(a: tuple[float, ...], b: tuple[float, ...]) -> None:
    """In the fixed frame: first a, then the turn."""
    (turn,) = turns_between(np.array([a]), np.array([b]))
    (back,) = turns_between(np.array([b]), np.array([a]))
    assert np.linalg.norm(turn) <= pi + 1e-9
    if np.linalg.norm(turn) < pi - 1e-3:  # at half a turn either way is as short
        assert turn == pytest.approx(-back, abs=1e-6)


def test_a_turn_is_in_the_frame_of_the_rotations() -> None:
    """Level to a quarter about z; from there a quarter about the fixed x."""
    quarter = pi / 2
    about_z, about_x = quaternion((0.0, 0.0, quarter)), quaternion((quarter, 0.0, 0.0))
    w, x, y, z = (
        about_x[0] * about_z[0],
        about_x[1] * about_z[0],
        -about_x[1] * about_z[3],
        about_x[0] * about_z[3],
    )
    angle = 2.0 * np.arccos(w)
    both = np.array([x, y, z]) / np.sin(angle / 2) * angle
    steps = turns(np.array([(0.0, 0.0, 0.0), (0.0, 0.0, quarter), both]))
    assert steps == pytest.approx(np.array([(0.0, 0.0, quarter), (quarter, 0.0, 0.0)]), abs=1e-12)


def test_torque_and_orientation_have_their_figures() -> None:
    master, slave = records(1000), records(1000)
    slave["rotation_raw"][:, 0] = 0.2
    master["rotation_output"][:, 0] = 0.23
    slave["rotation_decoded"][:, 0] = 0.21
    slave["rotation_bound"] = 0.025
    slave["rotation_updates_sent"] = np.arange(1000) // 20
    slave["rotation_selected"][::2] = 1
    slave["rotation_sent"][:10] = 1
    master["rotation_raw"][:, 2] = pi + 0.01
    slave["rotation_output"][:, 2] = -(pi - 0.02)  # the same but for 0.01 rad
    master["rotation_bound"] = 0.02
    master["rotation_updates_sent"] = np.arange(1000) // 100
    summary = score(master, slave)
    torque, orientation = summary["torque"], summary["orientation"]
    assert torque["error_rms"] == pytest.approx(0.03, rel=1e-5)
    assert torque["violation_fraction"] == 1.0
    assert torque["violation_max_jnd"] == pytest.approx(1.2, rel=1e-3)
    assert torque["coding"]["error_rms"] == pytest.approx(0.01, rel=1e-5)  # type: ignore[index]
    assert torque["coding"]["violation_fraction"] == 0.0  # type: ignore[index]
    assert (torque["packets"], orientation["packets"]) == (49, 9)
    assert torque["reduction"] == pytest.approx(0.951)
    assert torque["selected"] == {"zoh": 5, "linear": 5}
    assert orientation["error_max"] == pytest.approx(0.01, rel=1e-4)
    assert orientation["violation_fraction"] == 0.0


def test_packets_are_counted_at_the_receiver_where_the_sender_was_not_seen() -> None:
    slave = records(100)
    slave["rotation_updates_received"] = np.arange(100) // 10
    scored = SessionScore(RATE, ("zoh",), ("zoh",))
    scored.add(np.empty(0, DTYPE), slave)
    assert scored.summary()["orientation"]["packets"] == 9


@pytest.mark.parametrize(("force", "position", "held"), [("output", "raw", True), ("raw", "output", False)])
def test_a_torque_does_work_over_a_turn(force: str, position: str, held: bool) -> None:
    """0.1 N m against a turn of half a turn: pi/20 J, whatever the vector does on the way."""
    made = records(1001)
    angle = np.linspace(2.0, 2.0 + pi, 1001)
    made[f"rotation_{position}"][:, 1] = np.where(angle > pi, angle - 2.0 * pi, angle)
    made[f"rotation_{force}"][:, 1] = -0.1
    plain = PortWork(force, position, held=held)
    turning = PortWork(force, position, held=held, turns=turns)
    plain.add(made)
    turning.add(made)
    assert plain.total == 0.0
    assert turning.total == pytest.approx(0.1 * pi, rel=1e-5)
