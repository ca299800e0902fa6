"""Start-up time of the program to its first engaged tick and to its help, beside a bare interpreter."""

import os
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from statistics import median
from tempfile import TemporaryDirectory
from time import monotonic
from typing import Any

from benchmarks.arrangement import MAIN_RATE_HZ, Arrangement, BenchError
from benchmarks.loopback import Session

ROUNDS, QUICK_ROUNDS = 3, 1
PATIENCE_S = 60.0
LOOPBACK, HELP, INTERPRETER = "loopback", "help", "interpreter"


@dataclass(frozen=True)
class StartUp:
    """Start-up times [s], by program."""

    seconds: Mapping[str, list[float]]

    def as_json(self) -> dict[str, Any]:
        limit = median(self.seconds[INTERPRETER])
        return {
            what: {
                "median_s": median(values),
                "min_s": min(values),
                "max_s": max(values),
                "rounds": len(values),
                "ratio_to_interpreter": median(values) / limit,
            }
            for what, values in self.seconds.items()
        }


def line(document: Mapping[str, Any]) -> str:
    """Line of the report of what `StartUp.as_json` gave."""
    starts = (
        f"{what} {each['median_s']:.2f} s ({each['ratio_to_interpreter']:.0f} x)" for what, each in document.items()
    )
    return f"start: {', '.join(starts)}"


def measure(arrangement: Arrangement) -> StartUp:
    """Start all programs in turn, several times.

    What a process has compiled is kept for the next one, as on the host of a user, also where the environment forbids
    Python to write it; the first round, which compiles, does not count unless it is the only one.

    Raises:
        BenchError: if one of them fails.
    """
    rounds = QUICK_ROUNDS if arrangement.quick else 1 + ROUNDS
    with TemporaryDirectory(prefix="weberlink-bench-") as compiled:
        given = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
        environment = {**given, "PYTHONPYCACHEPREFIX": compiled}
        found = [_round(arrangement, environment) for _ in range(rounds)][-ROUNDS:]
    return StartUp({what: [each[what] for each in found] for what in (INTERPRETER, HELP, LOOPBACK)})


def _round(arrangement: Arrangement, environment: Mapping[str, str]) -> dict[str, float]:
    """One start of each program [s]."""
    with Session(arrangement.file, arrangement.overrides(MAIN_RATE_HZ), environment) as session:
        engaged = session.start_s()
    return {
        INTERPRETER: _ended([sys.executable, "-c", "pass"], environment),
        HELP: _ended([sys.executable, "-m", "weberlink", "--help"], environment),
        LOOPBACK: engaged,
    }


def _ended(command: list[str], environment: Mapping[str, str]) -> float:
    began = monotonic()
    try:
        subprocess.run(command, env=environment, capture_output=True, check=True, timeout=PATIENCE_S)  # noqa: S603
    except (subprocess.CalledProcessError, subprocess.TimeoutExpired) as error:
        raise BenchError(f"start-up: {error}") from None
    return monotonic() - began
