"""Configuration errors in one line: field path, what was expected, and the nearest known key."""

import re
from collections.abc import Iterator, Mapping, Sequence
from difflib import get_close_matches
from importlib.util import find_spec
from traceback import format_exception
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError
from pydantic.errors import PydanticInvalidForJsonSchema
from pydantic_core import ErrorDetails

from weberlink.installation import install_line
from weberlink.registry import PartError, fault_of

M = TypeVar("M", bound=BaseModel)


class ConfigurationError(ValueError):
    """A file, a field or an argument is wrong; the text is one line: where, and what was expected."""


def trace_of(error: BaseException) -> list[str]:
    """The trace of a part by name, such as a driver, that raised what an error tells; empty where none did."""
    at: BaseException | None = error
    while at is not None:
        if isinstance(at, PartError):
            return format_exception(at.__cause__)
        if fault_of(at) is not None:
            return format_exception(at)
        within = at.errors(include_url=False) if isinstance(at, ValidationError) else ()
        causes = (each.get("ctx", {}).get("error") for each in within)
        at = next((cause for cause in causes if isinstance(cause, PartError)), at.__cause__ or at.__context__)
    return []


def require_package(package: str, extra: str, asked: str) -> None:
    """Raise ConfigurationError if an optional package is missing, which this extra of the project installs; `asked` is
    the option or key that needs it, as the user wrote it.
    """
    if find_spec(package) is None:
        raise ConfigurationError(f"{asked}: needs {package}; install it with: {install_line(extra)}")


STUCK = re.compile(r"[ \t]*(?:- )?([A-Za-z_]\w*:)(?=[^\s:/])")
"""A key whose value follows without a space: for YAML, both are one word."""


def no_space(stuck: re.Match[str]) -> str:
    return f'a space is missing behind "{stuck[1]}"'


def one_of(known: Sequence[str], given: object) -> str:
    """What a value that is none of several names should be; with the nearest of them."""
    nearest = get_close_matches(str(given), known, n=1)
    listed = f"{', '.join(map(repr, known[:-1]))} or {known[-1]!r}" if len(known) > 1 else repr(known[0])
    return f"should be {listed}, not {given!r}" + (f"; did you mean {nearest[0]}?" if nearest else "")


def validated(model: type[M], document: Mapping[str, Any], *where: str, strict: bool | None = None) -> M:
    """Settings of the part of a file at the path `where`; raises ConfigurationError for the first of its errors. If
    `strict`, a text is no number.
    """
    try:
        return model.model_validate(document, strict=strict)
    except ValidationError as error:
        raise ConfigurationError(_line(error, model, document, where)) from None


def _line(error: ValidationError, model: type[BaseModel], document: Mapping[str, Any], where: tuple[str, ...]) -> str:
    """The first error; a wrong key comes before the missing one that it may stand for."""
    errors = error.errors(include_url=False)
    first = errors[0]
    path = _path(first, document)
    if first["type"] == "missing":
        siblings = (each for each in errors if each["loc"][:-1] == first["loc"][:-1])
        first = next((each for each in siblings if each["type"] == "extra_forbidden"), first)
    elif len(path) < len(first["loc"]):  # of a setting of several forms, the error of the form that the value has
        alike = (each for each in errors if each["loc"][: len(path)] == first["loc"][: len(path)])
        first = next((each for each in alike if each["type"] not in _EXPECTED), first)
    path = _path(first, document)
    shown = ".".join((*where, *map(str, path))) or "the file"
    if first["type"] == "extra_forbidden":
        return f"{shown}: unknown key{_hint(model, document, path)}"
    if not path and first["type"] == "value_error":  # of several fields; the message names them
        return _expectation(first)
    return f"{shown}: {_expectation(first)}"


def _path(error: ErrorDetails, document: Any) -> list[int | str]:
    """The keys and indices of an error; its location has tags and forms of settings too, which no document has."""
    path: list[int | str] = []
    for part in error["loc"]:
        if isinstance(document, Mapping | Sequence) and not isinstance(document, str):
            try:
                document = document[part]  # type: ignore[index]
            except (KeyError, IndexError, TypeError):
                continue
            path.append(part)
    return [*path, error["loc"][-1]] if error["type"] == "missing" else path


def _hint(model: type[BaseModel], document: Any, path: Sequence[int | str]) -> str:
    """The nearest of the keys that are known in the place of an unknown one, or all of them; or where it may belong."""
    try:
        schema = model.model_json_schema()
    except PydanticInvalidForJsonSchema:
        return ""
    definitions = schema.get("$defs", {})
    nodes = list(_forms(schema, definitions, document))
    for part in path[:-1]:
        document = document[part]
        below = [node.get("properties", {}).get(part) or node.get("additionalProperties") for node in nodes]
        below += [node.get("items") for node in nodes]
        nodes = [each for node in below if isinstance(node, dict) for each in _forms(node, definitions, document)]
    keys = {name: each for node in nodes for name, each in node.get("properties", {}).items()}
    close = get_close_matches(str(path[-1]), keys, n=1, cutoff=0.5)
    hint = f"; did you mean {close[0]}?" if close else f"; known are {', '.join(sorted(keys))}" if keys else ""
    takes_any = [
        name
        for name, each in keys.items()
        if any(node.get("additionalProperties") is True for node in _forms(each, definitions, {}))
    ]
    if len(takes_any) == 1:
        hint += f"; options of a driver belong into {'.'.join(map(str, (*path[:-1], *takes_any)))}"
    return hint


def _forms(node: dict[str, Any], definitions: dict[str, Any], document: Any) -> Iterator[dict[str, Any]]:
    """The forms of a JSON Schema that a part of a document may have, without those of other tags."""
    if "$ref" in node:
        node = definitions[node["$ref"].rpartition("/")[2]]
    for each in node.get("anyOf", node.get("oneOf", ())):
        yield from _forms(each, definitions, document)
    fields = node.get("properties", {}).items()
    tags = {name: field["const"] for name, field in fields if "const" in field}
    if not (isinstance(document, Mapping) and any(document.get(name, tag) != tag for name, tag in tags.items())):
        yield node


# What a value should be, by the type of error of pydantic, whose own words name its classes.
_EXPECTED = {
    "tuple_type": "should be a list",
    "list_type": "should be a list",
    "model_type": "should be a mapping of keys",
    "model_attributes_type": "should be a mapping of keys",
    "dict_type": "should be a mapping of keys",
    "path_type": "should be a path",
    "string_type": "should be text",
    "float_type": "should be a number",
    "float_parsing": "should be a number",
    "int_type": "should be a whole number",
    "int_parsing": "should be a whole number",
    "int_from_float": "should be a whole number",
    "bool_type": "should be true or false",
    "bool_parsing": "should be true or false",
    "union_tag_not_found": "shape is missing",
}


def _expectation(error: ErrorDetails) -> str:
    message = error["msg"].removeprefix("Value error, ").removeprefix("Input ")
    given = error["input"]
    if error["type"] == "missing":
        return "is missing"
    if error["type"] == "value_error":
        return message
    if error["type"] == "literal_error":
        return one_of(re.findall(r"'([^']*)'", error["ctx"]["expected"]), given)
    message = _EXPECTED.get(error["type"], message)
    shown = "" if isinstance(given, (dict, BaseModel)) else f", not {given!r}"
    stuck = STUCK.match(given) if isinstance(given, str) and "mapping" in message else None
    return f"{message}{shown}" if stuck is None else f"{message}{shown}; {no_space(stuck)}"
