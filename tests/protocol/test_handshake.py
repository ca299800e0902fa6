import msgpack
import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocol.checksum import Checksum
from protocol.handshake import (
    NONCE_BYTES,
    PADDED_HELLO,
    Hello,
    Welcome,
    differences,
    open_frame,
    pack_agreement,
    pack_frame,
    pack_hello,
    pack_refusal,
    read_hello,
    read_map,
    read_welcome,
    transcript,
    version_mismatch,
)
from protocol.roles import Role
from protocol.security import Security
from protocol.wire import Kind
from tests.protocol.harness import AGREEMENT, suites

NONCE = bytes(range(NONCE_BYTES))


def hello(security: Security) -> Hello:
    return Hello(pack_agreement(AGREEMENT), NONCE, bytes(security.public_size), 123_456)


@pytest.mark.parametrize("security", suites())
def test_a_hello_survives_its_frame(security: Security) -> None:
    data = pack_hello(hello(security), 1, security)
    assert data[:2] == bytes((Kind.HELLO, 1))
    assert len(data) >= PADDED_HELLO
    frame = open_frame(data, security)
    assert frame is not None
    version, packed = frame
    body = read_map(packed)
    assert version == 1
    assert body is not None
    assert read_hello(body, security) == hello(security)
    assert read_map(hello(security).agreement) == AGREEMENT


@pytest.mark.parametrize("security", suites())
def test_every_flipped_bit_of_a_frame_is_found(security: Security) -> None:
    data = pack_hello(hello(security), 1, security)
    for bit in range(0, 8 * len(data), 7):
        damaged = bytearray(data)
        damaged[bit // 8] ^= 1 << bit % 8
        assert open_frame(bytes(damaged), security) is None


@pytest.mark.parametrize("security", suites())
def test_a_frame_proves_what_it_is_bound_to(security: Security) -> None:
    data = pack_frame(Kind.WELCOME, 1, {}, security, NONCE)
    assert open_frame(data, security, NONCE) == (1, b"\x80")
    assert open_frame(data, security, bytes(NONCE_BYTES)) is None
    assert open_frame(data, security) is None


@given(st.binary(max_size=200))
def test_any_bytes_are_a_map_or_none(packed: bytes) -> None:
    body = read_map(packed)
    assert body is None or all(isinstance(key, str) for key in body)


@pytest.mark.parametrize(
    "packed",
    [
        b"",
        b"\xc1",
        b"\x90",
        b"\x93\x01\x02",
        b"\x81\x01\x02",
        b"\x81\xa1a",
        b"\x81\xa1\xff\x01",
        b"\x80\x80",
        b"\x91" * 3000,
        b"\x81\xa1a" * 3000,
        b"\x81\xc4\x01a\x01",
        b"\xdf\xff\xff\xff\xff",
        b"\xd6\xff\xff\xff\xff\xff",
    ],
)
def test_what_is_no_map_of_texts_is_none(packed: bytes) -> None:
    assert read_map(packed) is None


@pytest.mark.parametrize("security", suites())
@pytest.mark.parametrize("field", ["agreement", "nonce", "key", "clock_us"])
@pytest.mark.parametrize("value", [None, "text", b"x" * 15, [1], {}, True, 2**63, 1.5])
def test_a_hello_with_a_false_field_is_none(security: Security, field: str, value: object) -> None:
    body = {**hello(security)._asdict(), field: value}
    if field == "agreement" and isinstance(value, bytes):
        return
    assert read_hello(body, security) is None
    assert read_hello({key: content for key, content in body.items() if key != field}, security) is None


@pytest.mark.parametrize("security", suites())
@pytest.mark.parametrize("field", ["nonce", "key", "clock_us", "delta_us"])
@pytest.mark.parametrize("value", [None, "text", b"x" * 15, [1], {}, True, 2**63, 1.5])
def test_a_welcome_with_a_false_field_is_none(security: Security, field: str, value: object) -> None:
    good = Welcome(NONCE, bytes(security.public_size), 1, -2)
    assert read_welcome(good._asdict(), security) == good
    assert read_welcome({**good._asdict(), field: value}, security) is None


@given(st.text(max_size=2000), st.integers(40, 600))
def test_a_refusal_is_cut_to_its_limit(message: str, limit: int) -> None:
    for security in suites():
        data = pack_refusal(message, NONCE, 1, security, limit)
        assert len(data) <= limit
        frame = open_frame(data, security, NONCE)
        assert frame is not None
        body = read_map(frame[1])
        assert body is not None
        said = body["refusal"]
        assert isinstance(said, str)
        whole = message.encode(errors="replace").decode()
        assert said == whole or whole.startswith(said.removesuffix("..."))


def test_the_transcript_depends_on_everything() -> None:
    base = hello(Checksum())._replace(key=b"k")
    seen = {
        transcript(1, base, NONCE, b"K"),
        transcript(2, base, NONCE, b"K"),
        transcript(1, base._replace(agreement=b"other"), NONCE, b"K"),
        transcript(1, base._replace(nonce=bytes(16)), NONCE, b"K"),
        transcript(1, base._replace(key=b"j"), NONCE, b"K"),
        transcript(1, base, bytes(16), b"K"),
        transcript(1, base, NONCE, b"J"),
    }
    assert len(seen) == 7
    assert transcript(1, base._replace(clock_us=9), NONCE, b"K") in seen, "a repeated HELLO opens the same session"


VALUES = st.one_of(st.integers(-1000, 1000), st.booleans(), st.text(max_size=5), st.none(), st.floats(-10, 10))
AGREEMENTS = st.dictionaries(st.sampled_from(["a", "b.c", "b.d", "rate_hz"]), VALUES)


@given(AGREEMENTS, AGREEMENTS)
def test_both_ends_say_the_same_about_a_difference(master: dict[str, object], slave: dict[str, object]) -> None:
    said = differences(Role.INITIATOR, master, slave)
    assert said == differences(Role.RESPONDER, slave, master)
    assert (said == "") == (master == slave)
    assert differences(Role.INITIATOR, master, master) == ""


@given(AGREEMENTS)
def test_an_agreement_is_the_same_after_travel(agreement: dict[str, object]) -> None:
    assert read_map(pack_agreement(agreement)) == agreement


def test_a_bank_of_predictors_given_as_tuple_or_list_is_the_same() -> None:
    ours, theirs = (
        read_map(pack_agreement({"bank": ("zoh", "plane")})),
        read_map(pack_agreement({"bank": ["zoh", "plane"]})),
    )
    assert ours is not None
    assert theirs is not None
    assert differences(Role.INITIATOR, ours, theirs) == ""


def test_a_null_is_not_nothing() -> None:
    assert differences(Role.INITIATOR, {"a": None}, {}) == "a: master has None, slave has nothing"


def test_versions_are_named() -> None:
    assert version_mismatch(1, 2) == "protocol version: master has 1, slave has 2"


@pytest.mark.parametrize("value", [object(), {1, 2}, 2**70])
def test_what_cannot_travel_is_named(value: object) -> None:
    with pytest.raises(ValueError, match=r"'codec\.x'"):
        pack_agreement({"codec.x": value})


def test_msgpack_is_what_travels() -> None:
    data = pack_frame(Kind.WELCOME, 1, {"refusal": "no"}, Checksum())
    assert msgpack.unpackb(data[2:-4]) == {"refusal": "no"}
