"""The board: its messages byte by byte, what the firmware does with them, and what the linkage does with torques."""

from math import hypot
from struct import pack, unpack
from typing import Any

import pytest
from hypothesis import given, strategies as st

from weberlink.geometry.vector import ZERO
from weberlink_devices.haply.board import RESET, BoardEncoder, BoardMotor, HaplyBoard
from weberlink_devices.haply.emulator import HaplyEmulator, HaplyEmulatorOptions
from weberlink_devices.haply.linkage import MOST_TORQUE_N_M, VERSIONS, radians

V2, V3 = VERSIONS["v2"].board, VERSIONS["v3"].board
counts = st.integers(-20_000, 20_000)


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
    assert (V2.id, V3.id) == (20, 110), "by which a board knows its setup from one version of this program to the next"
    assert all(16 <= board.id < 128 for board in boards)
    assert HaplyBoard(V3.motors, V3.encoders, V3.home_deg).id == V3.id


@pytest.mark.parametrize("per_turn", [4880.0, 10752.0, 13824.0, 2048 * 2.5 * 1.0194 * 1.0154])
@given(first=counts, second=counts)
def test_every_count_is_an_answer(per_turn: float, first: int, second: int) -> None:
    """However the board rounds: its numbers are of 32 bits."""
    encoders = (BoardEncoder(1, 0, per_turn), BoardEncoder(2, 0, per_turn))
    (told,) = unpack("<f", pack("<f", per_turn))
    reply = pack("<2f", 360.0 * first / told, 360.0 * second / told)
    board = HaplyBoard(V3.motors, encoders, V3.home_deg)
    angles = board.angles(board.bare_reply + reply)
    assert [round(angle * per_turn / 360.0) for angle in angles] == [first, second]


@pytest.mark.parametrize("sent", range(10))
def test_torques_off_works_behind_a_partial_message(sent: int) -> None:
    """And the board still knows the device: a plain zero would be swallowed, and its rest be taken for resets."""
    device = emulator(script=[{"motion": "rest"}], home_m=ZERO)
    device.advance(0.0)
    device.receive(V3.setup + V3.torques(0.1, -0.1), 0.0)
    assert max(map(abs, device.torques)) > 0.05
    device.receive(V3.torques(-0.1, 0.05)[:sent], 1.0)
    device.receive(V3.torques_off, 1.001)
    assert device.torques == pytest.approx((0.0, 0.0), abs=1e-30)
    device.replies(2.0)
    device.receive(V3.torques(0.0, 0.0), 2.0)
    assert V3.angles(device.replies(3.0)[-1])


# --- the emulated board

every_version = pytest.mark.parametrize("version", sorted(VERSIONS))


def emulator(version: str = "v3", **handle: Any) -> HaplyEmulator:
    options = {"version": version, "handle": {"tremor_m": 0.0, **handle}}
    return HaplyEmulator(HaplyEmulatorOptions.model_validate(options))


def answers(device: HaplyEmulator, data: bytes, now: float = 0.0) -> bytes:
    device.advance(now)
    device.receive(data, now)
    return b"".join(device.replies(now + 0.01))


@every_version
def test_setup_takes_present_angles_as_offsets_and_the_tip_is_the_hand(version: str) -> None:
    kind, device = VERSIONS[version], emulator(version)
    board, zero = kind.board, kind.board.torques(0.0, 0.0)
    assert answers(device, zero) == board.bare_reply
    assert answers(device, RESET + board.setup + zero)[:1] == board.bare_reply
    assert board.angles(answers(device, zero)) == pytest.approx(board.home_deg, abs=0.08)
    device.handle.carry(ZERO)
    for tick in range(500):
        device.advance(tick * 0.001)
    middle = board.angles(answers(device, zero, 0.5))
    assert radians(middle) == pytest.approx(kind.bar.angles(kind.center), abs=0.003)
    device.handle.carry(None)
    for tick in range(500, 9000):
        device.advance(tick * 0.001)
        if tick % 50 == 0:
            x, y = kind.bar.tip(device._angles)
            at = device.handle.position
            assert hypot(y - kind.center[1] - at[0], kind.center[0] - x - at[1]) < 1e-6


def test_only_another_torque_takes_a_torque_away_and_the_firmware_cuts_it() -> None:
    device = emulator()
    answers(device, V3.setup + V3.torques(5.0, -0.05))
    for now in (1.0, 10.0, 1000.0):
        device.advance(now)
    answers(device, RESET + V3.setup, 1000.0)
    assert device.torques == pytest.approx((MOST_TORQUE_N_M, -0.05))
    answers(device, V3.torques(0.0, float("nan")), 1000.0)
    assert device.torques == (0.0, 0.0)
    assert device.most_torque == pytest.approx(MOST_TORQUE_N_M)
