"""Configuration errors in one line: field path, what was expected, and the nearest known key."""

import re
from collections.abc import Sequence
from difflib import get_close_matches
from importlib.util import find_spec
from traceback import format_exception
from typing import Any

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from weberlink.installation import install_line
from weberlink.registry import PartError, fault_of


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


STUCK = re.compile(r"[ \t]*(?:- )?([A-Za-z_]\w*:)(?=[^\s:/])")
"""A key whose value follows without a space: for YAML, both are one word."""


def no_space(stuck: re.Match[str]) -> str:
    return f'a space is missing behind "{stuck[1]}"'


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
"""What a value should be, by the type of error of pydantic, whose own words name its classes."""


def describe(error: ValidationError, model: type[BaseModel], where: tuple[str, ...]) -> str:
    """Describe the first error in one line; a wrong key comes before the missing one that it may stand for."""
    errors = error.errors(include_url=False)
    unknown = (
        each for each in errors if each["type"] == "extra_forbidden" and each["loc"][:-1] == errors[0]["loc"][:-1]
    )
    first = next(unknown, errors[0]) if errors[0]["type"] == "missing" else _nearest_form(errors)
    location, known, sections = _place(model, tuple(str(part) for part in first["loc"]))
    path = ".".join((*where, *location)) or "the file"
    if first["type"] == "extra_forbidden":
        return f"{path}: unknown key{_nearest(location[-1], known)}{sections}"
    if not location and first["type"] == "value_error":  # of several fields; the message names them
        return _expectation(first)
    return f"{path}: {_expectation(first)}"


_FORM = re.compile(r"constrained-\w+|`?(tuple|list)\[.*|float|int")
"""How pydantic names the forms of a setting that may be a number or a list."""


def _nearest_form(errors: Sequence[ErrorDetails]) -> ErrorDetails:
    """The first error; of a setting of several forms, that of the form which the value has."""
    first = errors[0]
    at = next((place for place, part in enumerate(first["loc"]) if _FORM.fullmatch(str(part))), None)
    if at is None:
        return first
    alike = (each for each in errors if each["loc"][:at] == first["loc"][:at] and each["type"] not in _EXPECTED)
    return next(alike, first)


def one_of(known: Sequence[str], given: object) -> str:
    """What a value that is none of several names should be; with the nearest of them."""
    nearest = get_close_matches(str(given), known, n=1)
    listed = f"{', '.join(map(repr, known[:-1]))} or {known[-1]!r}" if len(known) > 1 else repr(known[0])
    return f"should be {listed}, not {given!r}" + (f"; did you mean {nearest[0]}?" if nearest else "")


def _nearest(key: str, known: list[str]) -> str:
    close = get_close_matches(key, known, n=1, cutoff=0.5)
    if close:
        return f"; did you mean {close[0]}?"
    return f"; known are {', '.join(known)}" if known else ""


def _place(model: type[BaseModel], location: tuple[str, ...]) -> tuple[list[str], list[str], str]:
    """The path of a location as the file has it, the keys that are known beside its last part, and where others belong.

    The parts of a location are keys, indices, tags of unions and forms of a setting; the file has no tags or forms.
    """
    candidates, sections = [model], ""
    path: list[str] = []
    known: list[str] = []
    for part in location:
        open_ = [
            name for each in candidates for name, field in each.model_fields.items() if _takes_any(field.annotation)
        ]
        sections = f"; options of a driver belong into {'.'.join([*path, *open_])}" if len(open_) == 1 else ""
        known = sorted({name for candidate in candidates for name in candidate.model_fields})
        having = [candidate for candidate in candidates if part in candidate.model_fields]
        tagged = [candidate for candidate in candidates if part in _tags(candidate)]
        if tagged and not having:
            candidates = tagged
            continue
        if _FORM.fullmatch(part) and not having:
            continue
        path.append(part)
        below = [child for each in having for child in _models_in(each.model_fields[part].annotation)]
        candidates = below or candidates
    return path, known, sections


def _takes_any(annotation: Any) -> bool:
    """Whether a field holds keys that its driver knows."""
    return any(each.model_config.get("extra") == "allow" for each in _models_in(annotation))


def _models_in(annotation: Any) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation, *getattr(annotation, "variants", list)()]
    return [model for argument in getattr(annotation, "__args__", ()) for model in _models_in(argument)]


def _tags(model: type[BaseModel]) -> set[str]:
    """Literal values of a model's fields, which select it from a union."""
    return {
        value
        for field in model.model_fields.values()
        for value in getattr(field.annotation, "__args__", ())
        if isinstance(value, str)
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


def require_package(package: str, extra: str, asked: str) -> None:
    """Require an optional package.

    Args:
        package: import name.
        extra: extra of this project that installs it.
        asked: the option or key that needs it, as the user wrote it.

    Raises:
        ConfigurationError: it is not installed.
    """
    if find_spec(package) is None:
        raise ConfigurationError(f"{asked}: needs {package}; install it with: {install_line(extra)}")
