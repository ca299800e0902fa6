"""A host in virtual time: sends instructions to an emulated bus and collects what is said."""

from weberlink.arms.dynamixel import packet
from weberlink.arms.dynamixel.packet import Packet, StatusPacket, StatusPacketReader, encode_packet
from weberlink.slave.emulators.dynamixel import DynamixelEmulator

IDS = (11, 12, 13, 14, 15)


class Host:
    """Asks, and waits as long as asked to [s]."""

    def __init__(self, emulator: DynamixelEmulator, now: float = 100.0) -> None:
        self.emulator = emulator
        self.now = now
        self.reader = StatusPacketReader()
        emulator.advance(now)

    def wait(self, time: float) -> list[StatusPacket]:
        """Whatever is said meanwhile."""
        self.now += time
        self.emulator.advance(self.now)
        return self.reader.feed(b"".join(self.emulator.replies(self.now)))

    def ask(self, *packets: Packet, patience: float = 0.02) -> list[StatusPacket]:
        self.emulator.receive(b"".join(map(encode_packet, packets)), self.now)
        return self.wait(patience)

    def read(self, id_: int, address: int, size: int) -> int:
        (status,) = self.ask(packet.read(id_, address, size))
        assert status.error == 0, status
        return int.from_bytes(status.parameters, "little", signed=size > 1)

    def write(self, id_: int, address: int, size: int, value: int) -> int:
        """The error byte of the answer."""
        (status,) = self.ask(packet.write(id_, address, value.to_bytes(size, "little", signed=value < 0)))
        assert status.id == id_
        return status.error

    def current_control(self, *ids: int) -> None:
        """Torque on in current mode, at zero."""
        for id_ in ids:
            assert self.write(id_, 11, 1, 0) == 0
            assert self.write(id_, 102, 2, 0) == 0
        self.ask(packet.sync_write(64, 1, [(id_, b"\x01") for id_ in ids]))
