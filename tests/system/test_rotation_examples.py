"""The two shipped files with six degrees of freedom: whole sessions in virtual time, and what is felt in them."""

from itertools import pairwise
from math import degrees, hypot

import pytest

from tests.system.systems import Step, raw, steps, system
from weberlink.geometry.vector import Vector, distance, norm


def measured(step: Step) -> Vector:
    """Torque on the tool [N m]."""
    slave = step.slave
    return slave.rotation_raw_x, slave.rotation_raw_y, slave.rotation_raw_z


def force(step: Step) -> Vector:
    """On the tool [N]."""
    return raw(step.slave)


def felt(step: Step) -> Vector:
    """Torque on the hand [N m]."""
    master = step.master
    return master.rotation_output_x, master.rotation_output_y, master.rotation_output_z


def held(step: Step) -> Vector:
    """Orientation of the tool as a rotation vector [rad]."""
    slave = step.slave
    return slave.rotation_output_x, slave.rotation_output_y, slave.rotation_output_z


def meant(step: Step) -> Vector:
    """Orientation of the handle as a rotation vector [rad]."""
    master = step.master
    return master.rotation_raw_x, master.rotation_raw_y, master.rotation_raw_z


def close(run: list[Step], bound_rad: float) -> None:
    """The tool is as the hand was a tick ago."""
    for before, step in pairwise(run[500:]):
        assert distance(held(step), meant(before)) < bound_rad


def test_the_stick_tells_by_torque_which_end_touches_until_it_is_laid_flat() -> None:
    run = list(steps(system(file="rotation.yaml"), 8.3))
    close(run, 0.02)
    # The end on +x is low and presses: the torque is about -y, that force times 3 cm times the cosine of 20 degrees.
    one_end = run[1650]
    assert force(one_end)[2] > 1.0
    assert measured(one_end)[1] == pytest.approx(-0.03 * 0.94 * force(one_end)[2], rel=0.03)
    assert felt(one_end)[1] == pytest.approx(measured(one_end)[1], rel=0.15)
    # Turned flat, and pressed: more force, and no torque about the plane.
    for flat in run[3050:3150]:
        assert force(flat)[2] > 2.5
        assert hypot(*measured(flat)[:2]) < 0.1 * abs(measured(one_end)[1])
    # Swung about the vertical, both ends rub against it: first about +z, on the way back about -z.
    assert max(measured(step)[2] for step in run[3200:4100]) > 0.01
    assert min(measured(step)[2] for step in run[4200:5100]) < -0.01
    # One end on the box, then the other on the table as well, and little torque is left.
    assert min(measured(step)[1] for step in run[6300:6800]) < -0.025
    assert all(abs(measured(step)[1]) < 0.01 for step in run[7800:8000])
    assert degrees(held(run[7900])[1]) == pytest.approx(-10.0, abs=1.0)


def test_the_wrench_is_felt_by_torque_and_hardly_by_force() -> None:
    pytest.importorskip("mujoco", reason="needs mujoco (extra: mujoco)")
    run = list(steps(system(file="mujoco-wrench.yaml"), 5.5))
    close(run, 0.02)
    spring, stop, other = run[1900], run[3300], run[4550]
    assert -0.15 < measured(spring)[2] < -0.10
    assert measured(stop)[2] < 2.5 * measured(spring)[2]
    assert measured(other)[2] > 0.10
    for step in (spring, stop, other):
        assert felt(step)[2] == pytest.approx(measured(step)[2], rel=0.15)
    turning = run[1000:4600]
    assert max(norm(force(step)) for step in turning) < 1.0
    sent = turning[-1].slave.rotation_updates_sent - turning[0].slave.rotation_updates_sent
    assert 10 < sent < 150, "coded, and coded sparsely"
