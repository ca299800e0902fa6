"""cyclictest of rt-tests: how late this kernel wakes a thread that does nothing else. Its command line, its output."""

import re
import shutil
import subprocess
from typing import NamedTuple

import numpy as np

from benchmarks.arrangement import BenchError
from benchmarks.percentiles import Series
from benchmarks.rights import Rights

PROGRAM = "cyclictest"
LONGEST_US = 50_000
"""Of a bin of its own; what is later counts as the latest."""
START_S = 30.0
"""What it may take beyond its cycles."""


class Histogram(NamedTuple):
    """What its threads saw together: every latency, whole microseconds, ascending; and the largest [us]."""

    latencies_us: Series
    threads: int


def version() -> str | None:
    """As it says; None where it is not installed."""
    if shutil.which(PROGRAM) is None:
        return None
    said = subprocess.run([PROGRAM, "--help"], capture_output=True, text=True, check=False)  # noqa: S603
    found = re.search(r"cyclictest\s+V\s*([\d.]+)", said.stdout + said.stderr)
    return f"{PROGRAM} {found[1] if found else 'of an unknown version'}"


def arguments(rate_hz: float, duration_s: float, rights: Rights, threads: int) -> list[str]:
    """Its command line: the interval, class, priority and processors of the daemons, one thread for each of them.

    Args:
        rate_hz: of each thread [Hz].
        duration_s: [s].
        rights: as the daemons have them.
        threads: how many.
    """
    line = [PROGRAM, "-q", "-t", str(threads), "-d", "0", "-h", str(LONGEST_US)]
    line += ["-i", str(round(1e6 / rate_hz)), "-l", str(max(1, round(rate_hz * duration_s)))]
    line += [f"--policy={'fifo' if rights.priority else 'other'}"]
    line += ["-p", str(rights.priority)] if rights.priority else []
    line += ["-m"] if rights.lock_memory else []
    line += ["-a", ",".join(map(str, sorted(rights.cpus)))] if rights.cpus is not None else []
    # It keeps the processors awake if it is not told otherwise: it must not where the daemons do not.
    return line + ([] if rights.wakeful else ["--default-system"])


def measure(line: list[str], duration_s: float) -> Histogram:
    """Run it.

    Raises:
        BenchError: if it fails, or says what cannot be read.
    """
    try:
        ended = subprocess.run(  # noqa: S603
            line, capture_output=True, text=True, check=False, timeout=2.0 * duration_s + START_S
        )
    except subprocess.TimeoutExpired:
        raise BenchError(f"{' '.join(line)}: did not come to an end") from None
    if ended.returncode:
        raise BenchError(f"{' '.join(line)}: {(ended.stderr or ended.stdout).strip().splitlines()[-1:]}")
    return parse(ended.stdout)


def parse(text: str) -> Histogram:
    """The histogram that `-h` prints: a line for each microsecond, a column for each thread.

    Raises:
        BenchError: if there is none in the text.
    """
    rows = [line.split() for line in text.splitlines() if re.fullmatch(r"\d+(\s+\d+)+\s*", line)]
    totals = _trailer(text, "Total")
    if not rows or not totals or any(len(row) != 1 + len(totals) for row in rows):
        raise BenchError(f"{PROGRAM}: its output holds no histogram")
    table = np.array(rows, dtype=np.int64)
    counts = table[:, 1:].sum(axis=1)
    latencies = [np.repeat(table[:, 0], counts).astype(np.float64)]
    latest, beyond = _trailer(text, "Max Latencies"), _trailer(text, "Histogram Overflows")
    latencies += [np.full(count, float(most)) for count, most in zip(beyond, latest, strict=False)]
    return Histogram(np.sort(np.concatenate(latencies)), len(totals))


def _trailer(text: str, name: str) -> list[int]:
    found = re.search(rf"^# {name}:((?:[ \t]+\d+)+)", text, re.M)
    return [] if found is None else [int(number) for number in found[1].split()]
