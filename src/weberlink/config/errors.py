"""Configuration errors in one line: field path, what was expected, and the nearest known key."""

import re
from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from importlib.util import find_spec
from traceback import format_exception
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from weberlink.installation import install_line
from weberlink.options import refuse_unknown_keys
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
    the option or key that needs it, as the user wrote it."""
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
    `strict`, a text is no number."""
    try:
        refuse_unknown_keys(model, document)  # options of others need not be made of ours
        return model.model_validate(document, strict=strict)
    except ValidationError as error:
        raise ConfigurationError(_line(error.errors(include_url=False), document, where)) from None


def _line(errors: Sequence[ErrorDetails], document: Mapping[str, Any], where: tuple[str, ...]) -> str:
    """The first error; of a setting of several forms, that of the form that the value has."""
    first, path = errors[0], _path(errors[0], document)
    if len(path) < len(first["loc"]):
        alike = (each for each in errors if each["loc"][: len(path)] == first["loc"][: len(path)])
        first = next((each for each in alike if each["type"] not in _EXPECTED), first)
        path = _path(first, document)
    if not path and first["type"] == "value_error":  # of several fields; the message names them
        return _expectation(first)
    keys = [*where, *map(str, path)]
    line = f"{'.'.join(keys) or 'the file'}: {_expectation(first)}"
    into = first.get("ctx", {}).get("into")
    if into is None:
        return line
    return f"{line}{'' if line.endswith('?') else '.'} Options of a driver belong into {'.'.join((*keys[:-1], into))}"


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


# What a value should be, and the errors of pydantic that say so in words of its own classes.
_SHOULD_BE = {
    "a list": "tuple_type list_type",
    "a mapping of keys": "model_type model_attributes_type dict_type",
    "a path": "path_type",
    "text": "string_type",
    "a number": "float_type float_parsing",
    "a whole number": "int_type int_parsing int_from_float",
    "true or false": "bool_type bool_parsing",
}
_EXPECTED = {kind: f"should be {words}" for words, kinds in _SHOULD_BE.items() for kind in kinds.split()}
_EXPECTED["union_tag_not_found"] = "shape is missing"


def _expectation(error: ErrorDetails) -> str:
    message = error["msg"].removeprefix("Value error, ").removeprefix("Input ")
    given = error["input"]
    if error["type"] in ("missing", "extra_forbidden"):
        return "is missing" if error["type"] == "missing" else "unknown key"
    if error["type"] in ("value_error", "unknown_key"):
        return message
    if error["type"] == "literal_error":
        return one_of(re.findall(r"'([^']*)'", error["ctx"]["expected"]), given)
    message = _EXPECTED.get(error["type"], message)
    shown = "" if isinstance(given, (dict, BaseModel)) else f", not {given!r}"
    stuck = STUCK.match(given) if isinstance(given, str) and "mapping" in message else None
    return f"{message}{shown}" if stuck is None else f"{message}{shown}; {no_space(stuck)}"
