"""The emulated servos: when things happen on the wire, who answers, and what instructions do to registers."""

import pytest

from weberlink_arms.dynamixel.packet import ALERT, DATA_RANGE_ERROR, FRAMING, RESULT_FAIL
from weberlink_arms.emulators.open_manipulator import DynamixelEmulator, DynamixelEmulatorOptions
from weberlink_arms.servo.packet import REBOOT, Packet, Status

IDS = (11, 12, 13, 14, 15)
READ_POSITION = FRAMING.read(11, 132, 4)  # 14 bytes, answered with 15


class Host:
    """Asks, and waits as long as asked to [s]."""

    def __init__(self, emulator: DynamixelEmulator, now: float = 100.0) -> None:
        self.emulator = emulator
        self.now = now
        self.reader = FRAMING.answers()
        emulator.advance(now)

    def wait(self, time: float) -> list[Status]:
        """Whatever is said meanwhile."""
        self.now += time
        self.emulator.advance(self.now)
        return self.reader.feed(b"".join(self.emulator.replies(self.now)))

    def ask(self, *requests: bytes, patience: float = 0.02) -> list[Status]:
        self.emulator.receive(b"".join(requests), self.now)
        return self.wait(patience)

    def read(self, id_: int, address: int, size: int) -> int:
        (status,) = self.ask(FRAMING.read(id_, address, size))
        assert status.error == 0, status
        return int.from_bytes(status.parameters, "little", signed=size > 1)

    def write(self, id_: int, address: int, size: int, value: int) -> int:
        """The error byte of the answer."""
        (status,) = self.ask(FRAMING.write(id_, address, value.to_bytes(size, "little", signed=value < 0)))
        assert status.id == id_
        return status.error

    def current_control(self, *ids: int) -> None:
        """Torque on in current mode, at zero."""
        for id_ in ids:
            assert self.write(id_, 11, 1, 0) == 0
            assert self.write(id_, 102, 2, 0) == 0
        self.ask(FRAMING.sync_write(64, 1, [(id_, b"\x01") for id_ in ids]))


@pytest.fixture
def host() -> Host:
    return Host(DynamixelEmulator(DynamixelEmulatorOptions()))


@pytest.mark.parametrize("baud", [57_600, 1_000_000, 3_000_000])
@pytest.mark.parametrize("delay", [0, 250])
def test_answer_time_includes_packets_and_return_delay(baud: int, delay: int) -> None:
    host = Host(DynamixelEmulator(DynamixelEmulatorOptions(baud=baud)))
    host.emulator.servos[0].registers["return_delay_time"] = delay
    due = 14 * 10 / baud + 2e-6 * delay + 15 * 10 / baud
    assert host.ask(READ_POSITION, patience=due - 1e-6) == []
    assert len(host.wait(2e-6)) == 1


def test_servos_behind_a_silent_one_are_silent(host: Host) -> None:
    host.emulator.inject("dead", 3)
    assert [status.id for status in host.ask(FRAMING.sync_read(132, 4, IDS))] == [11, 12]
    assert [status.id for status in host.ask(FRAMING.sync_read(132, 4, (15, 14, 40, 11)))] == [15, 14]
    assert host.ask(FRAMING.ping(13)) == []
    host.emulator.inject("dead", 0)
    assert [status.id for status in host.ask(FRAMING.sync_read(132, 4, IDS))] == list(IDS)


def test_alarm_disables_torque_until_reboot(host: Host) -> None:
    host.current_control(11, 12)
    host.emulator.inject("overload", 2)
    host.wait(0.001)
    assert host.ask(FRAMING.ping(12))[0].error == ALERT
    assert host.ask(FRAMING.read(12, 70, 1)) == [Status(12, ALERT, b"\x20")]
    assert host.ask(FRAMING.read(12, 64, 1)) == [Status(12, ALERT, b"\x00")]
    assert host.write(12, 64, 1, 1) == ALERT | RESULT_FAIL
    assert host.read(11, 64, 1) == 1
    assert host.ask(FRAMING.encode(Packet(12, REBOOT))) == [Status(12, ALERT)]
    assert host.ask(FRAMING.ping(12)) == []
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
    assert int.from_bytes(host.ask(FRAMING.read(11, 98, 1))[0].parameters, "little", signed=True) == -1
    for address, size in ((100, 2), (102, 2), (104, 4), (116, 4)):
        assert host.write(11, address, size, 5) == DATA_RANGE_ERROR
    assert host.write(11, 98, 1, 5) == DATA_RANGE_ERROR
    assert host.write(11, 98, 1, 0) == 0
    assert host.write(11, 102, 2, 5) == 0
