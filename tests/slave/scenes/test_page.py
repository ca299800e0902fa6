"""docs/scenes.md says what there is."""

import re
from pathlib import Path

import yaml
from pydantic import TypeAdapter

from weberlink.slave.scenes.settings import BUILT_IN, MotionSettings, ObjectSettings, SceneSettings, build

PAGE = (Path(__file__).parents[3] / "docs" / "scenes.md").read_text(encoding="utf-8")


def rows(heading: str) -> dict[str, str]:
    """First column of the table under `heading` to the rest of its row."""
    table = PAGE.split(f"\n| {heading} |", 1)[1].split("\n\n", 1)[0]
    return dict(re.findall(r"^\| `(\w+)` \|(.*)", table, re.M))


def test_every_shape_is_listed_with_its_keys() -> None:
    listed = rows("shape")
    assert listed.keys() == BUILT_IN.keys()
    for name, shape in BUILT_IN.items():
        assert set(shape.model_fields) - {"shape"} <= set(re.findall(r"`(\w+)`", listed[name]))


def test_page_lists_keys_of_surface_and_motion() -> None:
    assert rows("surface").keys() == ObjectSettings.model_fields.keys() - {"shape"}
    listed = rows("key of `motion`")
    assert listed.keys() == MotionSettings.model_fields.keys()
    for name, field in MotionSettings.model_fields.items():
        default = listed[name].split("|")[0].strip().strip("`")
        expected = "" if field.is_required() else str(field.default)
        assert default.strip("[]").replace(".0", "") == expected.strip("()").replace(".0", "")


def test_the_example_is_a_scene() -> None:
    (example,) = re.findall(r"```yaml\n(.*?)```", PAGE, re.S)
    objects = yaml.safe_load(example)["slave"]["scene"]
    scene = build(TypeAdapter(SceneSettings).validate_python(objects))
    assert scene.moves
    assert scene.rubs
