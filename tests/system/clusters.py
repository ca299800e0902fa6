"""A real Dask cluster on loopback: a scheduler and workers, each a process."""

import json
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from time import monotonic, sleep

from tests.system.systems import CONFIGS

STARTS_WITHIN_S = 60.0


class Cluster:
    """What runs, by process: all of it is begun at once, and there when this is made."""

    def __init__(self, folder: Path, workers: int) -> None:
        self._folder = folder
        self._file = folder / "scheduler.json"
        self._log = folder / "log"
        self.scheduler = self._start("dask_scheduler", "--port", "0", "--scheduler-file", str(self._file))
        # Without a nanny, so that a worker that dies stays dead.
        options = ("--nthreads", "1", "--no-nanny", "--local-directory", str(folder))
        self.workers = [
            self._start("dask_worker", "--scheduler-file", str(self._file), *options) for _ in range(workers)
        ]

    def wait(self) -> None:
        """Until all have found each other."""
        ends = monotonic() + STARTS_WITHIN_S
        while not self._complete():
            assert all(process.poll() is None for process in (*self.workers, self.scheduler)), self._log.read_text()
            assert monotonic() < ends, "the cluster takes too long to start"
            sleep(0.05)

    def _complete(self) -> bool:
        if not self._file.exists() or not self._file.read_text().endswith("}"):
            return False
        return self._log.read_text().count("Registered to:") == len(self.workers)

    @property
    def address(self) -> str:
        """Of the scheduler."""
        found: str = json.loads(self._file.read_text())["address"]
        return found

    def end(self) -> None:
        for process in (*self.workers, self.scheduler):
            process.kill()
            process.wait()

    def _start(self, module: str, *arguments: str) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", f"distributed.cli.{module}", *arguments, "--host", "127.0.0.1"]
        with self._log.open("ab") as log:
            return subprocess.Popen([*command, "--no-dashboard"], cwd=CONFIGS.parent, stdout=log, stderr=log)


@contextmanager
def cluster(folder: Path, workers: int) -> Iterator[Cluster]:
    """Ends every process at the end."""
    started = Cluster(folder, workers)
    try:
        started.wait()
        yield started
    finally:
        started.end()
