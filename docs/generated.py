"""Writes what the wheel has of the code and of the guests: the JSON Schema of configuration files, for completion,
ranges and explanations in editors, and the list of guests. `make schema` runs it; tests hold both against the code.
"""

import ast
import json
import tomllib
from collections.abc import Iterable, Iterator
from inspect import cleandoc, getsource
from itertools import pairwise
from pathlib import Path
from textwrap import dedent
from typing import Any

from weberlink.codec.deadband import DEADBANDS
from weberlink.config.loading import DRIVERS
from weberlink.config.model import System
from weberlink.config.settings import Settings, settings_of
from weberlink.installation import CONFIGS, GUESTS, NEEDED, guests


def schema() -> dict[str, Any]:
    """The schema of a whole file, with the options of every driver of the kernel and its guests; needs all of them."""
    document = System.model_json_schema()
    definitions = document["$defs"]
    explained: dict[str, type] = {each.__name__: each for each in _heirs(Settings)}
    explained |= {settings_of(shape).__name__: DEADBANDS[shape].Options for shape in DEADBANDS}
    for name, section in (definitions | {System.__name__: document}).items():
        for base in reversed(explained[name].__mro__) if name in explained else ():
            if base.__module__.startswith(("weberlink.", "weberlink_")):
                _explain(section, base)
    del definitions["DriverSettings"]
    for where, tables in DRIVERS.items():
        section_name, _, field = where.partition(".")
        owner = f"{section_name.title()}Settings"
        drivers = {name: table.load(name) for table in tables for name in (*table.built_in, *guests(table.group))}
        choices = []
        for name, driver in drivers.items():
            options: dict[str, Any] = driver.Options.model_json_schema()
            definitions.update(options.pop("$defs", {}))
            choices.append(options | {"properties": {"driver": {"const": name}} | options["properties"]})
        # A driver of another package may take any options.
        other = {"properties": {"driver": {"not": {"enum": list(drivers)}, "type": "string"}}}
        made = {"type": "object", "required": ["driver"], "oneOf": [*choices, other]}
        is_optional = "anyOf" in definitions[owner]["properties"][field]
        definitions[owner]["properties"][field] = {"anyOf": [made, {"type": "null"}]} if is_optional else made
    # A deadband of another package may take any options.
    others = {"properties": {"shape": {"not": {"enum": list(DEADBANDS)}, "type": "string"}}, "type": "object"}
    deadband = definitions["ForceCodecSettings"]["properties"]["deadband"]
    deadband["oneOf"].append(others)
    del deadband["discriminator"]
    return document | {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "WeberLink configuration"}


def _heirs(base: type[Any]) -> Iterator[type[Any]]:
    for each in base.__subclasses__():
        yield each
        yield from _heirs(each)


def _explain(section: dict[str, Any], owner: type) -> None:
    """Describe fields by the text below them. Pydantic could, but a daemon would wait for that at every start."""
    (body,) = ast.parse(dedent(getsource(owner))).body
    assert isinstance(body, ast.ClassDef)
    for field, text in pairwise(body.body):
        match field, text:
            case ast.AnnAssign(target=ast.Name(id=name)), ast.Expr(value=ast.Constant(value=str() as explanation)):
                if name in section["properties"]:
                    described = section["properties"][name] | {"description": cleandoc(explanation)}
                    section["properties"][name] = dict(sorted(described.items()))


def as_text(document: dict[str, Any]) -> str:
    """The schema as JSON with a line for each definition: a changed definition is one changed line."""
    definitions = ",\n".join(f"  {json.dumps(name)}: {json.dumps(each)}" for name, each in document["$defs"].items())
    others = [f" {json.dumps(name)}: {json.dumps(each)}" for name, each in document.items() if name != "$defs"]
    return "{\n" + ",\n".join([f' "$defs": {{\n{definitions}\n }}', *others]) + "\n}\n"


def list_guests(plugins: Path) -> str:
    """The content of `GUESTS` for a folder that has one folder for each guest."""
    found: dict[str, dict[str, str]] = {}
    for path in sorted(plugins.glob("*/pyproject.toml")):
        project = tomllib.loads(path.read_text(encoding="utf-8"))["project"]
        for group, entries in project.get("entry-points", {}).items():
            names: Iterable[str] = entries
            if group == CONFIGS:  # configurations by their stem, other files and folders by name
                own = (each for each in path.parent.glob("configs/[!_]*") if not each.is_symlink())
                names = sorted(each.stem if each.suffix == ".yaml" else each.name for each in own)
            found.setdefault(group, {}).update(dict.fromkeys(names, path.parent.name))
        ours = (each for each in project["dependencies"] if each.startswith("weberlink-"))
        if needed := " ".join(each.removeprefix("weberlink-").partition("=")[0] for each in ours):
            found.setdefault(NEEDED, {})[path.parent.name] = needed
    return json.dumps(found, indent=1, sort_keys=True) + "\n"


if __name__ == "__main__":
    root = Path(__file__).parents[1]
    GUESTS.write_text(list_guests(root / "plugins"), encoding="utf-8")
    (root / "configs" / "weberlink.schema.json").write_text(as_text(schema()), encoding="utf-8")
