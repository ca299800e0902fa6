"""What a relay has done with the datagrams of one direction: the third book, beside those of the two ends.

Plain counts. Knows neither sockets nor daemons.
"""

from dataclasses import asdict, dataclass, field, fields
from typing import Any


@dataclass
class Book:
    """Counts of one direction, since the relay began.

    What has `arrived`, and what the relay made itself (`duplicated`, `replayed`), was `passed` on to the socket of the
    receiver, or has gone otherwise, or is still `under_way`.
    """

    arrived: int = 0
    arrived_bytes: int = 0
    passed: int = 0
    passed_bytes: int = 0
    lost: int = 0
    """By the faulty link, on purpose."""
    refused: int = 0
    """By the kernel, when the relay tried to pass it on."""
    orphaned: int = 0
    """With nobody to pass it on to: it came before the first word of the other end, or to an address left behind."""
    discarded: int = 0
    """Held back, and then thrown away."""
    reordered: int = 0
    duplicated: int = 0
    corrupted: int = 0
    """Passed on with a bit flipped, copies included."""
    released: int = 0
    """Held back, and then passed on."""
    replayed: int = 0
    """Sent again, long after the first time."""
    under_way: int = 0
    handshakes: int = 0
    """Of those passed on: HELLO and WELCOME."""
    strange: int = 0
    """From an address that is neither end."""
    kernel_drops: int = 0
    """For want of room in the relay's own sockets of this direction."""

    @property
    def balance(self) -> int:
        """0 if every datagram is accounted for."""
        made = self.arrived + self.duplicated + self.replayed
        gone = self.passed + self.lost + self.refused + self.orphaned + self.discarded
        return made - gone - self.under_way

    def __sub__(self, earlier: "Book") -> "Book":
        """What was done since an earlier reading."""
        return Book(**{item.name: getattr(self, item.name) - getattr(earlier, item.name) for item in fields(self)})

    @classmethod
    def from_dict(cls, values: dict[str, int]) -> "Book":
        return cls(**values)


@dataclass
class Books:
    """Both directions, read at one moment.

    Args:
        at: `time.monotonic` [s].
        forward, backward: to the slave, to the master.
        calls: HELLOs that have arrived from the master, so far.
        answers: WELCOMEs that have arrived from the slave, so far.
        master: where the master is, or was last.
        back: the address that the slave sees.
        late: longest time, since the books were last read, that the relay itself stood still [s].
    """

    at: float
    forward: Book = field(default_factory=Book)
    backward: Book = field(default_factory=Book)
    calls: int = 0
    answers: int = 0
    master: tuple[str, int] | None = None
    back: tuple[str, int] = ("", 0)
    late: float = 0.0

    def to_dict(self) -> dict[str, Any]:
        return asdict(self)

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> "Books":
        made = dict(values)
        for name in ("forward", "backward"):
            made[name] = Book.from_dict(made[name])
        made["master"] = None if made["master"] is None else (made["master"][0], made["master"][1])
        made["back"] = (made["back"][0], made["back"][1])
        return cls(**made)
