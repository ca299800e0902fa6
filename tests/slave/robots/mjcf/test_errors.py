"""What is wrong with a file is said in one line that begins with the option."""

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("mujoco", reason="needs mujoco (extra: mujoco)")

from tests.slave.robots.mjcf.models import TICK, chain, gantry, robot
from weberlink.geometry.vector import ZERO
from weberlink.installation import install_line
from weberlink.slave.robots.mjcf.driver import MujocoRobot
from weberlink.slave.scenes.contact import SceneObject
from weberlink.slave.scenes.scene import Scene
from weberlink.slave.scenes.solids import PlaneShape

FIXED = '<mujoco><worldbody><body><geom size="0.1"/><site name="tip"/></body></worldbody></mujoco>'
NAMELESS = '<mujoco><worldbody><body><joint/><geom size="0.1"/><site/></body></worldbody></mujoco>'


@pytest.mark.parametrize(
    ("text", "options", "line"),
    [
        ("<mujoco><worldbody></mujoco>", {}, r"^model: .*model\.xml: XML parse error .*MISMATCHED"),
        ('<mujoco><worldbody><geom type="pear"/></worldbody></mujoco>', {}, r"^model: .*'pear'.* line 1"),
        ('<mujoco><worldbody><body><joint/></body></worldbody></mujoco>', {}, r"^model: .*mass and inertia"),
        ('<mujoco><include file="part.xml"/></mujoco>', {}, r"^model: .*part\.xml"),
        (gantry(), {"end_effector": "tipp"}, r"^end_effector: no site is called 'tipp'; nearest is 'tip', there are f"),
        (NAMELESS, {}, r"^end_effector: the model has no site with a name, so none is called 'tip'$"),
        (FIXED, {}, r"^end_effector: no joint moves the site 'tip'$"),
        (gantry(), {"force": "wrst"}, r"^force: no force sensor is called 'wrst'; nearest is 'wrist', there are wr"),
        (gantry(), {"force": "shaken"}, r"^force: no force sensor is called 'shaken'; nearest is 'wrist'"),
        (chain(), {"keyframe": "bend"}, r"^keyframe: no keyframe is called 'bend'; nearest is 'bent'"),
        (chain(), {"keyframe": "bent"}, r"^home_m: \[.*\] is outside of workspace_m"),
        (chain(), {"home_m": (9.0, 0.0, 0.0), "workspace_m": 9.0}, r"^home_m: .* no closer than 8\.\d m to \[9"),
        (gantry(), {"stiffness_n_m": 1e9}, r"^stiffness_n_m: 1e\+09 is too much for the 0\.2 kg .* at most 8\.1e\+07$"),
    ],
)  # fmt: skip
def test_a_file_or_a_name_that_is_wrong(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], text: str, options: dict[str, Any], line: str
) -> None:
    with pytest.raises(ValueError, match=line) as caught:
        robot(tmp_path, text, **options)
    assert "\n" not in str(caught.value)
    assert tuple(capfd.readouterr()) == ("", "")


@pytest.mark.parametrize("name", ["nowhere.xml", "."])
def test_a_file_that_is_not_there(tmp_path: Path, name: str) -> None:
    with pytest.raises(ValueError, match=r"^model: there is no file"):
        MujocoRobot(MujocoRobot.Options(model=tmp_path / name), None, TICK)


def test_second_scene_is_refused(tmp_path: Path) -> None:
    scene = Scene([SceneObject(PlaneShape(ZERO, (0.0, 0.0, 1.0)), 500.0)])
    robot(tmp_path, gantry())
    with pytest.raises(ValueError, match=r"^driver mujoco: touches what is in its MJCF file; leave slave\.scene out$"):
        MujocoRobot(MujocoRobot.Options(model=tmp_path / "model.xml"), scene, TICK)


def test_the_suggested_stiffness_is_accepted(tmp_path: Path) -> None:
    assert "49 steps" in robot(tmp_path, gantry(), stiffness_n_m=8.1e7).description()


WITHOUT = """
import sys
sys.modules["mujoco"] = None
from pathlib import Path
from weberlink.slave.robots import load
driver = load("mujoco")
options = driver.Options(model=Path("model.xml"))
driver.Options.model_json_schema()
try:
    driver(options, None, 0.001)
except ValueError as error:
    print(error)
print(sorted(name for name in sys.modules if name.startswith(("mujoco.", "numpy", "weberlink.slave.robots.mjcf."))))
"""


def test_missing_mujoco_is_reported_at_construction() -> None:
    ended = subprocess.run([sys.executable, "-c", WITHOUT], capture_output=True, text=True, timeout=60, check=False)
    assert ended.stderr == ""
    assert ended.stdout.splitlines() == [
        f"driver mujoco: needs mujoco; install it with: {install_line('mujoco')}",
        "['weberlink.slave.robots.mjcf.driver', 'weberlink.slave.robots.mjcf.options']",
    ]
    assert MujocoRobot.NEEDS == ("mujoco", "mujoco")
