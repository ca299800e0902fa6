"""A magic-wormhole mailbox server as a process of its own, which ends with the `with`."""

import atexit
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from time import monotonic, sleep
from types import TracebackType
from typing import Self

import pytest

from tests.wait import PATIENCE

_STARTED = re.compile(r"PrivacyEnhancedSite starting on (\d+)")


class MailboxServer:
    """The server of the package magic-wormhole-mailbox-server, started again by `restart`.

    Args:
        host: IPv4 address to listen on.
        port: 0 for any free one.
        prefix: a command that runs the server, such as ("ip", "netns", "exec", NAME).
    """

    def __init__(self, host: str = "127.0.0.1", port: int = 0, prefix: tuple[str, ...] = ()) -> None:
        self.host, self.port = host, port
        self._prefix = prefix
        self._process: subprocess.Popen[bytes] | None = None

    @property
    def url(self) -> str:
        return f"ws://{self.host}:{self.port}/v1"

    @property
    def log(self) -> str:
        """What the server wrote since its last start."""
        return self._log.read_text(errors="replace")

    def start(self) -> None:
        """Start it, and wait until it listens."""
        listen = f"--port=tcp:{self.port}:interface={self.host}"
        database = f"--channel-db={self._folder.name}/channels.sqlite"
        self._log.write_bytes(b"")
        twist = (sys.executable, "-m", "twisted", f"--log-file={self._log}", "--log-format=text")
        self._process = subprocess.Popen(
            [*self._prefix, *twist, "wormhole-mailbox", listen, database],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
        )
        deadline = monotonic() + PATIENCE
        while (started := _STARTED.search(self.log)) is None:
            if self._process.poll() is not None or monotonic() > deadline:
                self._process.kill()
                stderr = self._process.communicate()[1].decode(errors="replace")
                raise RuntimeError(f"the mailbox server did not start: {self.log}{stderr}")
            sleep(0.02)
        self.port = int(started[1])

    def stop(self) -> None:
        """End it; what it holds for its clients is kept for the next start."""
        if self._process is not None:
            self._process.terminate()
            self._process.communicate()
            self._process = None

    def __enter__(self) -> Self:
        self._folder = TemporaryDirectory(prefix="wl-mailbox-")
        atexit.register(self.stop)  # where a coroutine that holds it is never finished
        self._log = Path(self._folder.name) / "log.txt"
        self.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.stop()
        atexit.unregister(self.stop)
        self._folder.cleanup()


@pytest.fixture(scope="session")
def mailbox() -> Iterator[MailboxServer]:
    """One for all tests of a run; import it in the tests that want it."""
    pytest.importorskip("wormhole_mailbox_server")
    with MailboxServer() as server:
        yield server
