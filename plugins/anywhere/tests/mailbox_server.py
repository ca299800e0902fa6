"""A magic-wormhole mailbox server as a process of its own, which ends with the `with`."""

import atexit
import re
import sys
from pathlib import Path
from subprocess import DEVNULL, Popen
from tempfile import TemporaryDirectory
from typing import Self

from tests.wait import until

UNIT = Path(__file__).parents[1] / "configs" / "relay" / "weberlink-mailbox.service"
_STARTED = re.compile(r"PrivacyEnhancedSite(?: \(TLS\))? starting on (\d+)")


class MailboxServer:
    """The server of the package magic-wormhole-mailbox-server; what it holds is kept from `stop` to `start`.

    `prefix` is a command that runs it, `tls` the folder of its certificate, as of `weberlink-mailbox.service`.
    """

    def __init__(
        self, host: str = "127.0.0.1", port: int = 0, prefix: tuple[str, ...] = (), tls: Path | None = None
    ) -> None:
        self.host, self.port, self._prefix, self._tls = host, port, prefix, tls
        self._process: Popen[bytes] | None = None

    @property
    def url(self) -> str:
        return f"{'ws' if self._tls is None else 'wss'}://{self.host}:{self.port}/v1"

    def start(self) -> None:
        listen = f"--port=tcp:{self.port}:interface={self.host}"
        if self._tls is not None:
            (found,) = re.findall(r"--port=ssl:4000(:\S+)", UNIT.read_text(encoding="utf-8"))
            options = found.replace("${CREDENTIALS_DIRECTORY}", str(self._tls))
            listen = f"--port=ssl:{self.port}:interface={self.host}{options}"
        database = f"--channel-db={self._folder.name}/channels.sqlite"
        twist = (sys.executable, "-m", "twisted", f"--log-file={self._log}", "--log-format=text")
        self._log.write_bytes(b"")
        command = [*self._prefix, *twist, "wormhole-mailbox", listen, database]
        self._process = process = Popen(command, stdin=DEVNULL, stdout=DEVNULL)
        until(lambda: _STARTED.search(self._log.read_text()) or process.poll() is not None, "the mailbox server")
        if (started := _STARTED.search(log := self._log.read_text())) is None:
            raise RuntimeError(f"the mailbox server did not start: {log}")
        self.port = int(started[1])

    def stop(self) -> None:
        if self._process is not None:
            self._process.terminate()
            self._process.wait()
            self._process = None

    def __enter__(self) -> Self:
        self._folder = TemporaryDirectory(prefix="wl-mailbox-")
        atexit.register(self.stop)  # where a coroutine that holds it is never finished
        self._log = Path(self._folder.name) / "log.txt"
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()
        atexit.unregister(self.stop)
        self._folder.cleanup()
