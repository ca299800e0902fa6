"""Parse JSON from an untrusted source, with bounds on size, nesting and numbers."""

import json
from math import isfinite
from typing import Any

DEEPEST = 32  # largest nesting of lists and objects; a description of a session has 8
LONGEST_NUMBER = 32  # most characters of a number


def parse(data: bytes, longest: int) -> Any:
    """Parse a JSON text in UTF-8. ValueError if it has more than the `longest` bytes, is not JSON, is nested deeper
    than `DEEPEST`, or holds a number that is not finite or longer than `LONGEST_NUMBER`."""
    if len(data) > longest:
        raise ValueError(f"more than {longest} bytes")
    try:
        value = json.loads(data.decode(), parse_constant=_number, parse_float=_number, parse_int=_integer)
    except RecursionError:
        raise ValueError(_TOO_DEEP) from None
    if _is_deeper(value, DEEPEST):
        raise ValueError(_TOO_DEEP)
    return value


_TOO_DEEP = f"nested more than {DEEPEST} deep"


def _integer(text: str) -> int:
    if len(text) > LONGEST_NUMBER:
        raise ValueError("a number is too long")
    return int(text)


def _number(text: str) -> float:
    value = float(text) if len(text) <= LONGEST_NUMBER else float("nan")
    if not isfinite(value):
        raise ValueError("a number is not finite or too long")
    return value


def _is_deeper(value: object, most: int) -> bool:
    within = value.values() if isinstance(value, dict) else value if isinstance(value, list) else None
    return within is not None and (most == 0 or any(_is_deeper(each, most - 1) for each in within))
