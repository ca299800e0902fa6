"""The relay as seen by whoever started it: a child process that is asked by lines of JSON."""

import json
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from types import TracebackType
from typing import Any, Self

from tests.soak.books import Books
from weberlink.protocol.emulation import Emulation

Address = tuple[str, int]


class Wire:
    """A relay in front of `slave`, for as long as the `with` lasts."""

    def __init__(self, slave: Address, seed: int) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tests.soak.relay", json.dumps({"slave": slave, "seed": seed})],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            start_new_session=True,  # Ctrl-C is for whoever started it, who ends it by closing its standard input
        )
        host, port = self._answer()
        self.front: Address = (host, port)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
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
        return Books.from_dict(self._ask(do="books"))

    def emulate(self, emulation: Emulation, way: str = "") -> None:
        """Other faults from now on; `way` is "forward", "backward", or "" for both."""
        self._ask(do="emulate", emulation=asdict(emulation), way=way)

    def hold(self, way: str) -> None:
        self._ask(do="hold", way=way)

    def release(self, way: str, *, deliver: bool) -> int:
        """Go on; returns how many datagrams were held back."""
        return int(self._ask(do="release", way=way, deliver=deliver))

    def release_old(self, way: str, until: float) -> int:
        """Pass on what came before then [s], and hold back the rest; returns how many were passed on."""
        return int(self._ask(do="release_old", way=way, until=until))

    def replay(self, way: str, count: int, since: float, until: float) -> int:
        """Send up to `count` datagrams again that were passed on between then and then [s]."""
        return int(self._ask(do="replay", way=way, count=count, since=since, until=until))

    @contextmanager
    def replaying(self, way: str, count: int, since: float, until: float) -> Iterator[None]:
        """The same, while something else is done; it has ended at the end of the `with`."""
        self._tell(do="replay", way=way, count=count, since=since, until=until)
        yield
        self._answer()

    def rebind(self, host: str) -> Address:
        """Let the slave see another address; returns it."""
        moved_to, port = self._ask(do="rebind", host=host)
        return moved_to, port

    def swap(self, slave: Address | None) -> None:
        """Lead the master to another slave; None for the first one again."""
        self._ask(do="swap", slave=slave)

    def steal(self, host: str) -> tuple[int, int]:
        """Overtake the master's datagrams with copies from `host`; "" ends it.

        Returns:
            How many datagrams, and how many probes of the path, the slave has sent to that address.
        """
        stolen, probed = self._ask(do="steal", host=host)
        return stolen, probed

    def recorded_calls(self) -> list[bytes]:
        """The newest HELLOs of the master."""
        return [bytes.fromhex(text) for text in self._ask(do="recorded_calls")]

    def recall(self, way: str, count: int) -> list[bytes]:
        """The newest datagrams that were passed on, as they came."""
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
