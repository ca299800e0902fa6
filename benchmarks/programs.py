"""cyclictest of rt-tests: the limit of this machine at the speed of C."""

import re
import shutil
import subprocess
from typing import NamedTuple

import numpy as np

from benchmarks.arrangement import BenchError, Rights
from benchmarks.percentiles import Series

LONGEST_US = 50_000  # last bin of the histogram of cyclictest; later wake-ups count as the latest one
START_S = 30.0  # time that it may take beyond its measurement


def cyclictest_version() -> str | None:
    """Name and version; None if it is not installed."""
    if shutil.which("cyclictest") is None:
        return None
    said = subprocess.run(["cyclictest", "--help"], capture_output=True, text=True, check=False)  # noqa: S607
    found = re.search(r"cyclictest\s+V\s*([\d.]+)", said.stdout + said.stderr)
    return f"cyclictest {found[1] if found else 'of an unknown version'}"


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
    timeout = 2.0 * duration_s + START_S
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
