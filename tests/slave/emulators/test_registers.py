"""What instructions do to registers, against the manual."""

import pytest

from tests.slave.emulators.host import Host
from weberlink.arms.dynamixel import packet
from weberlink.arms.dynamixel.packet import (
    ACCESS_ERROR,
    ALERT,
    DATA_LENGTH_ERROR,
    DATA_LIMIT_ERROR,
    DATA_RANGE_ERROR,
    RESULT_FAIL,
    Packet,
    StatusPacket,
)
from weberlink.slave.emulators.dynamixel import DynamixelEmulator, DynamixelEmulatorOptions


@pytest.fixture
def host() -> Host:
    return Host(DynamixelEmulator(DynamixelEmulatorOptions()))


@pytest.mark.parametrize(
    ("address", "size", "value", "error"),
    [
        (126, 2, 5, ACCESS_ERROR),  # read-only
        (14, 1, 5, ACCESS_ERROR),  # not defined
        (3000, 1, 5, ACCESS_ERROR),
        (102, 1, 5, DATA_LENGTH_ERROR),
        (103, 1, 5, DATA_LENGTH_ERROR),
        (9, 1, 255, DATA_RANGE_ERROR),
        (11, 1, 7, DATA_RANGE_ERROR),
        (98, 1, -5, DATA_RANGE_ERROR),
        (98, 1, -1, DATA_RANGE_ERROR),
        (102, 2, 1194, DATA_LIMIT_ERROR),
        (102, 2, -1194, DATA_LIMIT_ERROR),
        (116, 4, 4096, DATA_LIMIT_ERROR),
        (116, 4, -1, DATA_LIMIT_ERROR),
    ],
)
def test_what_a_servo_refuses(host: Host, address: int, size: int, value: int, error: int) -> None:
    before = host.emulator.servos[0].registers.memory[:120]
    assert host.write(11, address, size, value) == error
    assert host.emulator.servos[0].registers.memory[:120] == before
    assert host.emulator.bus.errors == 1


def test_alarm_disables_torque_until_reboot(host: Host) -> None:
    host.current_control(11, 12)
    host.emulator.inject("overload", 2)
    host.wait(0.001)
    assert host.ask(packet.ping(12))[0].error == ALERT
    assert host.ask(packet.read(12, 70, 1)) == [StatusPacket(12, ALERT, b"\x20")]
    assert host.ask(packet.read(12, 64, 1)) == [StatusPacket(12, ALERT, b"\x00")]
    assert host.write(12, 64, 1, 1) == ALERT | RESULT_FAIL
    assert host.read(11, 64, 1) == 1
    assert host.ask(Packet(12, packet.REBOOT)) == [StatusPacket(12, ALERT)]
    assert host.ask(packet.ping(12)) == []
    host.wait(0.3)
    assert host.read(12, 70, 1) == 0
    assert host.read(12, 11, 1) == 0  # EEPROM is kept
    assert host.write(12, 64, 1, 1) == 0


def test_a_watchdog_trips_after_silence_and_refuses_goals(host: Host) -> None:
    host.current_control(11)
    assert host.write(11, 102, 2, 50) == 0
    assert host.write(11, 98, 1, 3) == 0  # 60 ms
    host.wait(0.030)
    assert host.emulator.currents[0] == pytest.approx(50 * 2.69e-3)
    host.wait(0.011)  # the 20 ms of waiting for the answer count
    assert host.emulator.watchdog_trips == 1
    assert host.emulator.currents[0] == 0.0
    assert int.from_bytes(host.ask(packet.read(11, 98, 1))[0].parameters, "little", signed=True) == -1
    for address, size in ((100, 2), (102, 2), (104, 4), (116, 4)):
        assert host.write(11, address, size, 5) == DATA_RANGE_ERROR
    assert host.write(11, 98, 1, 5) == DATA_RANGE_ERROR
    assert host.write(11, 98, 1, 0) == 0
    assert host.write(11, 102, 2, 5) == 0
