"""The vendors' own SDKs beside our requests, byte for byte, and on emulated arms behind a pseudo terminal."""

from pathlib import Path
from typing import Any

import pytest
from dynamixel_sdk import COMM_SUCCESS, GroupSyncRead, GroupSyncWrite, PacketHandler
from hypothesis import given, strategies as st

from tests.wait import until
from weberlink.testing.serving import PtyDevice
from weberlink_arms.dynamixel import registers
from weberlink_arms.dynamixel.packet import FRAMING as DYNAMIXEL
from weberlink_arms.emulators.feetech import FeetechEmulator
from weberlink_arms.feetech.packet import FRAMING as FEETECH

scservo: Any = pytest.importorskip("scservo_sdk")
SDK = PacketHandler(2.0)


class Tape:
    """What an SDK writes, in place of its port; nobody answers, and it is never busy."""

    is_using = property(lambda _: False, lambda _, __: None)

    def __init__(self) -> None:
        self.written = b""

    def writePort(self, data: list[int]) -> int:  # noqa: N802 - the SDKs' names, here and below
        self.written += bytes(data)
        return len(data)

    def readPort(self, size: int) -> list[int]:  # noqa: N802
        return []

    def isPacketTimeout(self) -> bool:  # noqa: N802
        return True

    def clearPort(self) -> None: ...  # noqa: N802

    def setPacketTimeout(self, size: int) -> None: ...  # noqa: N802


@given(st.integers(0, 252), st.integers(0, 70), st.integers(1, 15), st.integers(0, 0xFFFF))
def test_single_requests_are_those_of_feetech(id_: int, address: int, size: int, value: int) -> None:
    tape, handler = Tape(), scservo.PacketHandler(0)
    handler.ping(tape, id_)
    handler.readTxRx(tape, id_, address, size)
    handler.write2ByteTxRx(tape, id_, address, value)
    data = value.to_bytes(2, "little")
    assert tape.written == FEETECH.ping(id_) + FEETECH.read(id_, address, size) + FEETECH.write(id_, address, data)


@given(st.lists(st.integers(0, 252), min_size=1, max_size=6, unique=True), st.integers(0, 70), st.binary(min_size=10))
def test_sync_requests_are_those_of_feetech(ids: list[int], address: int, data: bytes) -> None:
    tape, handler = Tape(), scservo.PacketHandler(0)
    writer = scservo.GroupSyncWrite(tape, handler, address, 10)
    reader = scservo.GroupSyncRead(tape, handler, address, 15)
    for id_ in ids:
        assert writer.addParam(id_, list(data[:10]))
        assert reader.addParam(id_)
    writer.txPacket()
    reader.txPacket()
    ours = FEETECH.sync_write(address, 10, [(id_, data[:10]) for id_ in ids]) + FEETECH.sync_read(address, 15, ids)
    assert tape.written == ours


@pytest.mark.parametrize(
    ("register", "values"),
    [
        (registers.OPERATING_MODE, (0, 5)),
        (registers.BUS_WATCHDOG, (4, -1)),
        (registers.GOAL_CURRENT, (0, 100, -100, 1750, -1, 7)),
        (registers.GOAL_POSITION, (0, 4095, -1, 2048, 1 << 18, -260)),
    ],
)
def test_requests_are_those_of_robotis(register: registers.Register, values: tuple[int, ...]) -> None:
    pairs = [(id_, register.encode(value)) for id_, value in enumerate(values, start=1)]
    tape = Tape()
    SDK.txPacket(tape, [0, 0, 0, 0, 3, 3, 0, 1, 0, 0])
    SDK.readTx(tape, 6, register.address, register.size)
    SDK.writeTxOnly(tape, 6, register.address, register.size, list(pairs[-1][1]))
    writer = GroupSyncWrite(tape, SDK, register.address, register.size)
    reader = GroupSyncRead(tape, SDK, register.address, register.size)
    for id_, data in pairs:
        writer.addParam(id_, list(data))
        reader.addParam(id_)
    for group in (writer, reader):
        assert group.txPacket() == COMM_SUCCESS
    ours = [
        DYNAMIXEL.ping(3),
        DYNAMIXEL.read(6, register.address, register.size),
        DYNAMIXEL.write(6, register.address, pairs[-1][1]),
        DYNAMIXEL.sync_write(register.address, register.size, pairs),
        DYNAMIXEL.sync_read(register.address, register.size, [id_ for id_, _ in pairs]),
    ]
    assert tape.written == b"".join(ours)


@pytest.mark.realtime
def test_feetech_sdk_drives_the_emulated_arm(tmp_path: Path) -> None:
    with PtyDevice(FeetechEmulator(), tmp_path / "arm") as wire:
        port, handler = scservo.PortHandler(str(wire.path)), scservo.PacketHandler(0)
        assert port.openPort()
        assert port.setBaudRate(1_000_000)
        port.setPacketTimeout = lambda _size: port.setPacketTimeoutMillis(1000.0)  # the machine may stall
        try:
            assert [handler.ping(port, id_) for id_ in range(1, 7)] == [(777, 0, 0)] * 6
            assert handler.write1ByteTxRx(port, 2, 40, 1) == (0, 0)
            assert handler.write2ByteTxRx(port, 2, 42, 2300) == (0, 0)
            assert handler.read2ByteTxRx(port, 2, 42) == (2300, 0, 0)
            until(lambda: abs(handler.read2ByteTxRx(port, 2, 56)[0] - 2300) <= 3, "the servo to arrive")
        finally:
            port.closePort()
