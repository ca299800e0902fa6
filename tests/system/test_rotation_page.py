"""docs/rotation.md, and what docs/devices/mujoco.md says of turning, is what there is."""

import re

import pytest
import yaml
from pydantic import BaseModel

from tests.system.systems import CONFIGS
from weberlink.geometry.vector import ZERO
from weberlink.master.devices.hand_options import WristOptions
from weberlink.slave.robots.mjcf.options import RotationOptions
from weberlink.slave.robots.point import PointOptions, PointRobot, ToolOptions

DOCS = CONFIGS.parent / "docs"
PAGE = (DOCS / "rotation.md").read_text(encoding="utf-8")
MUJOCO = (DOCS / "devices" / "mujoco.md").read_text(encoding="utf-8")


def defaults(page: str, heading: str) -> dict[str, str]:
    """First and second column of the table under `heading`, one entry for each name of a row of several."""
    table = page.split(f"\n| {heading} |", 1)[1].split("\n\n", 1)[0]
    listed: dict[str, str] = {}
    for first, second in re.findall(r"^\| (`.+?`) \|([^|]*)\|", table, re.M):
        names = re.findall(r"`(\w+)`", first)
        listed |= dict(zip(names, second.split(",") * (1 if "," in second else len(names)), strict=True))
    return {name: value.strip().strip("`") for name, value in listed.items()}


@pytest.mark.parametrize(
    ("page", "heading", "options"),
    [
        (PAGE, "key of `wrist`", WristOptions),
        (PAGE, "key of `tool`", ToolOptions),
        (MUJOCO, "key of `rotation`", RotationOptions),
    ],
)
def test_every_key_is_listed_with_its_default(page: str, heading: str, options: type[BaseModel]) -> None:
    listed = defaults(page, heading)
    assert listed.keys() == options.model_fields.keys()
    for name, field in options.model_fields.items():
        if field.is_required():
            assert listed[name] == ""
        elif isinstance(field.default, float):
            assert float(listed[name]) == field.default
        else:
            assert listed[name] == ("0" if field.default == ZERO else field.default)


def test_tool_of_the_page_can_be_built() -> None:
    (example,) = re.findall(r"```yaml\n(.*?)```", PAGE, re.S)
    options = yaml.safe_load(example)["slave"]["robot"]
    assert options.pop("driver") == "point"
    assert PointRobot(PointOptions(**options), None, 0.001).spec.torque_n_m == 2.0
