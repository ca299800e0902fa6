"""What instructions do to registers, against the manual."""

from math import pi

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
from weberlink.arms.emulators.dynamixel.servo import OFF, Measured, Servo
from weberlink.slave.emulators.dynamixel import DynamixelEmulator, DynamixelEmulatorOptions

TURN = 2.0 * pi


@pytest.fixture
def host() -> Host:
    return Host(DynamixelEmulator(DynamixelEmulatorOptions()))


def test_ping_gives_model_and_firmware(host: Host) -> None:
    assert host.ask(packet.ping(12)) == [StatusPacket(12, 0, b"\xfc\x03\x2d")]
    assert host.ask(packet.ping(42)) == []


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


def test_goals_obey_the_present_limits(host: Host) -> None:
    assert host.write(11, 38, 2, 100) == 0
    assert host.write(11, 102, 2, 100) == 0
    assert host.write(11, 102, 2, 101) == DATA_LIMIT_ERROR
    assert host.write(11, 11, 1, 4) == 0
    assert host.write(11, 116, 4, -1) == 0  # several turns


def test_eeprom_is_locked_while_the_torque_is_on(host: Host) -> None:
    assert host.write(11, 64, 1, 1) == 0
    assert host.write(11, 9, 1, 0) == ACCESS_ERROR
    assert host.write(11, 64, 1, 0) == 0
    assert host.write(11, 9, 1, 0) == 0


def test_a_new_mode_resets_gains_and_goals(host: Host) -> None:
    assert host.write(11, 84, 2, 100) == 0
    assert host.write(11, 112, 4, 30) == 0
    assert host.write(11, 11, 1, 5) == 0
    assert (host.read(11, 84, 2), host.read(11, 112, 4), host.read(11, 102, 2)) == (800, 0, 1193)


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


class TestBusWatchdog:
    def test_trips_after_silence_and_refuses_goals(self, host: Host) -> None:
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

    def test_any_addressed_instruction_feeds_the_watchdog(self, host: Host) -> None:
        host.current_control(11, 12)
        for id_ in (11, 12):
            assert host.write(id_, 98, 1, 3) == 0
        for _ in range(5):
            host.ask(packet.ping(11), patience=0.03)
        assert (host.emulator.servos[0].watchdog_trips, host.emulator.servos[1].watchdog_trips) == (0, 1)
        for _ in range(5):
            host.ask(packet.sync_read(126, 10, (11,)), patience=0.03)
        assert host.emulator.watchdog_trips == 1

    def test_late_instruction_does_not_feed_the_watchdog(self, host: Host) -> None:
        host.current_control(11)
        assert host.write(11, 98, 1, 3) == 0
        host.wait(host.emulator.servos[0].heard_at + 0.06 - host.now - 50e-6)
        assert len(host.ask(packet.ping(11))) == 1  # takes 100 us on the wire
        assert host.emulator.watchdog_trips == 1


def test_drive_mode_and_offset_turn_what_is_measured() -> None:
    host = Host(DynamixelEmulator(DynamixelEmulatorOptions(start_rad=(0.5, 0.0, 0.0, 0.0))))
    counts = round(0.5 * 4096 / 6.283185307)
    assert host.read(11, 132, 4) == 2048 + counts
    assert host.write(11, 20, 4, 100) == 0
    assert host.read(11, 132, 4) == 2148 + counts
    assert host.write(11, 10, 1, 1) == 0
    assert host.read(11, 132, 4) == 2148 - counts
    assert host.write(11, 20, 4, 2000) == 0  # no effect in position control
    assert host.read(11, 132, 4) == 2048 - counts


class Shaft:
    """Sensor values of a servo alone."""

    def __init__(self, angle: float) -> None:
        self.angle = angle

    def __call__(self) -> Measured:
        return Measured(self.angle, 0.0, 0.0)


def position(servo: Servo) -> int:
    error, data = servo.read(132, 4)
    assert error == 0
    return int.from_bytes(data, "little", signed=True)


def test_the_position_counts_over_turns_until_it_is_reset() -> None:
    shaft = Shaft(0.5 * TURN + 0.1)
    servo = Servo(1, shaft)
    assert position(servo) == 65  # within a turn after power on
    shaft.angle += TURN
    assert position(servo) == 65 + 4096
    assert servo.write(64, b"\x01") == 0  # position control
    assert position(servo) == 65
    assert servo.write(64, b"\x00") == 0
    assert servo.write(11, b"\x00") == 0
    shaft.angle -= 2.0 * TURN
    assert servo.write(64, b"\x01") == 0  # current control keeps counting
    assert position(servo) == 65 - 2 * 4096
    servo.reboot(0.0)
    assert position(servo) == 65
    assert servo.drive is OFF
