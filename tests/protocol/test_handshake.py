import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.protocol.harness import AGREEMENT
from weberlink.protocol import Role
from weberlink.protocol.handshake import (
    INSTANCE_BYTES,
    LARGEST_STAMP,
    LONGEST_NAME,
    PADDED_HELLO,
    Hello,
    HelloHeader,
    Welcome,
    check_name,
    differences,
    identity_of,
    pack_agreement,
    pack_hello,
    pack_refusal,
    read_answered,
    read_hello,
    read_hello_header,
    read_map,
    read_welcome,
)
from weberlink.protocol.wire import Kind

HELLO = Hello(
    pack_agreement(AGREEMENT), 123_456, "ann@operator", bytes(range(INSTANCE_BYTES)), "robot:47000", True, 400_000, 0
)


@pytest.mark.parametrize("overhead", [20, 48])
@pytest.mark.parametrize("size", [0, 10, 200, 235, 250, 490, 600])
def test_a_hello_survives_and_is_padded(overhead: int, size: int) -> None:
    hello = HELLO._replace(agreement=bytes(size))
    payload = pack_hello(hello, overhead)
    header = HelloHeader(2, identity_of(hello.name), 9).pack()
    assert len(header) + overhead + len(payload) >= PADDED_HELLO
    body = read_map(payload)
    assert body is not None
    assert read_hello(body) == hello


@given(st.integers(0, 255), st.binary(min_size=8, max_size=8), st.integers(0, LARGEST_STAMP))
def test_headers_survive(version: int, identity: bytes, stamp: int) -> None:
    header = HelloHeader(version, identity, stamp)
    assert header.pack()[:2] == bytes((Kind.HELLO, version))
    assert header.pack_answer()[:2] == bytes((Kind.WELCOME, version))
    assert read_hello_header(header.pack().ljust(PADDED_HELLO)) == header
    assert read_hello_header(header.pack().ljust(PADDED_HELLO - 1)) is None
    assert read_answered(header.pack_answer()) == stamp
    assert read_answered(header.pack_answer()[:-1]) is None


@pytest.mark.parametrize("name", ["", "a" * (LONGEST_NAME + 1), "a\x1b[2J", "a\n", "\u202e"])
def test_invalid_name_is_refused(name: str) -> None:
    with pytest.raises(ValueError, match="printable"):
        check_name(name)
    assert read_hello({**HELLO._asdict(), "name": name}) is None
    assert read_welcome({"clock_us": 0, "delta_us": 0, "name": name}) is None
    if name:
        assert read_hello({**HELLO._asdict(), "expects": name}) is None


@pytest.mark.parametrize(
    "packed",
    [
        b"", b"\xc1", b"\x90", b"\x93\x01\x02", b"\x81\x01\x02", b"\x81\xa1a", b"\x81\xa1\xff\x01", b"\x80\x80",
        b"\x91" * 3000, b"\x81\xa1a" * 3000, b"\x81\xc4\x01a\x01", b"\xdf\xff\xff\xff\xff", b"\xd6\xff\xff\xff\xff\xff",
    ],
)  # fmt: skip
def test_bytes_that_are_no_map_with_text_keys_are_none(packed: bytes) -> None:
    assert read_map(packed) is None


FALSE = [None, [1], {}, 2**63, 1.5, b"x" * 7, "x" * 65, -(2**60)]


@pytest.mark.parametrize("value", [*FALSE, True])
def test_a_body_with_a_false_field_is_none(value: object) -> None:
    welcome = Welcome(1, -2, "robot:47000", 400_000)
    assert read_welcome(welcome._asdict()) == welcome
    for field in Welcome._fields:
        assert read_welcome({**welcome._asdict(), field: value}) is None
    body = HELLO._asdict()
    for field in Hello._fields:
        assert read_hello({key: content for key, content in body.items() if key != field}) is None
        if (field, value) not in (("agreement", b"x" * 7), ("takes_over", True)):
            assert read_hello({**body, field: value}) is None


@given(st.text(max_size=2000), st.integers(40, 600))
def test_a_refusal_is_cut_to_its_room(message: str, room: int) -> None:
    payload = pack_refusal(message, room)
    assert len(payload) <= room
    body = read_map(payload)
    assert body is not None
    said = body["refusal"]
    assert isinstance(said, str)
    assert room - 2 <= len(pack_refusal("x" * 2000, room)) <= room
    whole = message.encode(errors="replace").decode()
    assert said == whole or whole.startswith(said.removesuffix("..."))


VALUES = st.one_of(st.integers(-1000, 1000), st.booleans(), st.text(max_size=5), st.none(), st.floats(-10, 10))
AGREEMENTS = st.dictionaries(st.sampled_from(["a", "b.c", "b.d", "rate_hz"]), VALUES)


@given(AGREEMENTS, AGREEMENTS)
def test_both_ends_say_the_same_about_a_difference(master: dict[str, object], slave: dict[str, object]) -> None:
    assert read_map(pack_agreement(master)) == master
    said = differences(Role.INITIATOR, master, slave)
    assert said == differences(Role.RESPONDER, slave, master)
    assert (said == "") == (master == slave)
    assert differences(Role.INITIATOR, master, master) == ""


def test_none_differs_from_a_missing_key() -> None:
    assert differences(Role.INITIATOR, {"a": None}, {}) == "a: master has None, slave has nothing"


@pytest.mark.parametrize("value", [object(), {1, 2}, 2**70])
def test_value_that_cannot_be_packed_is_named(value: object) -> None:
    with pytest.raises(ValueError, match=r"'codec\.x'"):
        pack_agreement({"codec.x": value})
