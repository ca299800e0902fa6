"""A device or robot on a serial port that `weberlink device emulate` emulates in a process, for live sessions."""

import re
from pathlib import Path
from typing import Any, Self

from tests.program import Program, document


class Emulated(Program):
    """An emulator at work; its port is known within the `with`."""

    def __init__(self, name: str, folder: Path, *options: str) -> None:
        """Of a driver, its port and the FIFO of its faults in a folder; options are "key=value" each."""
        self._fifo = folder / f"{name}.faults"
        sets = [f"--set={option}" for option in options]
        super().__init__("device", "emulate", name, "--link", folder / name, "--faults", self._fifo, *sets)

    def __enter__(self) -> Self:
        found = re.search(r" is at (\S+); configure it as", self.line())
        assert found is not None
        self.port = found[1]
        return self

    def line(self) -> str:
        assert self._process.stdout is not None
        return self._process.stdout.readline()

    def say(self, line: str) -> None:
        """Give a command of faults."""
        with self._fifo.open("w") as fifo:
            fifo.write(line + "\n")

    def status(self) -> dict[str, Any]:
        self.say("status")
        while not (line := self.line()).startswith("{"):
            assert line, "the emulator has ended"
        return document(line)
