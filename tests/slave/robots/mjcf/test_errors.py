"""What is wrong with a file is said in one line that begins with the option."""

from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("mujoco", reason="needs mujoco (extra: mujoco)")

from tests.slave.robots.mjcf.models import SLIDES, chain, gantry, robot

BALL = SLIDES + '<joint name="ball" type="ball"/>'
FIXED = '<mujoco><worldbody><body><geom size="0.1"/><site name="tip"/></body></worldbody></mujoco>'


@pytest.mark.parametrize(
    ("text", "options", "line"),
    [
        ("<mujoco><worldbody></mujoco>", {}, r"^model: .*model\.xml: XML parse error .*MISMATCHED"),
        ('<mujoco><include file="part.xml"/></mujoco>', {}, r"^model: .*part\.xml"),
        (gantry(), {"end_effector": "tipp"}, r"^end_effector: no site is called 'tipp'; nearest is 'tip', there are f"),
        (FIXED, {}, r"^end_effector: no joint moves the site 'tip'$"),
        (gantry(), {"force": "shaken"}, r"^force: no force sensor is called 'shaken'; nearest is 'wrist'"),
        (chain(), {"keyframe": "bend"}, r"^keyframe: no keyframe is called 'bend'; nearest is 'bent'"),
        (chain(), {"keyframe": "bent"}, r"^home_m: \[.*\] is outside of workspace_m"),
        (chain(), {"home_m": (9.0, 0.0, 0.0), "workspace_m": 9.0}, r"^home_m: .* no closer than 8\.\d m to \[9"),
        (gantry(), {"stiffness_n_m": 1e9}, r"^stiffness_n_m: 1e\+09 is too much for the 0\.2 kg .* at most 8\.1e\+07$"),
        (gantry(), {"rotation": {"torque": "twist"}}, r"^rotation\.torque: the model has no torque sensor with a name"),
        (gantry(joints=BALL), {"rotation": {"stiffness_n_m_rad": 1e7}}, r"rotation\.stiffness_n_m_rad: .* divide"),
    ],
)  # fmt: skip
def test_a_file_or_a_name_that_is_wrong(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], text: str, options: dict[str, Any], line: str
) -> None:
    with pytest.raises(ValueError, match=line) as caught:
        robot(tmp_path, text, **options)
    assert "\n" not in str(caught.value)
    assert tuple(capfd.readouterr()) == ("", "")
