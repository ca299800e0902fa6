"""`weberlink monitor` as a process, for the tests that look at it as a browser or Prometheus does."""

import re
import subprocess
import sys
from pathlib import Path
from typing import Self

from tests.program import ROOT
from tests.wait import PATIENCE, until


class Monitor:
    """The process, which is dead at the end of the `with`.

    Args:
        folder: for what it says.
        arguments: of the command line; the port is any that is free if none is given.
        command: `monitor`, `try`, which also runs a session, or another server with a port.
    """

    _count = 0

    def __init__(self, folder: Path, *arguments: object, command: str = "monitor") -> None:
        Monitor._count += 1
        self._said = folder / f"monitor-{Monitor._count}"
        port = () if "--port" in arguments else ("--port", "0")
        with self._said.open("w") as out:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "weberlink", *command.split(), *port, *map(str, arguments)],
                cwd=ROOT,
                stdin=subprocess.DEVNULL,
                stdout=out,
                stderr=subprocess.STDOUT,
            )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.wait()

    @property
    def pid(self) -> int:
        return self._process.pid

    @property
    def said(self) -> str:
        return self._said.read_text()

    def until_said(self, pattern: str) -> str:
        """Wait for words of it; returns what the pattern's first group matched."""

        def look() -> re.Match[str] | None:
            has_ended = self._process.poll() is not None
            found = re.search(pattern, self.said)
            assert found or not has_ended, f"the monitor ended: {self.said}"
            return found

        found = until(look, f"the monitor to say {pattern!r}")
        return found[found.re.groups]

    @property
    def url(self) -> str:
        """Of the server, once the page is served; without the slash at the end."""
        return self.until_said(r"(http://[^ /]+)/#")

    @property
    def address(self) -> str:
        """Of the page with the key, as it is printed."""
        return self.until_said(r"http://\S+#key=\S+")

    @property
    def key(self) -> str:
        """Of who may change something."""
        return self.address.partition("#key=")[2]

    def send(self, number: int) -> None:
        self._process.send_signal(number)

    def finish(self) -> tuple[int, str]:
        """Wait for the end: exit status, and all that it said."""
        return self._process.wait(PATIENCE), self.said
