"""The map between device and robot in a file: what it makes of a whole system, and what is refused."""

from pathlib import Path

import numpy as np
import pytest

from tests.session.kinds import HAND, run
from tests.session.systems import configuration
from weberlink.geometry.vector import Vector, norm
from weberlink.master.devices.operator import OperatorDevice
from weberlink.session.composition.master import build_device

TURNED = "master.mapping={rotation_deg: [0, 0, 90], scale: 0.5, offset_m: [0.01, 0.0, 0.0]}"


def test_the_robot_goes_where_the_mapped_hand_is_and_its_force_comes_back_turned() -> None:
    """The same operator over the same ground, straight and mapped: the mapped ground is felt along the same axis."""
    straight, mapped = (run(HAND, 1.5, *mapping).master for mapping in ((), (TURNED,)))
    free = int(np.argmax((straight["output"] != 0.0).any(axis=1) | (mapped["output"] != 0.0).any(axis=1)))
    assert free > 100
    x, y, z = straight["raw"][:free, :3].T
    np.testing.assert_allclose(mapped["raw"][:free, :3], np.column_stack((0.01 - 0.5 * y, 0.5 * x, 0.5 * z)), atol=1e-9)
    assert mapped["output"][:, 2].max() > 0.5, "the ground is felt"


@pytest.mark.parametrize("factor", [0.25, 8.0])
def test_a_force_scale_changes_what_is_felt_but_not_the_limit(factor: float) -> None:
    felt: list[Vector] = []

    class Felt(OperatorDevice):
        def command(self, force: Vector, now: float) -> None:
            felt.append(force)
            super().command(force, now)

    of_ticks: list[Vector] = []
    overrides = "master.limits.force_n=1.5", f"master.mapping={{force_scale: {factor}}}"
    ran = run(HAND, 2.0, *overrides, device=Felt, watch=lambda _: of_ticks.append(felt[-1]))
    np.testing.assert_allclose(of_ticks, factor * ran.master["output"][:, :3], atol=1e-12)
    assert max(map(norm, felt)) == pytest.approx(1.5)


def test_walls_are_those_of_the_robot_where_the_file_gives_none(tmp_path: Path) -> None:
    limits = "slave.limits.workspace_m=[[-0.01, 0.02], [-0.03, 0.04], [-0.05, 0.06]]"
    device = build_device(configuration(limits, "master.mapping={walls: {}}"))
    assert device.spec.workspace_m == ((-0.01, -0.03, -0.05), (0.02, 0.04, 0.06))
