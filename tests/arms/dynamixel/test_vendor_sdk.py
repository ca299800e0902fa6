"""Our requests and emulated motors against the vendor's own SDK: the same bytes, and an arm that it can drive."""

from collections.abc import Callable, Iterator
from pathlib import Path
from time import monotonic, sleep

import pytest
from dynamixel_sdk import COMM_SUCCESS, GroupSyncRead, GroupSyncWrite, PacketHandler, PortHandler

from weberlink.arms.dynamixel import packet, registers
from weberlink.arms.dynamixel.packet import encode_packet
from weberlink.arms.emulators.dynamixel.joint_arm import KochLeaderEmulator, KochLeaderEmulatorOptions
from weberlink.hardware.emulator import PtyDevice

SDK = PacketHandler(2.0)


class RecordedPort:
    """What the SDK writes; nothing answers."""

    is_using = False

    def __init__(self) -> None:
        self.sent = b""

    def clearPort(self) -> None: ...  # noqa: N802 - called so by the SDK

    def setPacketTimeout(self, length: int) -> None: ...  # noqa: N802

    def writePort(self, data: list[int]) -> int:  # noqa: N802
        self.sent += bytes(data)
        return len(data)


@pytest.fixture
def port() -> RecordedPort:
    return RecordedPort()


def test_ping_is_that_of_sdk(port: RecordedPort) -> None:
    SDK.txPacket(port, [0, 0, 0, 0, 3, 3, 0, 1, 0, 0])
    assert port.sent == encode_packet(packet.ping(3))


@pytest.mark.parametrize(
    ("register", "value"),
    [
        (registers.OPERATING_MODE, 0),
        (registers.TORQUE_ENABLE, 1),
        (registers.BUS_WATCHDOG, 4),
        (registers.GOAL_CURRENT, -3),
        (registers.GOAL_POSITION, -260),
    ],
)
def test_writes_are_those_of_sdk(port: RecordedPort, register: registers.Register, value: int) -> None:
    data = register.encode(value)
    SDK.writeTxOnly(port, 6, register.address, register.size, list(data))
    assert port.sent == encode_packet(packet.write(6, register.address, data))


def test_read_is_that_of_sdk(port: RecordedPort) -> None:
    SDK.readTx(port, 6, 132, 4)
    assert port.sent == encode_packet(packet.read(6, 132, 4))


def test_sync_read_is_that_of_sdk(port: RecordedPort) -> None:
    group = GroupSyncRead(port, SDK, registers.PRESENT_ADDRESS, registers.PRESENT_SIZE)
    for id_ in range(1, 7):
        group.addParam(id_)
    assert group.txPacket() == COMM_SUCCESS
    ours = encode_packet(packet.sync_read(registers.PRESENT_ADDRESS, registers.PRESENT_SIZE, range(1, 7)))
    assert port.sent == ours


@pytest.mark.parametrize(
    ("register", "values"),
    [(registers.GOAL_CURRENT, (0, 100, -100, 1750, -1, 7)), (registers.GOAL_POSITION, (0, 4095, -1, 2048, 1 << 18, 5))],
)
def test_sync_writes_are_those_of_sdk(
    port: RecordedPort, register: registers.Register, values: tuple[int, ...]
) -> None:
    group = GroupSyncWrite(port, SDK, register.address, register.size)
    pairs = [(id_, register.encode(value)) for id_, value in enumerate(values, start=1)]
    for id_, data in pairs:
        group.addParam(id_, list(data))
    assert group.txPacket() == COMM_SUCCESS
    assert port.sent == encode_packet(packet.sync_write(register.address, register.size, pairs))


@pytest.fixture
def arm(tmp_path: Path) -> Iterator[tuple[KochLeaderEmulator, PortHandler]]:
    """A leader that nobody holds, on a port that the SDK opened."""
    emulator = KochLeaderEmulator(KochLeaderEmulatorOptions(hand_n_m_rad=0.0, current_noise_ma=0.0))
    with PtyDevice(emulator, tmp_path / "port"):
        opened = PortHandler(str(tmp_path / "port"))
        assert opened.openPort()
        assert opened.setBaudRate(1_000_000)
        yield emulator, opened
        opened.closePort()


def _wait_for(condition: Callable[[], object], limit: float = 5.0) -> None:
    until = monotonic() + limit
    while not condition():
        assert monotonic() < until
        sleep(0.005)


def _insist(ask: Callable[[], tuple[int, ...]], result_at: int = -2) -> tuple[int, ...]:
    """The first answer that came in time: the SDK waits for some 30 ms, and this host may pause for longer."""
    until = monotonic() + 5.0
    while (said := ask())[result_at] != COMM_SUCCESS:
        assert monotonic() < until, SDK.getTxRxResult(said[result_at])
    return said


def _write(opened: PortHandler, id_: int, address: int, size: int, value: int) -> int:
    """The error byte of the answer."""
    write = {1: SDK.write1ByteTxRx, 2: SDK.write2ByteTxRx, 4: SDK.write4ByteTxRx}[size]
    return _insist(lambda: write(opened, id_, address, value))[1]


def test_sdk_drives_emulated_leader_until_its_watchdog_trips(arm: tuple[KochLeaderEmulator, PortHandler]) -> None:
    emulator, opened = arm
    for id_ in range(1, 7):
        assert _insist(lambda id_=id_: SDK.ping(opened, id_)) == (1190, COMM_SUCCESS, 0)  # type: ignore[misc]
    for address, value in ((11, 0), (9, 0), (64, 1)):
        assert _write(opened, 1, address, 1, value) == 0
    goals = GroupSyncWrite(opened, SDK, 102, 2)
    goals.addParam(1, [100, 0])
    assert goals.txPacket() == COMM_SUCCESS
    _wait_for(lambda: emulator.angles[0] > 0.3)
    present = GroupSyncRead(opened, SDK, 126, 10)
    for id_ in range(1, 7):
        assert present.addParam(id_)
    _insist(lambda: (present.txRxPacket(),), -1)
    assert present.getData(1, 132, 4) > 2048
    assert present.getData(2, 132, 4) == 2048
    assert _write(opened, 1, 98, 1, 5) == 0
    _wait_for(lambda: emulator.watchdog_trips == 1 and emulator.currents[0] == 0.0)
    assert _insist(lambda: SDK.read1ByteTxRx(opened, 1, 98))[0] == 0xFF
    assert _write(opened, 1, 102, 2, 5) == packet.DATA_RANGE_ERROR
    assert _write(opened, 1, 98, 1, 0) == 0
    assert _write(opened, 1, 102, 2, 5) == 0


def test_sdk_reads_refusals_and_alarms_of_emulated_motors(arm: tuple[KochLeaderEmulator, PortHandler]) -> None:
    emulator, opened = arm
    assert _write(opened, 2, 102, 2, 1751) == packet.DATA_LIMIT_ERROR
    assert _write(opened, 2, 132, 4, 0) == packet.ACCESS_ERROR
    emulator.inject("low_voltage", 1.0)
    _wait_for(lambda: emulator.servos[1].registers["hardware_error_status"])
    assert _insist(lambda: SDK.read1ByteTxRx(opened, 2, 70)) == (1, COMM_SUCCESS, packet.ALERT)
    assert _insist(lambda: SDK.read2ByteTxRx(opened, 2, 144)) == (30, COMM_SUCCESS, packet.ALERT)


def test_sdk_understands_stuffed_answers(arm: tuple[KochLeaderEmulator, PortHandler]) -> None:
    """The SDK for Python (4.1.0) drops the stuffing of what it sends, so only this direction can be compared."""
    emulator, opened = arm
    emulator.servos[2].registers["goal_position"] = 0x00FDFFFF
    assert _insist(lambda: SDK.read4ByteTxRx(opened, 3, 116)) == (0x00FDFFFF, COMM_SUCCESS, 0)
