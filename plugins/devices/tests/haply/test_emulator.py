"""The emulated board, without a port: what the firmware does with bytes, and what the linkage does with torques."""

from math import hypot

import pytest

from weberlink.geometry.vector import ZERO
from weberlink_devices.haply.board import RESET
from weberlink_devices.haply.emulator import HaplyEmulator, HaplyEmulatorOptions
from weberlink_devices.haply.linkage import MOST_TORQUE_N_M, VERSIONS, radians

BOARD = VERSIONS["v3"].board
every_version = pytest.mark.parametrize("version", sorted(VERSIONS))


def emulator(version: str = "v3") -> HaplyEmulator:
    options = {"version": version, "handle": {"tremor_m": 0.0}}
    return HaplyEmulator(HaplyEmulatorOptions.model_validate(options))


def answers(device: HaplyEmulator, data: bytes, now: float = 0.0) -> bytes:
    device.advance(now)
    device.receive(data, now)
    return b"".join(device.replies(now + 0.01))


def carried_to_the_middle(device: HaplyEmulator) -> None:
    device.handle.carry(ZERO)
    for tick in range(500):
        device.advance(tick * 0.001)


@every_version
def test_setup_takes_present_angles_as_offsets_and_the_tip_is_the_hand(version: str) -> None:
    kind, device = VERSIONS[version], emulator(version)
    board, zero = kind.board, kind.board.torques(0.0, 0.0)
    assert answers(device, zero) == board.bare_reply
    assert answers(device, RESET + board.setup + zero)[:1] == board.bare_reply
    assert board.angles(answers(device, zero)) == pytest.approx(board.home_deg, abs=0.08)
    carried_to_the_middle(device)
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
    answers(device, BOARD.setup + BOARD.torques(5.0, -0.05))
    for now in (1.0, 10.0, 1000.0):
        device.advance(now)
    answers(device, RESET + BOARD.setup, 1000.0)
    assert device.torques == pytest.approx((MOST_TORQUE_N_M, -0.05))
    answers(device, BOARD.torques(0.0, float("nan")), 1000.0)
    assert device.torques == (0.0, 0.0)
    assert device.most_torque == pytest.approx(MOST_TORQUE_N_M)
