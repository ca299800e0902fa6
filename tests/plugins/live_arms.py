"""A live session of arms in processes of its own, as a user starts it: `weberlink loopback FILE`."""

import json
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from signal import SIGINT
from time import monotonic, sleep
from types import TracebackType
from typing import Any, Self

from weberlink.apps.live_ends import LiveEnd, find_end
from weberlink.protocol.states import State
from weberlink.telemetry.reader import RingReader
from weberlink.telemetry.ring import default_path

ROOT = Path(__file__).parents[2]
START_S = 60.0
"""Longest time until both ends are engaged [s]; an emulated arm takes seconds to compile."""


class LiveArms:
    """Both daemons of a file, on any free port; ended by an interrupt at the end of the block.

    Attributes:
        session: by which its ends are found.
        summary: figures of the whole run, once it has ended.
    """

    def __init__(self, file: str) -> None:
        any_port = ("--set", "link.listen=127.0.0.1:0", "--set", "link.slave=127.0.0.1:0")
        self._process = subprocess.Popen(
            [sys.executable, "-m", "weberlink", "loopback", str(ROOT / file), "--json", "-", *any_port],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            start_new_session=True,
            cwd=ROOT,
        )
        self.session = str(self._process.pid)
        self.summary: dict[str, Any] = {}

    def __enter__(self) -> Self:
        try:
            self._wait()
        except BaseException:
            self.__exit__(None, None, None)
            raise
        return self

    def end(self, side: str) -> LiveEnd:
        return find_end(side, self.session)

    def ring(self, side: str) -> RingReader:
        """Its records from now on."""
        reader = RingReader(default_path(f"{self.session}-{side}"))
        reader.read()
        return reader

    def _wait(self) -> None:
        until = monotonic() + START_S
        while monotonic() < until:
            with suppress(FileNotFoundError), self._new("master") as master, self._new("slave") as slave:
                states = [records["state"][-1] for ring in (master, slave) if len(records := ring.read())]
                if states == [State.ENGAGED.value] * 2:
                    return
            if self._process.poll() is not None:
                break
            sleep(0.05)
        raise RuntimeError(f"the session did not begin: {self._end()}")

    def _new(self, side: str) -> RingReader:
        return RingReader(default_path(f"{self.session}-{side}"))

    def _end(self) -> str:
        with suppress(ProcessLookupError):
            self._process.send_signal(SIGINT)
        output, complaints = self._process.communicate(timeout=30.0)
        with suppress(ValueError):
            self.summary = json.loads(output)
        return complaints.decode().strip()

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        if self._process.poll() is None:
            self._end()
