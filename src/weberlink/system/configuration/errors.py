"""Configuration errors in one line: field path, what was expected, and the nearest known key."""

from difflib import get_close_matches
from typing import Any

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails


class ConfigurationError(ValueError):
    """A file, a field or an argument is wrong; the text is one line: where, and what was expected."""


def describe(error: ValidationError, model: type[BaseModel], where: tuple[str, ...]) -> str:
    """Describe the first error in one line."""
    first = error.errors(include_url=False)[0]
    location = tuple(str(part) for part in first["loc"])
    path = ".".join((*where, *location)) or "the file"
    if first["type"] == "extra_forbidden":
        return f"{path}: unknown key{_nearest(location, model)}"
    if not location and first["type"] == "value_error":  # of several fields; the message names them
        return _expectation(first)
    return f"{path}: {_expectation(first)}"


def _nearest(location: tuple[str, ...], model: type[BaseModel]) -> str:
    known = _keys_at(model, location[:-1])
    close = get_close_matches(location[-1], known, n=1, cutoff=0.5)
    if close:
        return f"; did you mean {close[0]}?"
    return f"; known are {', '.join(known)}" if known else ""


def _keys_at(model: type[BaseModel], location: tuple[str, ...]) -> list[str]:
    """The keys of the model at a location, whose parts are keys, indices and tags of unions."""
    candidates: list[type[BaseModel]] = [model]
    for part in location:
        below = [
            child
            for candidate in candidates
            if part in candidate.model_fields
            for child in _models_in(candidate.model_fields[part].annotation)
        ]
        tagged = [candidate for candidate in candidates if part in _tags(candidate)]
        candidates = below or tagged or candidates
    return sorted({name for candidate in candidates for name in candidate.model_fields})


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
    if error["type"] == "missing":
        return "is missing"
    if error["type"] == "value_error":
        return message
    given = error["input"]
    shown = "" if isinstance(given, (dict, BaseModel)) else f", not {given!r}"
    return f"{message}{shown}"
