"""The map between device and robot in a file: what it makes of a whole system, and what is refused."""

from pathlib import Path

import pytest

from tests.session.systems import configuration, output, raw, steps, system
from weberlink.geometry.vector import Vector, norm, scale
from weberlink.master.devices.operator import OperatorDevice
from weberlink.session.composition.master import build_device

TURNED = "master.mapping={rotation_deg: [0, 0, 90], scale: 0.5, offset_m: [0.01, 0.0, 0.0]}"


def test_the_robot_goes_where_the_mapped_hand_is_and_its_force_comes_back_turned() -> None:
    """The same operator over the same ground, straight and mapped: the mapped ground is felt along the same axis."""
    straight = [step.master for step in steps(system(), 1.5)]
    mapped = [step.master for step in steps(system(TURNED), 1.5)]
    compared = 0
    for before, after in zip(straight, mapped, strict=True):
        if norm(output(before)) > 0.0 or norm(output(after)) > 0.0:
            break
        compared += 1
        x, y, z = raw(before)
        assert raw(after) == pytest.approx((0.01 - 0.5 * y, 0.5 * x, 0.5 * z), abs=1e-9)
    assert compared > 100
    assert max(output(record)[2] for record in mapped) > 0.5, "the ground is felt"


@pytest.mark.parametrize("factor", [0.25, 8.0])
def test_a_force_scale_changes_what_is_felt_but_not_the_limit(factor: float) -> None:
    felt: list[Vector] = []

    class Felt(OperatorDevice):
        def command(self, force: Vector, now: float) -> None:
            felt.append(force)
            super().command(force, now)

    simulation = system("master.limits.force_n=1.5", f"master.mapping={{force_scale: {factor}}}", device=Felt)
    for step in steps(simulation, 2.0):
        assert felt[-1] == pytest.approx(scale(output(step.master), factor), abs=1e-12)
    assert max(map(norm, felt)) == pytest.approx(1.5)


def test_walls_are_those_of_the_robot_where_the_file_gives_none(tmp_path: Path) -> None:
    limits = "slave.limits.workspace_m=[[-0.01, 0.02], [-0.03, 0.04], [-0.05, 0.06]]"
    device = build_device(configuration(limits, "master.mapping={walls: {}}"))
    assert device.spec.workspace_m == ((-0.01, -0.03, -0.05), (0.02, 0.04, 0.06))
