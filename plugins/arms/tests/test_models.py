"""The models of arms: their numbers against those of their sources, and their mechanics against finite differences."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from math import pi
from pathlib import Path

import pytest

pytest.importorskip("mujoco", reason="needs mujoco (extra: mujoco)")

import mujoco
from hypothesis import given, settings
from hypothesis import strategies as st

from weberlink.geometry.joints import Joints
from weberlink_mujoco.arms.models import MODELS as FILES
from weberlink_mujoco.arms.models import ArmModel, load

FOLDER = FILES["so101"].parent
LEROBOT = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll")
NAMES = list(FILES)
MODELS = {name: load(name) for name in NAMES}
PLAIN = {name: mujoco.MjModel.from_xml_path(str(FILES[name])) for name in NAMES}
shares = st.lists(st.floats(0.0, 1.0), min_size=6, max_size=6)


@dataclass(frozen=True)
class Source:
    """What the file of the source says, read again."""

    names: tuple[str, ...]  # of the joints
    lower: Joints  # range [rad]
    upper: Joints
    mass: float  # of all links that move [kg]
    torque: Joints  # largest at each axis [N m]
    armature: Joints  # at each axis [kg m^2]


KOCH = ((-2.2, -1.57, -1.57, -2.0, -3.14, 0.0), (2.2, 0.6, 1.45, 2.0, 3.14, 1.632))
KOCH_KG = 0.05014 + 0.050177 + 0.06379 + 0.019805 + 0.029277 + 0.012831
M077 = 0.0019898 * (77.5 / 288.35) ** 2
SOURCES = {
    "so101": Source(
        LEROBOT,
        (-1.91986, -1.74533, -1.69, -1.65806, -2.74385, 0.0),
        (1.91986, 1.74533, 1.69, 1.65806, 2.74385, 0.174533 + 1.745329),
        0.100006 + 0.103 + 0.104 + 0.079 + 0.087 + 0.012,
        (2.94,) * 6,
        (0.028,) * 6,
    ),
    "koch_follower": Source(LEROBOT, *KOCH, KOCH_KG, (1.4, 1.4, *(0.52,) * 4), (0.0019898,) * 6),
    "koch_leader": Source(LEROBOT, *KOCH, KOCH_KG, (0.215,) * 6, (M077,) * 6),
    "omx_leader": Source(
        LEROBOT,
        (*(-pi,) * 5, 0.0),
        (*(pi,) * 5, 1.0),
        0.025270951 + 2 * 0.047706231 + 0.030431812 + 0.039629659 + 0.019611455,
        (*(0.52,) * 5, 0.215),
        (*(0.0019898,) * 5, M077),
    ),
    "open_manipulator_x": Source(
        ("joint1", "joint2", "joint3", "joint4"),
        (-pi, -1.5, -1.5, -1.7, 0.0),
        (pi, 1.5, 1.4, 1.97, (0.02 + 0.011) / 0.015),
        0.098406837 + 0.13850917 + 0.13274562 + 0.14327573 + 2 * 0.032218127,
        (4.1,) * 5,
        (0.005,) * 5,
    ),
}


@pytest.mark.parametrize("name", NAMES)
def test_numbers_are_those_of_the_source(name: str) -> None:
    model, source = MODELS[name], SOURCES[name]
    assert (model.names, model.gripper) == (source.names, True)
    assert model.lower == pytest.approx(source.lower, abs=1e-5)
    assert model.upper == pytest.approx(source.upper, abs=1e-5)
    assert model.torque == pytest.approx(source.torque)
    assert model.armature == pytest.approx(source.armature, rel=5e-3)
    assert PLAIN[name].body_mass.sum() == pytest.approx(source.mass, abs=2e-6)


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
    assert all(0.0 < link < SOURCES[name].mass * 0.4**2 for link in links)
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
