"""Feetech's SDK beside our own requests, byte for byte, and on the emulated arm."""

from collections.abc import Iterator
from pathlib import Path
from time import sleep
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from weberlink.arms.emulators.feetech import FeetechEmulator
from weberlink.arms.feetech import packet
from weberlink.hardware.emulator import PtyDevice

sdk: Any = pytest.importorskip("scservo_sdk")


class Tape:
    """What the SDK writes, in place of its port; nobody answers."""

    is_using = False

    def __init__(self) -> None:
        self.written = b""

    def writePort(self, data: list[int]) -> int:  # noqa: N802 - the SDK's name
        self.written += bytes(data)
        return len(data)

    def readPort(self, size: int) -> list[int]:  # noqa: N802
        return []

    def isPacketTimeout(self) -> bool:  # noqa: N802
        return True

    def clearPort(self) -> None:  # noqa: N802
        pass

    def setPacketTimeout(self, size: int) -> None:  # noqa: N802
        pass


@given(st.integers(0, 252), st.integers(0, 70), st.integers(1, 15), st.integers(0, 0xFFFF))
def test_single_requests_are_those_of_the_sdk(id_: int, address: int, size: int, value: int) -> None:
    tape, handler = Tape(), sdk.PacketHandler(0)
    handler.ping(tape, id_)
    handler.readTxRx(tape, id_, address, size)
    handler.write2ByteTxRx(tape, id_, address, value)
    ours = packet.ping(id_) + packet.read(id_, address, size) + packet.write(id_, address, value.to_bytes(2, "little"))
    assert tape.written == ours


@given(st.lists(st.integers(0, 252), min_size=1, max_size=6, unique=True), st.integers(0, 70), st.binary(min_size=10))
def test_sync_requests_are_those_of_the_sdk(ids: list[int], address: int, data: bytes) -> None:
    tape, handler = Tape(), sdk.PacketHandler(0)
    writer = sdk.GroupSyncWrite(tape, handler, address, 10)
    reader = sdk.GroupSyncRead(tape, handler, address, 15)
    for id_ in ids:
        assert writer.addParam(id_, list(data[:10]))
        assert reader.addParam(id_)
    writer.txPacket()
    tape.is_using = False
    reader.txPacket()
    ours = packet.sync_write(address, 10, [(id_, data[:10]) for id_ in ids]) + packet.sync_read(address, 15, ids)
    assert tape.written == ours


@pytest.fixture
def arm(tmp_path: Path) -> Iterator[PtyDevice]:
    with PtyDevice(FeetechEmulator(), tmp_path / "arm") as device:
        yield device


def reached(read: Any, wanted: int) -> bool:
    for _ in range(100):
        if abs(read() - wanted) <= 3:
            return True
        sleep(0.02)
    return False


@pytest.mark.realtime
def test_the_sdk_reads_writes_and_moves_the_emulated_arm(arm: PtyDevice) -> None:
    port, handler = sdk.PortHandler(str(arm.path)), sdk.PacketHandler(0)
    assert port.openPort()
    assert port.setBaudRate(1_000_000)
    port.setPacketTimeout = lambda _size: port.setPacketTimeoutMillis(1000.0)  # the machine may stall
    try:
        assert [handler.ping(port, id_) for id_ in range(1, 7)] == [(777, 0, 0)] * 6
        assert handler.write1ByteTxRx(port, 2, 40, 1) == (0, 0)
        assert handler.write2ByteTxRx(port, 2, 42, 2300) == (0, 0)
        assert handler.read2ByteTxRx(port, 2, 42) == (2300, 0, 0)
        assert reached(lambda: handler.read2ByteTxRx(port, 2, 56)[0], 2300)
        reader = sdk.GroupSyncRead(port, handler, 56, 15)
        for id_ in range(1, 7):
            reader.addParam(id_)
        assert reader.txRxPacket() == 0
        assert [reader.getData(id_, 62, 1) for id_ in range(1, 7)] == [74] * 6
    finally:
        port.closePort()
