"""Options of `arm_operator` that no type alone refuses: what is refused is named."""

import re
from typing import Any

import pytest
from pydantic import ValidationError

from weberlink.master.devices.leaders import load

HOLD = {"motion": "hold", "duration_s": 1.0}


@pytest.mark.parametrize(
    ("options", "named"),
    [
        ({"script": [{"motion": "move", "joints_rad": (0.0,)}]}, "script.0.joints_rad: expected 5 angles"),
        ({"script": [HOLD, {"motion": "move", "gripper_rad": 9.0}]}, "script.1: gripper: expected 0 to"),
        ({"script": [{"motion": "swing", "amplitude_rad": (1.0,)}]}, "script.0.amplitude_rad"),
        ({"hand": {"damping_nm_s_rad": (1.0,)}}, "hand.damping_nm_s_rad: expected one value"),
        ({"hand": {"stiffness_nm_rad": 0.0}}, "hand.stiffness_nm_rad: expected 1e-06 to "),
    ],
)
def test_what_cannot_be_is_refused_by_name(options: dict[str, Any], named: str) -> None:
    driver: Any = load("arm_operator")
    with pytest.raises(ValueError, match=r"\S") as caught:
        driver(driver.Options.model_validate(options), 0.001)
    error = caught.value
    where = [".".join(map(str, each["loc"])) for each in error.errors()] if isinstance(error, ValidationError) else []
    told = "\n".join([*where, str(error)])
    assert re.search(named, told), told
