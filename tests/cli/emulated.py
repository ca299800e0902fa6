"""A device or robot that `weberlink device emulate` emulates in a process, for live sessions."""

import os
import re
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any, Self

from tests.program import document
from tests.wait import PATIENCE


class Emulated:
    """An emulator at work; its port is known within the `with`."""

    def __init__(self, name: str, folder: Path, *options: str) -> None:
        """Of a driver, its port and the FIFO of its faults in a folder; options are "key=value" each."""
        self._fifo = folder / f"{name}.faults"
        sets = [argument for option in options for argument in ("--set", option)]
        command = [sys.executable, "-m", "weberlink", "device", "emulate", name, "--faults", str(self._fifo), *sets]
        self._process = subprocess.Popen(
            command, cwd=folder, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True
        )

    def __enter__(self) -> Self:
        found = re.search(r" is at (\S+); configure it as", self.line())
        assert found is not None
        self.port = found[1]
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.communicate(timeout=PATIENCE)

    def line(self) -> str:
        assert self._process.stdout is not None
        return self._process.stdout.readline()

    def send(self, number: signal.Signals) -> None:
        os.kill(self._process.pid, number)

    def say(self, line: str) -> None:
        """Give a command of faults."""
        with self._fifo.open("w") as fifo:
            fifo.write(line + "\n")

    def status(self) -> dict[str, Any]:
        self.say("status")
        while not (line := self.line()).startswith("{"):
            assert line, "the emulator has ended"
        return document(line)


def norm(parts: list[float]) -> float:
    return float(sum(part * part for part in parts) ** 0.5)
