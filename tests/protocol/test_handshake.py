"""The two messages of the handshake: maps, fields, refusals, and what two ends say of a difference."""

from collections.abc import Callable, Mapping

import pytest
from hypothesis import given, strategies as st

from tests.protocol.harness import local_end
from weberlink.protocol.handshake import (
    EPOCH_BYTES,
    HELLO_FIELDS,
    HELLO_HEADER,
    INSTANCE_BYTES,
    OPTIONAL,
    WELCOME_FIELDS,
    Hello,
    differences,
    pack_hello,
    pack_refusal,
    read_fields,
    read_map,
)
from weberlink.protocol.keys import LONGEST_NAME, check_name
from weberlink.protocol.local_end import PADDED_HELLO

HELLO = Hello(
    local_end().packed,
    123_456,
    "ann@operator",
    bytes(range(INSTANCE_BYTES)),
    "robot:47000",
    True,
    400_000,
    0,
    "stop",
    bytes(EPOCH_BYTES),
)
WELCOME = {"clock_us": 1, "delta_us": -2, "name": "robot:47000", "longest_round_trip_us": 400_000}


@pytest.mark.parametrize("overhead", [20, 48])
@pytest.mark.parametrize("size", [0, 10, 200, 235, 250, 490, 600])
def test_a_hello_survives_and_is_padded(overhead: int, size: int) -> None:
    hello = HELLO._replace(agreement=bytes(size))
    payload = pack_hello(hello, overhead)
    assert HELLO_HEADER.size + overhead + len(payload) >= PADDED_HELLO
    assert read_fields(read_map(payload) or {}, HELLO_FIELDS) == [*hello]


@pytest.mark.parametrize("name", ["", "a" * (LONGEST_NAME + 1), "a\x1b[2J", "a\n", "\u202e"])
def test_an_invalid_name_is_refused(name: str) -> None:
    with pytest.raises(ValueError, match="printable"):
        check_name(name)
    assert read_fields({**HELLO._asdict(), "name": name}, HELLO_FIELDS) is None
    assert read_fields({**WELCOME, "name": name}, WELCOME_FIELDS) is None
    assert not name or read_fields({**HELLO._asdict(), "expects": name}, HELLO_FIELDS) is None


@pytest.mark.parametrize(
    "packed",
    [
        b"", b"\xc1", b"\x90", b"\x93\x01\x02", b"\x81\x01\x02", b"\x81\xa1a", b"\x81\xa1\xff\x01", b"\x80\x80",
        b"\x91" * 3000, b"\x81\xa1a" * 3000, b"\x81\xc4\x01a\x01", b"\xdf\xff\xff\xff\xff", b"\xd6\xff\xff\xff\xff\xff",
    ],
)  # fmt: skip
def test_bytes_that_are_no_map_with_text_keys_are_none(packed: bytes) -> None:
    assert read_map(packed) is None


@pytest.mark.parametrize(("body", "checks"), [(HELLO._asdict(), HELLO_FIELDS), (WELCOME, WELCOME_FIELDS)])
@pytest.mark.parametrize("value", [None, [1], {}, 2**63, 1.5, b"x" * 7, "x" * 65, -(2**60), True])
def test_a_body_with_a_false_or_missing_field_is_none(
    body: Mapping[str, object], checks: Mapping[str, Callable[[object], bool]], value: object
) -> None:
    assert read_fields(body, checks) == list(body.values())
    for field in checks:
        without = read_fields({key: content for key, content in body.items() if key != field}, checks)
        assert without is None or without[list(checks).index(field)] == OPTIONAL[field]
        if (field, value) not in (("agreement", b"x" * 7), ("takes_over", True)):
            assert read_fields({**body, field: value}, checks) is None


@given(st.text(max_size=2000), st.integers(40, 600))
def test_a_refusal_is_cut_to_its_room(message: str, room: int) -> None:
    payload = pack_refusal(message, room)
    assert len(payload) <= room
    said = (read_map(payload) or {})["refusal"]
    assert isinstance(said, str)
    assert room - 2 <= len(pack_refusal("x" * 2000, room)) <= room
    whole = message.encode(errors="replace").decode()
    assert said == whole or whole.startswith(said.removesuffix("..."))


VALUES = st.one_of(st.integers(-1000, 1000), st.booleans(), st.text(max_size=5), st.none(), st.floats(-10, 10))
AGREEMENTS = st.dictionaries(st.sampled_from(["a", "b.c", "b.d", "rate_hz"]), VALUES)


@given(AGREEMENTS, AGREEMENTS)
def test_a_difference_names_each_key_and_both_values(master: dict[str, object], slave: dict[str, object]) -> None:
    assert local_end(agreement=master).agreement == master
    assert (differences(master, slave) == "") == (master == slave)
    assert (
        differences({"a": None}, {"b": 1})
        == "a: master has None, slave has nothing; b: master has nothing, slave has 1"
    )
