"""Sphinx configuration of the documentation; `make docs` builds it."""

import json
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path
from typing import Any

from click import Command, Context, Group
from typer.main import get_command

from weberlink.cli import app
from weberlink.protocol import wire

project, author, copyright = "WeberLink", "The WeberLink authors", "The WeberLink authors, Apache-2.0"  # noqa: A001
release = metadata.version("weberlink")
extensions = ["myst_parser"]
html_theme = "furo"
html_title = f"WeberLink {release}"
exclude_patterns = ["_build"]
myst_heading_anchors = 4

HERE = Path(__file__).parent
SCHEMA = HERE.parent / "configs" / "weberlink.schema.json"
REFERENCE, COMMANDS = HERE / "configuration.md", HERE / "command-reference.md"
DATAGRAMS = HERE / "datagrams.md"


def rows(schema: dict[str, Any], definitions: dict[str, Any], path: str) -> list[str]:
    """Table rows of all keys below a schema, depth first."""
    found = []
    for name, field in schema.get("properties", {}).items():
        where = f"{path}.{name}" if path else name
        options = [field, *field.get("anyOf", []), *field.get("oneOf", []), *field.get("allOf", [])]
        below = [definitions[each["$ref"].rpartition("/")[2]] for each in options if "$ref" in each]
        drivers = [each for each in field.get("oneOf", []) if "driver" in each.get("properties", {})]
        if not below or "default" in field:
            kind = field.get("type") or " or ".join(each.get("type", "object") for each in options[1:]) or "object"
            values = ", ".join(f"`{value}`" for value in field.get("enum", [])) or kind
            limits = [f"{sign} {field[key]:g}" for key, sign in LIMITS.items() if key in field]
            default = f"`{json.dumps(field['default'])}`" if "default" in field and not below else ""
            text = " ".join(field.get("description", "").split()).replace("|", "\\|")
            found.append(f"| `{where}` | {' '.join([values, *limits])} | {default} | {text} |")
        for each in below:
            found += rows(each, definitions, where)
        for each in drivers:
            driver = each["properties"]["driver"].get("const")
            if driver:
                inner = {key: value for key, value in each["properties"].items() if key != "driver"}
                found += rows({"properties": inner}, definitions, f"{where}({driver})")
    return found


LIMITS = {"minimum": ">=", "exclusiveMinimum": ">", "maximum": "<=", "exclusiveMaximum": "<"}


def helps(name: str, command: Command) -> Iterator[str]:
    """The help of a command, or of each member of a group, as a section."""
    context = Context(command)
    for member in command.list_commands(context) if isinstance(command, Group) else ():  # loads those of the guests
        yield from helps(f"{name} {member}", command.get_command(context, member))
    if not isinstance(command, Group):
        text = command.get_help(Context(command, info_name=name, terminal_width=100, max_content_width=100))
        yield f"## {name}\n\n```text\n{text}\n```\n"


def setup(_app: object) -> None:
    """Write the references: configuration from its schema, commands from their help, datagrams from their table."""
    sections = "\n".join(helps("weberlink", get_command(app)))
    COMMANDS.write_text(f"# Command reference\n\nGenerated from the program.\n\n{sections}", encoding="utf-8")
    schema = json.loads(SCHEMA.read_text(encoding="utf-8"))
    lines = rows(schema, schema["$defs"], "")
    head = "# Configuration reference\n\nGenerated from the schema. Driver options stand behind their driver.\n\n"
    table = "| key | values | default | meaning |\n|---|---|---|---|\n"
    REFERENCE.write_text(head + table + "\n".join(dict.fromkeys(lines)) + "\n", encoding="utf-8")
    fields = "\n".join(
        f"| {part} | {name} | {'groups' if most == 0 else most if least == most else f'{least}-{most}'} | {meaning} |"
        for part, name, least, most, meaning in wire.TABLE
    )
    text = f"# Datagrams\n\n{wire.__doc__ or ''}\n| part | field | bits | meaning |\n|---|---|---|---|\n{fields}\n"
    DATAGRAMS.write_text(text, encoding="utf-8")
