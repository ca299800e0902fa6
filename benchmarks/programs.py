"""cyclictest of rt-tests and sockperf: the limits of this machine at the speed of C."""

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
from typing import NamedTuple

import numpy as np

from benchmarks.arrangement import BenchError, Rights
from benchmarks.percentiles import Series

LONGEST_US = 50_000  # last bin of the histogram of cyclictest; later wake-ups count as the latest one
CYCLICTEST_START_S, SOCKPERF_START_S = 30.0, 20.0  # time that the programs may take beyond their measurement
HOST = "127.0.0.1"
READY = "block on socket"  # text of sockperf's server when it listens


def cyclictest_version() -> str | None:
    """Name and version; None if it is not installed."""
    return _version("cyclictest", "--help", r"cyclictest\s+V\s*([\d.]+)")


def sockperf_version() -> str | None:
    """Name and version; None if it is not installed."""
    return _version("sockperf", "--version", r"version\s+#?(\d[\w.]*)")


def _version(program: str, option: str, pattern: str) -> str | None:
    if shutil.which(program) is None:
        return None
    said = subprocess.run([program, option], capture_output=True, text=True, check=False)  # noqa: S603
    found = re.search(pattern, said.stdout + said.stderr)
    return f"{program} {found[1] if found else 'of an unknown version'}"


class Histogram(NamedTuple):
    """All latencies of the threads of cyclictest, whole microseconds, ascending."""

    latencies_us: Series
    threads: int


def cyclictest_line(rate_hz: float, duration_s: float, rights: Rights, threads: int) -> list[str]:
    """Command line of cyclictest with the interval, class, priority and processors of the daemons."""
    line = ["cyclictest", "-q", "-t", str(threads), "-d", "0", "-h", str(LONGEST_US)]
    line += ["-i", str(round(1e6 / rate_hz)), "-l", str(max(1, round(rate_hz * duration_s)))]
    line += [f"--policy={'fifo' if rights.priority else 'other'}"]
    line += ["-p", str(rights.priority)] if rights.priority else []
    line += ["-m"] if rights.lock_memory else []
    line += ["-a", ",".join(map(str, sorted(rights.cpus)))] if rights.cpus is not None else []
    # By default it keeps the processors awake, which it must not do where the daemons do not.
    return line + ([] if rights.wakeful else ["--default-system"])


def cyclictest(line: list[str], duration_s: float) -> Histogram:
    """Run cyclictest.

    Raises:
        BenchError: if it fails, or its output cannot be read.
    """
    timeout = 2.0 * duration_s + CYCLICTEST_START_S
    try:
        ended = subprocess.run(line, capture_output=True, text=True, check=False, timeout=timeout)  # noqa: S603
    except subprocess.TimeoutExpired:
        raise BenchError(f"{' '.join(line)}: did not end in time") from None
    if ended.returncode:
        raise BenchError(f"{' '.join(line)}: {(ended.stderr or ended.stdout).strip().splitlines()[-1:]}")
    return parse_histogram(ended.stdout)


def parse_histogram(text: str) -> Histogram:
    """Read the output of `-h`: a line for each microsecond, a column for each thread.

    Raises:
        BenchError: if there is no histogram.
    """
    rows = [line.split() for line in text.splitlines() if re.fullmatch(r"\d+(\s+\d+)+\s*", line)]
    totals = _trailer(text, "Total")
    if not rows or not totals or any(len(row) != 1 + len(totals) for row in rows):
        raise BenchError("cyclictest: its output holds no histogram")
    table = np.array(rows, dtype=np.int64)
    counts = table[:, 1:].sum(axis=1)
    latencies = [np.repeat(table[:, 0], counts).astype(np.float64)]
    latest, beyond = _trailer(text, "Max Latencies"), _trailer(text, "Histogram Overflows")
    latencies += [np.full(count, float(most)) for count, most in zip(beyond, latest, strict=False)]
    return Histogram(np.sort(np.concatenate(latencies)), len(totals))


def _trailer(text: str, name: str) -> list[int]:
    found = re.search(rf"^# {name}:((?:[ \t]+\d+)+)", text, re.M)
    return [] if found is None else [int(number) for number in found[1].split()]


def sockperf(size: int, duration_s: float, rights: Rights) -> Series:
    """Round trips of datagrams of `size` bytes, one after another without a pause [us].

    Raises:
        BenchError: if it fails, or its output cannot be read.
    """
    port = _free_port()
    with TemporaryDirectory() as folder, _server(port, rights):
        log = Path(folder) / "round_trips.csv"
        seconds = ceil(duration_s)
        line = ["sockperf", "ping-pong", "-i", HOST, "-p", str(port), "-t", str(seconds), "-m", str(size)]
        client = subprocess.Popen(  # noqa: S603
            [*line, "--full-rtt", "--full-log", str(log)], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        )
        try:
            rights.give(client.pid, 0)
            said, _ = client.communicate(timeout=seconds + SOCKPERF_START_S)
        except subprocess.TimeoutExpired:
            raise BenchError("sockperf: did not end in time") from None
        finally:
            client.kill()
            client.communicate()
        if client.returncode:
            raise BenchError(f"sockperf: {said.strip().splitlines()[-1]}")
        return parse_trips(log.read_text(encoding="utf-8"))


def parse_trips(log: str) -> Series:
    """Read the round trips [us] from the file of `--full-log`, below the line with the names of its columns.

    Raises:
        BenchError: if there are none.
    """
    lines = log.splitlines()
    heads = [place for place, line in enumerate(lines) if line.startswith("packet,")]
    rows = csv.DictReader(lines[heads[0] :], skipinitialspace=True) if heads else ()
    trips = [(float(row["rxTime(sec)"]) - float(row["txTime(sec)"])) * 1e6 for row in rows if row.get("rxTime(sec)")]
    if not trips:
        raise BenchError("sockperf: its log holds no observations")
    return np.array(trips)


def _free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind((HOST, 0))
        port: int = probe.getsockname()[1]
        return port


@contextmanager
def _server(port: int, rights: Rights) -> Iterator[None]:
    line = ["sockperf", "server", "-i", HOST, "-p", str(port)]
    server = subprocess.Popen(line, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)  # noqa: S603
    try:
        rights.give(server.pid, 1)
        assert server.stdout is not None
        said = ""
        while READY not in said:
            more = server.stdout.readline()
            if not more:
                raise BenchError(f"sockperf: its server ended: {said.strip().splitlines()[-1:]}")
            said += more
        yield
    finally:
        server.kill()
        server.communicate()
