"""What LeRobot asks of a plugin that it shall find, checked without LeRobot: names, and nothing imported too early."""

import ast
import tomllib
from pathlib import Path
from typing import Any

import pytest

PLUGINS = sorted((Path(__file__).parents[2] / "plugins").glob("lerobot_*"))


def classes(package: Path) -> dict[str, ast.ClassDef]:
    trees = (ast.parse(path.read_text(encoding="utf-8")) for path in package.glob("*.py"))
    return {node.name: node for tree in trees for node in tree.body if isinstance(node, ast.ClassDef)}


def exported(package: Path) -> Any:
    tree = ast.parse((package / "__init__.py").read_text(encoding="utf-8"))
    (names,) = (node.value for node in tree.body if isinstance(node, ast.Assign))
    return ast.literal_eval(names)


@pytest.mark.parametrize("plugin", PLUGINS, ids=lambda path: path.name)
def test_plugin_can_be_found_by_lerobot(plugin: Path) -> None:
    """LeRobot imports each distribution by its raw name, and makes a device from the name of its configuration."""
    assert len(PLUGINS) == 2
    project = tomllib.loads((plugin / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert project["name"] == plugin.name
    assert plugin.name.startswith(("lerobot_robot_", "lerobot_teleoperator_"))
    found = classes(plugin / plugin.name)
    (config,) = (name for name in found if name.endswith("Config"))
    assert exported(plugin / plugin.name) == [config.removesuffix("Config"), config]
    decorators = [ast.unparse(each) for each in found[config].decorator_list]
    assert decorators[0] == f"{ast.unparse(found[config].bases[0])}.register_subclass('weberlink')"
