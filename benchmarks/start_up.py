"""Start-up time of the program to its first engaged tick and to its help, beside a bare interpreter."""

import subprocess
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from signal import SIGTERM
from statistics import median
from time import monotonic, sleep
from typing import Any

from benchmarks.arrangement import MAIN_RATE_HZ, Arrangement, BenchError
from weberlink.protocol.states import State
from weberlink.system.configuration import SIDES
from weberlink.telemetry.reader import RingReader
from weberlink.telemetry.ring import default_path

ROUNDS, QUICK_ROUNDS = 3, 1
PATIENCE_S = 60.0
LOOK_S = 0.005
LOOPBACK, HELP, INTERPRETER = "loopback", "help", "interpreter"


@dataclass(frozen=True)
class StartUp:
    """Start-up times [s], by program."""

    seconds: Mapping[str, list[float]]

    def median_s(self, what: str) -> float:
        return median(self.seconds[what])

    def as_json(self) -> dict[str, Any]:
        limit = self.median_s(INTERPRETER)
        return {
            what: {
                "median_s": self.median_s(what),
                "min_s": min(values),
                "max_s": max(values),
                "rounds": len(values),
                "ratio_to_interpreter": self.median_s(what) / limit,
            }
            for what, values in self.seconds.items()
        }


def measure(arrangement: Arrangement) -> StartUp:
    """Start all programs in turn, several times.

    Raises:
        BenchError: if one of them fails.
    """
    program = [sys.executable, "-m", "weberlink"]
    starts: dict[str, Callable[[], float]] = {
        INTERPRETER: lambda: _ended([sys.executable, "-c", "pass"]),
        HELP: lambda: _ended([*program, "--help"]),
        LOOPBACK: lambda: _engaged([*program, "loopback", str(arrangement.file)], arrangement.overrides(MAIN_RATE_HZ)),
    }
    seconds: dict[str, list[float]] = {what: [] for what in starts}
    for _ in range(QUICK_ROUNDS if arrangement.quick else ROUNDS):
        for what, start in starts.items():
            seconds[what].append(start())
    return StartUp(seconds)


def _ended(line: list[str]) -> float:
    began = monotonic()
    ended = subprocess.run(line, capture_output=True, check=False)  # noqa: S603
    took = monotonic() - began
    if ended.returncode:
        raise BenchError(f"{' '.join(line)}: ended with status {ended.returncode}")
    return took


def _engaged(line: list[str], overrides: list[str]) -> float:
    """From the start of the program to the first engaged tick of the later side [s]."""
    options = [word for override in overrides for word in ("--set", override)]
    began = monotonic()
    program = subprocess.Popen(  # noqa: S603
        [*line, *options], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    )
    try:
        firsts = [_first_tick(program, default_path(f"{program.pid}-{side}")) for side in SIDES]
        program.send_signal(SIGTERM)
        program.communicate(timeout=PATIENCE_S)
    except subprocess.TimeoutExpired:
        raise BenchError("weberlink loopback: did not end after SIGTERM") from None
    finally:
        program.kill()
        program.communicate()
    return max(firsts) - began


def _first_tick(program: subprocess.Popen[str], ring: Path) -> float:
    """Time of the first engaged tick [s]."""
    until = monotonic() + PATIENCE_S
    reader: RingReader | None = None
    try:
        while monotonic() < until:
            if program.poll() is not None:
                assert program.stderr is not None
                raise BenchError(f"weberlink loopback: {program.stderr.read().strip() or 'ended before its session'}")
            if reader is None:
                with suppress(FileNotFoundError):
                    reader = RingReader(ring)
            else:
                records = reader.read()
                engaged = records[records["state"] == State.ENGAGED.value]
                if len(engaged):
                    return float(engaged["at"][0] + engaged["lateness_us"][0] * 1e-6)
            sleep(LOOK_S)
    finally:
        if reader is not None:
            reader.close()
    raise BenchError(f"weberlink loopback: no session in {PATIENCE_S:g} s")
