"""The computed arms keep the contracts; their options are taken, or refused by name."""

from collections.abc import Iterator
from typing import Any

import pytest

from tests.session.systems import ARMS
from weberlink.testing.arms import ArmBench, FollowerContract, LeaderContract
from weberlink.testing.time import TICK, virtual_time
from weberlink_mujoco.arms.follower import MujocoArm
from weberlink_mujoco.arms.operator import ArmOperator

HOLD = {"motion": "hold", "duration_s": 1.0}
Driver = type[ArmOperator] | type[MujocoArm]


def made(driver: Driver, **options: Any) -> Any:
    """Not open."""
    own = {"model": ARMS.with_name("arm.xml"), "home_rad": (0.0,) * 6} | options
    return driver(driver.Options.model_validate(own), TICK)  # type: ignore[arg-type]


class TestArmOperator(LeaderContract):
    @pytest.fixture
    def bench(self) -> Iterator[ArmBench]:
        script = [{"motion": "move", "joints_rad": [0.3] * 5, "duration_s": 0.2}]
        yield ArmBench(made(ArmOperator, script=script), virtual_time())


class TestMujocoArm(FollowerContract):
    @pytest.fixture
    def bench(self) -> Iterator[ArmBench]:
        yield ArmBench(made(MujocoArm), virtual_time())


@pytest.mark.parametrize("driver", [ArmOperator, MujocoArm])
def test_what_is_computed_is_exact(driver: Driver) -> None:
    spec = made(driver).spec
    assert (spec.rate_hz, spec.lag_s, spec.torque_error_nm, spec.watchdog_s) == (1.0 / TICK, 0.0, 0.0, 0.0)
    assert (spec.calibrated, spec.force_feedback, spec.buttons) == (True, True, 0)


@pytest.mark.parametrize(
    ("driver", "options", "field"),
    [
        (MujocoArm, {"stiffness_nm_rad": 0.0}, "stiffness_nm_rad"),
        (MujocoArm, {"stiffness_nm_rad": 1e-6}, ""),
        (MujocoArm, {"stiffness_nm_rad": 1.01e9}, "stiffness_nm_rad"),
        (MujocoArm, {"home_rad": (1.9199, 0.0, 0.0, 0.0, 0.0, 0.0)}, ""),
        (MujocoArm, {"home_rad": (1.93, 0.0, 0.0, 0.0, 0.0, 0.0)}, "home_rad: pan"),
        (MujocoArm, {"home_rad": (0.0, 0.0, 0.0, 0.0, 0.0, -0.01)}, "home_rad: gripper"),
        (MujocoArm, {"model": "no_such_file.xml"}, "model"),
        (MujocoArm, {"objects": [{"kind": "table", "position_m": (0, 0, 0), "time_constant_s": 0.0}]}, r"objects\.0"),
        (ArmOperator, {"script": [{"motion": "move", "joints_rad": (0.0,)}]}, "script.0.joints_rad: expected 5 angles"),
        (ArmOperator, {"script": [HOLD, {"motion": "move", "gripper_rad": 9.0}]}, "script.1: gripper: expected 0 to"),
        (ArmOperator, {"script": [{"motion": "swing", "amplitude_rad": (1.0,)}]}, "script.0.amplitude_rad"),
        (ArmOperator, {"hand": {"damping_nm_s_rad": (1.0,)}}, "hand.damping_nm_s_rad: expected one value"),
        (ArmOperator, {"hand": {"stiffness_nm_rad": 0.0}}, "hand.stiffness_nm_rad: expected 1e-06 to "),
    ],
)
def test_options_are_taken_or_refused_by_name(driver: Driver, options: dict[str, Any], field: str) -> None:
    if not field:
        made(driver, **options)
        return
    with pytest.raises(ValueError, match=field):
        made(driver, **options)
