"""sockperf: an echo of datagrams between two processes at the speed of C. Its command lines and its output."""

import csv
import re
import shutil
import socket
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from math import ceil
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks.arrangement import BenchError
from benchmarks.percentiles import Series
from benchmarks.rights import Rights

PROGRAM = "sockperf"
HOST = "127.0.0.1"
START_S = 20.0
READY = "block on socket"
"""What the server says when it listens."""


def version() -> str | None:
    """As it says; None where it is not installed."""
    if shutil.which(PROGRAM) is None:
        return None
    said = subprocess.run([PROGRAM, "--version"], capture_output=True, text=True, check=False)  # noqa: S603
    found = re.search(r"version\s+#?(\d[\w.]*)", said.stdout + said.stderr)
    return f"{PROGRAM} {found[1] if found else 'of an unknown version'}"


def measure(size: int, duration_s: float, rights: Rights) -> Series:
    """Round trips of datagrams of `size` bytes, one after another without a pause [us].

    Raises:
        BenchError: if it fails, or says what cannot be read.
    """
    port = free_port()
    with TemporaryDirectory() as folder, _server(port, rights):
        log = Path(folder) / "round_trips.csv"
        seconds = ceil(duration_s)
        client = subprocess.Popen(  # noqa: S603
            [
                *(PROGRAM, "ping-pong", "-i", HOST, "-p", str(port), "-t", str(seconds), "-m", str(size)),
                *("--full-rtt", "--full-log", str(log)),
            ],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        try:
            rights.give(client.pid, 0)
            said, _ = client.communicate(timeout=seconds + START_S)
        except subprocess.TimeoutExpired:
            raise BenchError(f"{PROGRAM}: did not come to an end") from None
        finally:
            client.kill()
            client.communicate()
        if client.returncode:
            raise BenchError(f"{PROGRAM}: {said.strip().splitlines()[-1]}")
        return parse(log.read_text(encoding="utf-8"))


def parse(log: str) -> Series:
    """The round trips of the file that `--full-log` writes [us]; observations follow a line that names their columns.

    Raises:
        BenchError: if there are none.
    """
    lines = log.splitlines()
    heads = [place for place, line in enumerate(lines) if line.startswith("packet,")]
    if not heads:
        raise BenchError(f"{PROGRAM}: its log holds no observations")
    rows = csv.DictReader(lines[heads[0] :], skipinitialspace=True)
    trips = [(float(row["rxTime(sec)"]) - float(row["txTime(sec)"])) * 1e6 for row in rows if row.get("rxTime(sec)")]
    if not trips:
        raise BenchError(f"{PROGRAM}: its log holds no observations")
    return np.array(trips)


def free_port() -> int:
    """Of UDP on this host, free now."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind((HOST, 0))
        port: int = probe.getsockname()[1]
        return port


@contextmanager
def _server(port: int, rights: Rights) -> Iterator[None]:
    line = [PROGRAM, "server", "-i", HOST, "-p", str(port)]
    server = subprocess.Popen(line, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)  # noqa: S603
    try:
        rights.give(server.pid, 1)
        assert server.stdout is not None
        said = ""
        while READY not in said:
            line_ = server.stdout.readline()
            if not line_:
                raise BenchError(f"{PROGRAM}: its server ended: {said.strip().splitlines()[-1:]}")
            said += line_
        yield
    finally:
        server.kill()
        server.communicate()
