"""Files that cannot serve as the model of an arm."""

from pathlib import Path

import pytest

from weberlink_mujoco.arms.models import load


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ('<joint name="a" range="-1 1"/>', "site with the name 'tip'"),
        ('<joint name="a"/><site name="tip"/>', "range at each joint; 'a' has none"),
        ('<joint name="gripper" range="0 1"/><site name="tip"/>', "1 to 8 hinges with names"),
        ('<joint name="a" type="slide" range="-1 1"/><site name="tip"/>', "1 to 8 hinges with names"),
        ('<joint name="a" range="-1 1"/><site name="tip"/><geom size="-1"/>', "size"),
    ],
)
def test_wrong_files_are_refused_in_a_line(tmp_path: Path, body: str, message: str) -> None:
    path = tmp_path / "arm.xml"
    inertia = '<inertial pos="0.1 0 0" mass="1" diaginertia="1 1 1"/>'
    compiler = '<compiler angle="radian" autolimits="true"/>'
    path.write_text(f"<mujoco>{compiler}<worldbody><body>{body}{inertia}</body></worldbody></mujoco>", encoding="utf-8")
    with pytest.raises(ValueError, match=message) as caught:
        load(path)
    assert "\n" not in str(caught.value)
    assert str(path) in str(caught.value)
