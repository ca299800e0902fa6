"""The messages of the board, byte by byte and under whatever bytes come."""

from dataclasses import replace
from math import isfinite, log2
from struct import pack, unpack

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.examples import examples
from weberlink.hardware.fault import BadReply
from weberlink.master.devices.haply.board import REPLY_SIZE, RESET, BoardEncoder, BoardMotor, HaplyBoard
from weberlink.master.devices.haply.linkage import VERSIONS

V2, V3 = VERSIONS["v2"].board, VERSIONS["v3"].board
ANY = replace(V3, whole_counts=False)
degrees = st.floats(-720.0, 720.0, width=32)


def test_setup_has_firmware_order() -> None:
    """Ports 1 and 2 are bits 1 and 2; on this device the first of everything hangs on port 2."""
    expected = bytes((1, V2.id, 3, 0, 1, 3, 0, 1, 0, 0)) + pack("<4f", -61.0, 10752.0, 241.0, 10752.0)
    assert V2.setup == expected
    assert V3.setup == bytes((1, V3.id, 3, 1, 1, 3, 1, 1, 0, 0)) + pack("<4f", 12.0, 4880.0, 168.0, 4880.0)
    assert RESET == b"\0\0"


def test_directions_and_angles_go_with_their_port() -> None:
    board = HaplyBoard(
        (BoardMotor(1, 0), BoardMotor(3, 1)),
        (BoardEncoder(4, 1, 100.0), BoardEncoder(2, 0, 200.0)),
        (10.0, 20.0),
        False,
    )
    assert board.setup[2:10] == bytes((0b0101, 0, 1, 0b1010, 0, 1, 0, 0))
    assert board.setup[10:] == pack("<4f", 20.0, 200.0, 10.0, 100.0)
    assert board.torques(0.5, 0.25) == bytes((2, board.id)) + pack("<2f", 0.5, 0.25)
    assert board.angles(bytes((board.id,)) + pack("<2f", 1.0, 2.0)) == (2.0, 1.0)


def test_every_setup_has_its_own_id() -> None:
    boards = [version.board for version in VERSIONS.values()]
    boards += [HaplyBoard(V3.motors, V3.encoders, (168.0, 12.0 + i)) for i in range(1, 5)]
    assert len({board.id for board in boards}) == len(boards)
    assert all(16 <= board.id < 128 for board in boards)
    assert HaplyBoard(V3.motors, V3.encoders, V3.home_deg).id == V3.id


@examples(40)
@given(first=degrees, second=degrees)
def test_a_good_reply_gives_its_angles(first: float, second: float) -> None:
    assert ANY.angles(bytes((V3.id,)) + pack("<2f", first, second)) == (second, first)


@examples(100)
@given(
    reply=st.one_of(st.binary(max_size=24), st.binary(min_size=8, max_size=8).map(lambda rest: V3.bare_reply + rest))
)
def test_any_reply_is_angles_or_bad_reply(reply: bytes) -> None:
    try:
        angles = ANY.angles(reply)
    except BadReply as bad:
        assert "\n" not in str(bad)
        return
    assert len(reply) == REPLY_SIZE
    assert reply[0] == V3.id
    assert all(map(isfinite, angles))


counts = st.integers(-20_000, 20_000)


@pytest.mark.parametrize("per_turn", [4880.0, 10752.0, 13824.0, 2048 * 2.5 * 1.0194 * 1.0154])
@examples(40)
@given(first=counts, second=counts)
def test_every_count_is_an_answer(per_turn: float, first: int, second: int) -> None:
    """However the board rounds: its numbers are of 32 bits."""
    encoders = (BoardEncoder(1, 0, per_turn), BoardEncoder(2, 0, per_turn))
    (told,) = unpack("<f", pack("<f", per_turn))
    reply = pack("<2f", 360.0 * first / told, 360.0 * second / told)
    board = HaplyBoard(V3.motors, encoders, V3.home_deg)
    angles = board.angles(board.bare_reply + reply)
    assert [round(angle * per_turn / 360.0) for angle in angles] == [first, second]


@examples(100)
@given(first=counts, second=counts, flipped=st.integers(1, 255))
def test_what_is_torn_in_the_middle_is_seen(first: int, second: int, flipped: int) -> None:
    """Where it is the exponent that is torn, unless a count times a power of two comes out, or minus one."""
    reply = bytearray(V3.bare_reply + pack("<2f", 360.0 * first / 4880.0, 360.0 * second / 4880.0))
    reply[4] ^= flipped
    try:
        angles = V3.angles(bytes(reply))
    except BadReply:
        return
    torn = angles[1] * 4880.0 / 360.0
    assert torn == pytest.approx(round(torn), rel=1e-5)
    assert first == 0 or torn != 0.0
    assert first == 0 or log2(abs(torn / first)) == pytest.approx(round(log2(abs(torn / first))), abs=1e-4)


@pytest.mark.parametrize(
    ("reply", "complaint"),
    [
        (b"", "0 bytes of 9"),
        (V3.bare_reply, "1 bytes of 9"),
        (bytes((V3.id + 1,)) + bytes(8), f"device {V3.id + 1} instead of {V3.id}"),
        (bytes((V3.id,)) + pack("<2f", float("nan"), 1.0), "nan"),
        (bytes((V3.id,)) + pack("<2f", 360.0 / 4880.0, float("-inf")), "-inf"),
        (bytes((V3.id,)) + pack("<2f", 3600.0 / 4880.0, 1.0), "1 deg, which is between two counts"),
        (bytes((V3.id,)) + pack("<2f", 1e-30, 0.0), "1e-30 deg, which is between two counts"),
    ],
)
def test_each_complaint_says_what_was_wrong(reply: bytes, complaint: str) -> None:
    with pytest.raises(BadReply, match=complaint):
        V3.angles(reply)
