"""Packets on a bus of servos, and what a protocol on its wire says of them."""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from typing import ClassVar, Final, NamedTuple, Protocol, TypeVar

BROADCAST: Final = 0xFE
PING: Final = 0x01
READ: Final = 0x02
WRITE: Final = 0x03
REBOOT: Final = 0x08
SYNC_READ: Final = 0x82
SYNC_WRITE: Final = 0x83


class Packet(NamedTuple):
    """A request."""

    id: int
    instruction: int
    parameters: bytes = b""


class Status(NamedTuple):
    """A servo's answer; `error` is 0 for success."""

    id: int
    error: int
    parameters: bytes = b""


Heard_co = TypeVar("Heard_co", covariant=True)


class Reader(Protocol[Heard_co]):
    """Cuts a stream into packets; never raises, and never holds more than the longest one."""

    bad: int  # packets with a wrong checksum since the start

    def feed(self, data: bytes) -> Sequence[Heard_co]:
        """The packets that are complete with these bytes, oldest first."""
        ...

    def clear(self) -> None:
        """Forget what has come of an unfinished packet."""
        ...


class Framing(ABC):
    """A protocol on the wire: how packets become bytes, and bytes packets."""

    OVERHEAD: ClassVar[int]  # bytes of an answer without parameters
    WIDTH: ClassVar[int]  # bytes of an address or size
    REFUSAL: ClassVar[int]  # error bits of an answer that comes without the data asked for
    # Address, and sizes, of reads that are used for nothing else; more than answers can be owed before an arm is lost.
    MARKS: ClassVar[tuple[int, range]]

    @abstractmethod
    def encode(self, packet: Packet | Status) -> bytes: ...

    @abstractmethod
    def requests(self) -> Reader[Packet]: ...

    @abstractmethod
    def answers(self) -> Reader[Status]: ...

    def mark(self, id_: int, number: int) -> tuple[bytes, int]:
        """A read that no other is taken for, and the size of its answer."""
        address, sizes = self.MARKS
        size = sizes[number % len(sizes)]
        return self.read(id_, address, size), size

    def ping(self, id_: int) -> bytes:
        return self.encode(Packet(id_, PING))

    def read(self, id_: int, address: int, size: int) -> bytes:
        return self.encode(Packet(id_, READ, self.numbers(address, size)))

    def write(self, id_: int, address: int, data: bytes) -> bytes:
        return self.encode(Packet(id_, WRITE, self.numbers(address) + data))

    def sync_read(self, address: int, size: int, ids: Iterable[int]) -> bytes:
        """Read the same registers of several servos, which answer in this order."""
        return self.encode(Packet(BROADCAST, SYNC_READ, self.numbers(address, size) + bytes(ids)))

    def sync_write(self, address: int, size: int, values: Iterable[tuple[int, bytes]]) -> bytes:
        """Write the same registers of several servos, `size` bytes each; they do not answer."""
        data = b"".join(bytes((id_,)) + value for id_, value in values)
        return self.encode(Packet(BROADCAST, SYNC_WRITE, self.numbers(address, size) + data))

    def numbers(self, *values: int) -> bytes:
        """Addresses and sizes."""
        return b"".join(value.to_bytes(self.WIDTH, "little") for value in values)

    def number(self, data: bytes, index: int) -> int:
        """The address or size at this index; 0 where there is none."""
        return int.from_bytes(data[index * self.WIDTH : (index + 1) * self.WIDTH], "little")
