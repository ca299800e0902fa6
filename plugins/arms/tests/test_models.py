"""The models of the arms: files name their sources, and mechanics are those of finite differences."""

import re
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import pytest

pytest.importorskip("mujoco", reason="needs mujoco (extra: mujoco)")

import mujoco
from hypothesis import given, settings, strategies as st

from weberlink.geometry.joints import Joints
from weberlink_mujoco.arms.models import MODELS as FILES, ArmModel, load

FOLDER = FILES["so101"].parent
NAMES = list(FILES)
MODELS = {name: load(name) for name in NAMES}
PLAIN = {name: mujoco.MjModel.from_xml_path(str(FILES[name])) for name in NAMES}
shares = st.lists(st.floats(0.0, 1.0), min_size=6, max_size=6)


@pytest.mark.parametrize("path", sorted(FOLDER.glob("*.xml")), ids=lambda path: path.stem)
def test_files_name_source_commit_and_licence(path: Path) -> None:
    comment = path.read_text(encoding="utf-8").split("-->")[0]
    assert re.search(r"\b[0-9a-f]{40}\b", comment)
    assert "Apache-2.0" in comment
    assert path.stem == "koch_links" or "Not public" in comment


@pytest.mark.parametrize("name", NAMES)
@settings(max_examples=25)
@given(shares=shares)
def test_gravity_is_the_derivative_of_potential_energy(name: str, shares: list[float]) -> None:
    model = MODELS[name]
    plain = PLAIN[name]
    data = mujoco.MjData(plain)

    def potential(angles: Joints) -> float:
        data.qpos[: len(angles)] = angles
        data.qpos[len(angles) :] = 0.015 * angles[-1]  # the fingers of the only model that has more joints than axes
        mujoco.mj_kinematics(plain, data)
        return -float(plain.opt.gravity @ (plain.body_mass @ data.xipos))

    angles = within(model, shares)
    assert model.gravity(angles) == pytest.approx(derivatives(potential, angles), abs=1e-7)


@pytest.mark.parametrize("name", NAMES)
@settings(max_examples=25)
@given(shares=shares)
def test_jacobian_is_the_derivative_of_the_tip(name: str, shares: list[float]) -> None:
    model = MODELS[name]
    angles = within(model, shares)
    for axis, row in enumerate(model.jacobian(angles)):
        assert row == pytest.approx(derivatives(lambda at, axis=axis: model.tip(at)[axis], angles), abs=1e-8)


@pytest.mark.parametrize("name", NAMES)
def test_inertia_is_more_than_that_of_motors(name: str) -> None:
    """And rises towards the shoulder where the arm is stretched, by at most the mass times the square of the reach."""
    model = MODELS[name]
    inertia = model.inertia((0.0,) * model.axes)
    links = [all_of_it - motor for all_of_it, motor in zip(inertia, model.armature, strict=True)]
    assert all(0.0 < link < PLAIN[name].body_mass.sum() * 0.4**2 for link in links)
    assert all(near > far for near, far in pairwise(links[1:4]))


def within(model: ArmModel, shares: list[float]) -> Joints:
    ranges = zip(shares[: model.axes], model.lower, model.upper, strict=True)
    return tuple(low + share * (high - low) for share, low, high in ranges)


def derivatives(function: Callable[[Joints], float], angles: Joints, step: float = 1e-5) -> Joints:
    """Central differences."""
    slopes = []
    for axis, angle in enumerate(angles):
        ahead, behind = ((*angles[:axis], angle + way, *angles[axis + 1 :]) for way in (step, -step))
        slopes.append((function(ahead) - function(behind)) / (2.0 * step))
    return tuple(slopes)
