"""When things happen on the wire, and who says what to whom."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.examples import examples
from tests.slave.emulators.host import IDS, Host
from weberlink.arms.dynamixel import packet
from weberlink.arms.dynamixel.packet import (
    BROADCAST,
    Packet,
    StatusPacketReader,
    encode_packet,
)
from weberlink.slave.emulators.dynamixel import DynamixelEmulator, DynamixelEmulatorOptions

READ_POSITION = packet.read(11, 132, 4)  # 14 bytes, answered with 15


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
    assert [status.id for status in host.ask(packet.sync_read(132, 4, IDS))] == [11, 12]
    assert [status.id for status in host.ask(packet.sync_read(132, 4, (15, 14, 40, 11)))] == [15, 14]
    assert host.ask(packet.ping(13)) == []
    host.emulator.inject("dead", 0)
    assert [status.id for status in host.ask(packet.sync_read(132, 4, IDS))] == list(IDS)


def test_a_wrong_checksum_is_not_answered(host: Host) -> None:
    data = bytearray(encode_packet(READ_POSITION))
    data[-1] ^= 1
    host.emulator.receive(bytes(data), host.now)
    assert host.wait(0.02) == []
    assert host.emulator.bus.bad_checksums == 1
    assert len(host.ask(READ_POSITION)) == 1


@examples(60)
@given(
    st.lists(
        st.one_of(
            st.binary(max_size=60),
            st.builds(
                lambda id_, instruction, body: encode_packet(Packet(id_, instruction, body)),
                st.sampled_from((*IDS, 7, BROADCAST)),
                st.sampled_from((1, 2, 3, 4, 5, 6, 8, 0x10, 0x55, 0x82, 0x83, 0x8A, 0x92)),
                st.one_of(
                    st.binary(max_size=12),
                    st.builds(
                        lambda address, size, rest: address.to_bytes(2, "little") + size.to_bytes(2, "little") + rest,
                        st.sampled_from((0, 11, 20, 64, 68, 98, 100, 102, 116, 126, 144, 65535)),
                        st.sampled_from((0, 1, 2, 4, 10, 65535)),
                        st.binary(max_size=12),
                    ),
                ),
            ),
        ),
        max_size=8,
    )
)
def test_arbitrary_bytes_are_tolerated(chunks: list[bytes]) -> None:
    emulator = DynamixelEmulator(DynamixelEmulatorOptions(held=False))
    reader, now = StatusPacketReader(), 5.0
    for chunk in chunks:
        now += 0.004
        emulator.receive(chunk, now)
        emulator.advance(now + 0.002)
        for reply in emulator.replies(now + 0.002):
            assert len(reader.feed(reply)) == 1
    assert reader.dropped_bytes == reader.bad_crc == 0
    assert all(abs(velocity) < 20.0 for velocity in emulator.arm.velocities)
