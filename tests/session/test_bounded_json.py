"""JSON that nobody vouches for."""

import pytest

from weberlink.bounded_json import DEEPEST, parse


@pytest.mark.parametrize("depth", [1, DEEPEST - 1, DEEPEST])
def test_what_is_within_the_bounds_is_read(depth: int) -> None:
    assert str(parse(b"[" * depth + b"]" * depth, 1000)) == "[" * depth + "]" * depth
    assert parse(b'{"a": [1, -2.5e-3, true, null, "x"]}', 1000) == {"a": [1, -0.0025, True, None, "x"]}


@pytest.mark.parametrize(
    "text",
    [
        b"[" * 100_000,
        b"[" * (DEEPEST + 1) + b"]" * (DEEPEST + 1),
        b'{"a":' * (DEEPEST + 1) + b"1" + b"}" * (DEEPEST + 1),
        b"NaN",
        b"[-Infinity]",
        b"1e999",
        b"1" * 5000,
        b"\xff",
        b"",
        b'"' + b"x" * 1_000_000 + b'"',
    ],
)
def test_everything_else_is_a_value_error(text: bytes) -> None:
    with pytest.raises(ValueError):
        parse(text, 200_000)
