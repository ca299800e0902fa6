"""The kernel's leader and follower arms keep the contract."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from weberlink.arms.contract import ArmSpec
from weberlink.master.devices import leaders
from weberlink.master.devices.remote_leader import RemoteLeader
from weberlink.master.devices.remote_link import LeaderTarget
from weberlink.slave.robots import followers
from weberlink.testing.arms import ArmBench, FollowerContract, LeaderContract
from weberlink.testing.time import TICK, virtual_time

MODEL = Path(__file__).with_name("arm.xml")
HOME: dict[str, Any] = {"model": MODEL, "home_rad": (0.0,) * 6}
OPTIONS: dict[str, dict[str, Any]] = {
    "arm_operator": HOME | {"script": [{"motion": "move", "joints_rad": [0.3] * 5, "duration_s": 0.2}]},
    "mujoco_arm": HOME,
    "remote_leader": {
        "joints": ("pan", "lift"), "gripper": True, "lower_rad": (-1.0, -1.5, 0.0), "upper_rad": (1.0, 1.5, 1.2)
    },
}  # fmt: skip


def made(name: str, **options: Any) -> Any:
    """Not open."""
    driver: Any = (leaders if name in leaders.BUILT_IN else followers).load(name)
    if hasattr(driver, "NEEDS"):
        pytest.importorskip(driver.NEEDS[0])
    return driver(driver.Options.model_validate(OPTIONS[name] | options), TICK)


def test_every_built_in_driver_is_tried() -> None:
    assert set(OPTIONS) == {*leaders.BUILT_IN, *followers.BUILT_IN}


class TestArmOperator(LeaderContract):
    @pytest.fixture
    def bench(self) -> Iterator[ArmBench]:
        yield ArmBench(made("arm_operator"), virtual_time())


class TestMujocoArm(FollowerContract):
    @pytest.fixture
    def bench(self) -> Iterator[ArmBench]:
        yield ArmBench(made("mujoco_arm"), virtual_time())


class Program:
    """Leads a remote leader, a milliradian a tick."""

    def open(self, axes: int) -> None:
        self.angle = 0.0

    def newest(self) -> LeaderTarget:
        self.angle = min(0.3, self.angle + 1e-3)
        return LeaderTarget((self.angle, 0.0, 0.0), True)

    def close(self) -> None: ...


class TestRemoteLeader(LeaderContract):
    @pytest.fixture
    def bench(self) -> Iterator[ArmBench]:
        options = RemoteLeader.Options.model_validate(OPTIONS["remote_leader"])
        yield ArmBench(RemoteLeader(options, TICK, Program()), virtual_time())


@pytest.mark.parametrize("name", OPTIONS)
def test_what_is_computed_is_exact(name: str) -> None:
    spec: ArmSpec = made(name).spec
    assert (spec.rate_hz, spec.lag_s, spec.torque_error_nm, spec.watchdog_s) == (1.0 / TICK, 0.0, 0.0, 0.0)
    assert spec.calibrated and spec.force_feedback is (name != "remote_leader")
    assert spec.buttons == (name == "remote_leader")


@pytest.mark.parametrize(
    ("name", "options", "field"),
    [
        ("mujoco_arm", {"stiffness_nm_rad": 0.0}, "stiffness_nm_rad"),
        ("mujoco_arm", {"stiffness_nm_rad": 1e-6}, ""),
        ("mujoco_arm", {"stiffness_nm_rad": 1.01e9}, "stiffness_nm_rad"),
        ("mujoco_arm", {"home_rad": (1.9199, 0.0, 0.0, 0.0, 0.0, 0.0)}, ""),
        ("mujoco_arm", {"home_rad": (1.93, 0.0, 0.0, 0.0, 0.0, 0.0)}, "home_rad: pan"),
        ("mujoco_arm", {"home_rad": (0.0, 0.0, 0.0, 0.0, 0.0, -0.01)}, "home_rad: gripper"),
        ("mujoco_arm", {"model": "no_such_file.xml"}, "model"),
        ("mujoco_arm", {"objects": [{"kind": "table", "position_m": (0, 0, 0), "time_constant_s": 0.0}]}, "objects"),
        ("remote_leader", {"home_rad": (0.0, 1.5, 1.2)}, ""),
        ("remote_leader", {"home_rad": (0.0, 1.6, 0.0)}, "home_rad"),
        ("remote_leader", {"home_rad": (0.0, -1.6, 0.0)}, "home_rad"),
    ],
)
def test_options_are_taken_or_refused_by_name(name: str, options: dict[str, Any], field: str) -> None:
    if not field:
        made(name, **options)
        return
    with pytest.raises(ValueError, match=field):
        made(name, **options)
