"""The emulated servos: when things happen on the wire, who answers, and what a reboot keeps."""

import pytest

from weberlink_arms.dynamixel.packet import ALERT, DATA_RANGE_ERROR, FRAMING
from weberlink_arms.emulators.open_manipulator import DynamixelEmulator, DynamixelEmulatorOptions
from weberlink_arms.servo.packet import REBOOT, Packet, Status

IDS = (11, 12, 13, 14, 15)


class Host:
    """Asks, and waits as long as asked to [s]."""

    def __init__(self, baud: int = 1_000_000) -> None:
        self.emulator, self.now = DynamixelEmulator(DynamixelEmulatorOptions(baud=baud)), 100.0
        self.reader = FRAMING.answers()
        self.wait(0.0)

    def wait(self, time: float) -> list[Status]:
        """Whatever is said meanwhile."""
        self.now += time
        self.emulator.advance(self.now)
        return self.reader.feed(b"".join(self.emulator.replies(self.now)))

    def ask(self, request: bytes, patience: float = 0.02) -> list[Status]:
        self.emulator.receive(request, self.now)
        return self.wait(patience)


@pytest.mark.parametrize("baud", [57_600, 1_000_000, 3_000_000])
@pytest.mark.parametrize("delay", [0, 250])
def test_answer_time_includes_packets_and_return_delay(baud: int, delay: int) -> None:
    host = Host(baud)
    host.emulator.servos[0].registers["return_delay_time"] = delay
    due = 14 * 10 / baud + 2e-6 * delay + 15 * 10 / baud
    assert host.ask(FRAMING.read(11, 132, 4), due - 1e-6) == []
    assert len(host.wait(2e-6)) == 1


def test_servos_behind_a_silent_one_are_silent() -> None:
    host = Host()

    def heard(*ids: int) -> list[int]:
        return [status.id for status in host.ask(FRAMING.sync_read(132, 4, ids))]

    host.emulator.inject("dead", 3)
    assert (heard(*IDS), heard(15, 14, 40, 11)) == ([11, 12], [15, 14])
    assert host.ask(FRAMING.ping(13)) == []
    host.emulator.inject("dead", 0)
    assert heard(*IDS) == list(IDS)


def test_a_reboot_takes_time_clears_alarms_and_keeps_the_eeprom() -> None:
    host = Host()
    mode, alarm = (FRAMING.read(12, address, 1) for address in (11, 70))
    host.ask(FRAMING.write(12, 11, b"\5"))
    host.emulator.inject("overload", 2)
    assert host.ask(alarm) == [Status(12, ALERT, b"\x20")]
    assert host.ask(FRAMING.encode(Packet(12, REBOOT))) == [Status(12, ALERT)]
    assert host.ask(FRAMING.ping(12)) == []
    host.wait(0.3)
    assert (*host.ask(alarm), *host.ask(mode)) == (Status(12, 0, b"\0"), Status(12, 0, b"\5"))


def test_a_tripped_watchdog_refuses_goals_until_it_is_switched_off() -> None:
    host, current = Host(), (102, b"\5\0")

    def written(*writes: tuple[int, bytes]) -> list[int]:
        return [host.ask(FRAMING.write(11, address, data))[0].error for address, data in writes]

    assert written((11, b"\0"), (64, b"\1"), (98, b"\3")) == [0, 0, 0]
    host.wait(0.1)
    assert written(current, (98, b"\5"), (98, b"\0"), current) == [DATA_RANGE_ERROR, DATA_RANGE_ERROR, 0, 0]
