"""docs/scenes.md says what there is."""

import re
from pathlib import Path

import yaml
from pydantic import TypeAdapter

from weberlink.slave.scenes.settings import BUILT_IN, SceneSettings, build

PAGE = (Path(__file__).parents[3] / "docs" / "scenes.md").read_text(encoding="utf-8")


def test_every_shape_is_listed_with_its_keys() -> None:
    table = PAGE.split("\n| shape |", 1)[1].split("\n\n", 1)[0]
    listed = dict(re.findall(r"^\| `(\w+)` \|(.*)", table, re.M))
    assert listed.keys() == BUILT_IN.keys()
    for name, shape in BUILT_IN.items():
        assert set(shape.model_fields) - {"shape"} <= set(re.findall(r"`(\w+)`", listed[name]))


def test_the_example_is_a_scene() -> None:
    (example,) = re.findall(r"```yaml\n(.*?)```", PAGE, re.S)
    objects = yaml.safe_load(example)["slave"]["scene"]
    scene = build(TypeAdapter(SceneSettings).validate_python(objects))
    assert scene.moves
    assert scene.rubs
