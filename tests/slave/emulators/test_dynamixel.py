"""The emulated arm as a whole: its motors move it, its faults are those of its name, and the same bytes do the same."""

from hypothesis import given
from hypothesis import strategies as st

from tests.examples import examples
from tests.slave.emulators.host import IDS, Host
from weberlink.arms.dynamixel import packet
from weberlink.arms.dynamixel.packet import encode_packet
from weberlink.slave.emulators.dynamixel import DynamixelEmulator, DynamixelEmulatorOptions


def arm(**options: object) -> Host:
    return Host(DynamixelEmulator(DynamixelEmulatorOptions.model_validate(options)))


def test_a_restart_keeps_the_eeprom_alone() -> None:
    host = arm()
    host.current_control(*IDS)
    assert host.write(13, 9, 1, 10) == packet.ACCESS_ERROR
    host.emulator.inject("dead", 4)
    host.emulator.inject("restart", 0)
    assert host.ask(packet.ping(11)) == []
    host.wait(0.3)
    assert not any(servo.torque_on for servo in host.emulator.servos)
    assert host.ask(packet.ping(14))[0].error == 0
    assert host.read(11, 11, 1) == 0  # EEPROM
    assert host.read(11, 102, 2) == 0


def exercised(calls: list[float]) -> tuple[list[bytes], tuple[float, ...]]:
    """The same instructions at the same times, with calls of `advance` at other times in between."""
    emulator = DynamixelEmulator(DynamixelEmulatorOptions(seed=5))
    said = []
    setup = [packet.write(id_, 11, b"\x00") for id_ in IDS] + [packet.write(id_, 64, b"\x01") for id_ in IDS]
    cycle = [packet.sync_write(102, 2, [(12, b"\xf0\xff"), (13, b"\x0a\x00")]), packet.sync_read(126, 10, IDS)]
    script = [(1.0, setup)] + [(1.1 + 0.01 * k, cycle) for k in range(15)]
    times = sorted([(at, None) for at in calls] + [(at, packets) for at, packets in script], key=lambda each: each[0])
    for at, packets in times:
        if packets is None:
            emulator.advance(at)
        else:
            emulator.receive(b"".join(map(encode_packet, packets)), at)
        said += emulator.replies(at)
    emulator.advance(1.4)
    return said + emulator.replies(1.4), emulator.arm.angles + emulator.arm.velocities + emulator.tip_force


@examples(6)
@given(st.lists(st.floats(0.9, 1.4), max_size=30))
def test_result_depends_on_bytes_and_times_only(calls: list[float]) -> None:
    said, state = exercised(calls)
    assert len(said) == 10 + 15 * 5
    assert (said, state) == exercised([])
