"""The emulated board, without a port: what the firmware does with bytes, and what the linkage does with torques."""

from math import hypot

import pytest

from weberlink.geometry.vector import ZERO
from weberlink.hardware.emulator import Emulator
from weberlink.master.devices.haply.board import RESET
from weberlink.master.devices.haply.linkage import MOST_TORQUE_N_M, VERSIONS, radians
from weberlink.master.emulators.haply import PATIENCE_S, HaplyEmulator, HaplyEmulatorOptions

V3 = VERSIONS["v3"]
BOARD = V3.board
every_version = pytest.mark.parametrize("version", sorted(VERSIONS))


def emulator(version: str = "v3", **handle: object) -> HaplyEmulator:
    return HaplyEmulator(
        HaplyEmulatorOptions.model_validate({"version": version, "handle": {"tremor_m": 0.0, **handle}})
    )


def answers(device: Emulator, data: bytes, now: float = 0.0) -> bytes:
    device.advance(now)
    device.receive(data, now)
    return b"".join(device.replies(now + 0.01))


@every_version
def test_setup_takes_present_angles_as_offsets(version: str) -> None:
    board, device = VERSIONS[version].board, emulator(version)
    zero = board.torques(0.0, 0.0)
    assert answers(device, zero) == board.bare_reply
    assert answers(device, RESET + board.setup + zero)[:1] == board.bare_reply
    assert board.angles(answers(device, zero)) == pytest.approx(board.home_deg, abs=0.08)
    device.handle.carry(ZERO)
    for tick in range(1, 500):
        device.advance(tick * 0.001)
    middle = board.angles(answers(device, zero, 0.5))
    expected = VERSIONS[version].bar.angles(VERSIONS[version].center)
    assert radians(middle) == pytest.approx(expected, abs=0.003)
    assert board.angles(answers(device, board.setup + zero, 0.5)) == pytest.approx(board.home_deg, abs=0.08)


def test_message_in_pieces_is_joined_or_dropped() -> None:
    device = emulator()
    whole = BOARD.setup + BOARD.torques(0.1, 0.0)
    for number, byte in enumerate(whole):
        device.receive(bytes((byte,)), number * 0.01)
    assert device.torques == pytest.approx((0.1, 0.0))
    assert len(device.replies(10.0)) == 1
    device.receive(whole[-10:-2], 10.0)
    device.advance(10.0 + 1.1 * PATIENCE_S)
    assert len(answers(device, BOARD.torques(0.0, 0.0), 12.0)) == 9


def test_only_another_torque_takes_a_torque_away() -> None:
    device = emulator()
    answers(device, BOARD.setup + BOARD.torques(0.1, -0.05))
    for now in (1.0, 10.0, 1000.0):
        device.advance(now)
    answers(device, RESET + BOARD.setup, 1000.0)
    assert device.torques == pytest.approx((0.1, -0.05))
    answers(device, BOARD.torques(0.0, 0.0), 1000.0)
    assert device.torques == (0.0, 0.0)
    assert device.most_torque == pytest.approx(0.1)


def test_the_firmware_cuts_a_torque() -> None:
    device = emulator()
    answers(device, BOARD.setup + BOARD.torques(5.0, float("nan")))
    assert device.torques == (MOST_TORQUE_N_M, 0.0)


@pytest.mark.parametrize("flipped", ["motors", "encoders"])
def test_a_wrong_direction_turns_the_sign_round(flipped: str) -> None:
    device = emulator()
    setup = bytearray(BOARD.setup)
    at = 3 if flipped == "motors" else 6
    setup[at] = setup[at + 1] = 0
    answers(device, bytes(setup) + BOARD.torques(0.05, 0.02))
    sign = -1.0 if flipped == "motors" else 1.0
    assert device.torques == pytest.approx((sign * 0.05, sign * 0.02))
    device.handle.carry(ZERO)
    for tick in range(500):
        device.advance(tick * 0.001)
    first, _ = BOARD.angles(answers(device, BOARD.torques(0.0, 0.0), 0.5))
    assert (first > 168.0) == (flipped == "encoders"), "the true one goes down on the way to the middle"


@pytest.mark.parametrize("which", [1, 2])
def test_injected_stuck_encoder_keeps_its_angle(which: int) -> None:
    device, zero = emulator(), BOARD.torques(0.0, 0.0)
    answers(device, BOARD.setup)
    device.inject("stuck_encoder", which)
    device.handle.carry(ZERO)
    for tick in range(500):
        device.advance(tick * 0.001)
    angles = BOARD.angles(answers(device, zero, 0.5))
    assert angles[which - 1] == pytest.approx(BOARD.home_deg[which - 1], abs=0.08)
    assert abs(angles[2 - which] - BOARD.home_deg[2 - which]) > 10.0
    device.inject("stuck_encoder", 0)
    assert abs(BOARD.angles(answers(device, zero, 0.5))[which - 1] - BOARD.home_deg[which - 1]) > 10.0


def test_injected_slips_lose_a_byte_each() -> None:
    device, zero = emulator(), BOARD.torques(0.0, 0.0)
    answers(device, BOARD.setup)
    device.inject("slip", 2)
    assert [len(answers(device, zero, now)) for now in (0.5, 0.6, 0.7)] == [8, 8, 9]


@every_version
def test_the_script_stays_within_reach(version: str) -> None:
    """The tip is where the hand is, all the way."""
    kind, device = VERSIONS[version], emulator(version)
    answers(device, kind.board.setup)
    for tick in range(9000):
        device.advance(tick * 0.001)
        if tick % 50 == 0:
            x, y = kind.bar.tip(device._angles)
            at = device.handle.position
            assert hypot(y - kind.center[1] - at[0], kind.center[0] - x - at[1]) < 1e-6
