"""The JSON Schema of configuration files, for editors: completion, ranges and explanations while one types.

`python -m weberlink.config.schema OUT` writes it; a test holds the shipped one against the code.
"""

import ast
import inspect
import json
import sys
from itertools import pairwise
from pathlib import Path
from typing import Any

from weberlink.codec.deadband import DEADBANDS
from weberlink.config import joints, model
from weberlink.config.deadband import settings_of
from weberlink.config.finders import FINDERS
from weberlink.config.model import System
from weberlink.installation import guests
from weberlink.master.devices import DEVICES
from weberlink.master.devices.leaders import LEADERS
from weberlink.registry import Registry
from weberlink.slave.robots import ROBOTS
from weberlink.slave.robots.followers import FOLLOWERS


def schema() -> dict[str, Any]:
    """The schema of a whole file, with the options of every driver of the kernel and its guests; needs all of them."""
    document = System.model_json_schema()
    definitions = document["$defs"]
    _explain(definitions | {System.__name__: document})
    del definitions["DriverSettings"]
    parts: tuple[tuple[str, str, tuple[Registry[Any], ...]], ...] = (
        ("MasterSettings", "device", (DEVICES, LEADERS)),
        ("SlaveSettings", "robot", (ROBOTS, FOLLOWERS)),
        ("LinkSettings", "finder", (FINDERS,)),
    )
    for owner, field, tables in parts:
        drivers = {name: table.load(name) for table in tables for name in (*table.built_in, *guests(table.group))}
        choices = [_driver(name, driver.Options, definitions) for name, driver in drivers.items()]
        # A driver of another package may take any options.
        other = {"properties": {"driver": {"not": {"enum": list(drivers)}, "type": "string"}}}
        made = {"type": "object", "required": ["driver"], "oneOf": [*choices, other]}
        is_optional = "anyOf" in definitions[owner]["properties"][field]
        definitions[owner]["properties"][field] = {"anyOf": [made, {"type": "null"}]} if is_optional else made
    del definitions["ShapeSettings"]
    shapes = {each.__name__: each.model_json_schema() for each in map(settings_of, DEADBANDS.built_in)}
    definitions.update(shapes)
    # A deadband of another package may take any options.
    other_shape = {"not": {"enum": list(DEADBANDS.built_in)}, "type": "string"}
    other_deadband: dict[str, Any] = {"properties": {"shape": other_shape}, "type": "object"}
    default = definitions["ForceCodecSettings"]["properties"]["deadband"]["default"]
    definitions["ForceCodecSettings"]["properties"]["deadband"] = {
        "default": default,
        "oneOf": [*({"$ref": f"#/$defs/{name}"} for name in shapes), other_deadband],
        "title": "Deadband",
    }
    return document | {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "WeberLink configuration"}


def _explain(definitions: dict[str, Any]) -> None:
    """Describe every field by the text below it. Pydantic could, but a daemon would wait for that at every start."""
    classes = [
        (module, node)
        for module in (joints, model)
        for node in ast.parse(inspect.getsource(module)).body
        if isinstance(node, ast.ClassDef)
    ]
    known = {node.name: getattr(module, node.name) for module, node in classes}
    for _, each in classes:
        heirs = [heir for heir in definitions if issubclass(known.get(heir, object), known[each.name])]
        for field, text in pairwise(each.body):
            match field, text:
                case ast.AnnAssign(target=ast.Name(id=name)), ast.Expr(value=ast.Constant(value=str() as explanation)):
                    for properties in (definitions[heir]["properties"] for heir in heirs):
                        if name in properties:
                            described = properties[name] | {"description": inspect.cleandoc(explanation)}
                            properties[name] = dict(sorted(described.items()))


def _driver(name: str, options: Any, definitions: dict[str, Any]) -> dict[str, Any]:
    """One driver's options with its name; moves the definitions they use to the document's."""
    made: dict[str, Any] = options.model_json_schema()
    definitions.update(made.pop("$defs", {}))
    made["properties"] = {"driver": {"const": name}} | made["properties"]
    return made


def as_text(document: dict[str, Any]) -> str:
    """The schema as JSON with a line for each definition: a changed definition is one changed line."""
    definitions = ",\n".join(f"  {json.dumps(name)}: {json.dumps(each)}" for name, each in document["$defs"].items())
    others = [f" {json.dumps(name)}: {json.dumps(each)}" for name, each in document.items() if name != "$defs"]
    return "{\n" + ",\n".join([f' "$defs": {{\n{definitions}\n }}', *others]) + "\n}\n"


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(as_text(schema()), encoding="utf-8")
