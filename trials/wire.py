"""The relay process as a context manager, ordered about by lines of JSON."""

import json
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from typing import Any, NamedTuple, Self

from weberlink.protocol.emulation import Emulation

Address = tuple[str, int]


class Books(NamedTuple):
    """What the relay has done so far."""

    forward: Counter[str]  # counts of `trials.relay.Direction`, to the slave and to the master
    backward: Counter[str]
    calls: int  # HELLOs from the master, WELCOMEs from the slave
    answers: int
    master: Address | None  # address of the master, and the one that the slave sees
    back: Address
    late: float  # longest time since the last reading in which the relay itself stood still [s]


class Wire:
    """A relay in front of `slave`, for as long as the `with` lasts."""

    def __init__(self, slave: Address, seed: int) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-m", "trials.relay", json.dumps({"slave": slave, "seed": seed})],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            start_new_session=True,  # Ctrl-C ends whoever started it, which closes its standard input
        )
        self.front = _address(self._answer())

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        assert self._process.stdin is not None and self._process.stdout is not None
        self._process.stdin.close()
        try:
            self._process.wait(5.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._process.stdout.close()

    @property
    def pid(self) -> int:
        return self._process.pid

    def books(self) -> Books:
        told = self._ask(do="books")
        master = None if told["master"] is None else _address(told["master"])
        ways = {way: Counter(told[way]) for way in ("forward", "backward")}
        return Books(**{**told, **ways, "master": master, "back": _address(told["back"])})

    def emulate(self, emulation: Emulation, way: str = "") -> None:
        """Other faults from now on; `way` is "forward", "backward", or "" for both."""
        self._ask(do="emulate", emulation=asdict(emulation), way=way)

    def replay(self, way: str, count: int, since: float, until: float) -> int:
        """Send up to `count` datagrams of this session again that were passed on between then and then [s]."""
        return int(self._ask(do="replay", way=way, count=count, since=since, until=until))

    @contextmanager
    def replaying(self, way: str, count: int, until: float) -> Iterator[None]:
        """The same, while something else is done."""
        self._tell(do="replay", way=way, count=count, since=0.0, until=until)
        yield
        self._answer()

    def rebind(self, host: str) -> None:
        """Let the slave see another port, on `host`."""
        self._ask(do="rebind", host=host)

    def steal(self, host: str) -> list[int]:
        """Overtake the master's datagrams with copies from `host`; "" ends it.

        Returns how many datagrams, and how many probes of the path, the slave has sent to that address.
        """
        stolen: list[int] = self._ask(do="steal", host=host)
        return stolen

    def recorded_calls(self) -> list[bytes]:
        """The newest HELLOs of the master."""
        return [bytes.fromhex(text) for text in self._ask(do="recorded_calls")]

    def recall(self, way: str, count: int) -> list[bytes]:
        """The newest datagrams of this session that were passed on."""
        return [bytes.fromhex(text) for text in self._ask(do="recall", way=way, count=count)]

    def _ask(self, **order: Any) -> Any:
        self._tell(**order)
        return self._answer()

    def _tell(self, **order: Any) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps(order).encode() + b"\n")
        self._process.stdin.flush()

    def _answer(self) -> Any:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            raise RuntimeError(f"the relay has ended, with status {self._process.wait()}")
        return json.loads(line)


def _address(told: list[Any]) -> Address:
    return told[0], told[1]
