"""A real Dask cluster on loopback: a scheduler and workers, each a process."""

import json
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from time import monotonic, sleep

from tests.weberlink.systems import CONFIGS

STARTS_WITHIN_S = 60.0


class Cluster:
    """What runs, by process."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._file = folder / "scheduler.json"
        self.workers: list[subprocess.Popen[bytes]] = []
        self.scheduler = self._start("dask_scheduler", "--port", "0", "--scheduler-file", str(self._file))
        ends = monotonic() + STARTS_WITHIN_S
        while not self._file.exists() or not self._file.read_text().endswith("}"):
            assert self.scheduler.poll() is None, "the scheduler did not start"
            assert monotonic() < ends, "the scheduler takes too long to start"
            sleep(0.05)
        self.address: str = json.loads(self._file.read_text())["address"]

    def add_worker(self, cwd: Path = CONFIGS.parent) -> None:
        """Without a nanny, so that a worker that dies stays dead."""
        options = ("--nthreads", "1", "--no-nanny", "--local-directory", str(self._folder))
        self.workers.append(self._start("dask_worker", self.address, *options, cwd=cwd))

    def end(self) -> None:
        for process in (*self.workers, self.scheduler):
            process.kill()
            process.wait()

    def _start(self, module: str, *arguments: str, cwd: Path = CONFIGS.parent) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", f"distributed.cli.{module}", *arguments, "--host", "127.0.0.1"]
        log = (self._folder / "log").open("ab")
        with log:
            return subprocess.Popen([*command, "--no-dashboard"], cwd=cwd, stdout=log, stderr=log)


@contextmanager
def cluster(folder: Path, workers: int) -> Iterator[Cluster]:
    """Ends every process at the end."""
    started = Cluster(folder)
    try:
        for _ in range(workers):
            started.add_worker()
        yield started
    finally:
        started.end()
