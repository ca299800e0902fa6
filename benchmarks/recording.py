"""What a recording costs a live session: missed ticks and lateness with and without it, and the recorder's own time.

A loopback without recording, one with, one without again, so that what the machine does meanwhile shows in the first
and the last. Bounded: ends by itself.

    python -m benchmarks.recording --minutes 10
"""

import argparse
import json
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from evaluation.environment import environment, footer

LIMIT = 0.03
"""Share of a core that the recorder may take."""


def main() -> int:
    """Run and print; the exit status is 1 if the file is not complete or the recorder takes more than its share."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=1.0, help="length of the recorded session")
    minutes = parser.parse_args().minutes
    with TemporaryDirectory() as folder:
        path = Path(folder) / "session.mcap"
        runs = [
            ("without", loopback(30.0 * minutes)),
            ("with", loopback(60.0 * minutes, "--record", str(path))),
            ("without", loopback(30.0 * minutes)),
        ]
        described = json.loads(weberlink("info", str(path), "--json", "-"))
    print("recording  side    ticks    missed            late p50/p99/p99.9 us")  # noqa: T201
    for name, run in runs:
        for side, ticks in run["ticks"].items():
            late = "/".join(f"{ticks['lateness_us'][key]:.0f}" for key in ("p50", "p99", "p99_9"))
            share = ticks["missed"] / (ticks["count"] + ticks["missed"])
            print(f"{name:9}  {side:6}  {ticks['count']:7}  {ticks['missed']:5} {100 * share:.3f} %  {late}")  # noqa: T201
    recording = runs[1][1]["recording"]
    share = recording["cpu_s"] / recording["elapsed_s"]
    counted = {side: ticks["count"] for side, ticks in runs[1][1]["ticks"].items()}
    whole = described["files"][0]["complete"] and described["files"][0]["records"] == counted
    print(  # noqa: T201
        f"recorder: {100 * share:.2f} % of a core, limit {100 * LIMIT:.0f} %; {recording['bytes'] / 1e6:.1f} MB; "
        f"lost {sum(recording['lost'].values())}; file {'whole, a record for every tick' if whole else 'NOT WHOLE'}"
    )
    print(footer(environment()))  # noqa: T201
    return 0 if whole and share <= LIMIT else 1


def loopback(seconds: float, *arguments: str) -> dict[str, Any]:
    """The figures of a session."""
    result: dict[str, Any] = json.loads(weberlink("loopback", "--duration", f"{seconds:g}", "--json", "-", *arguments))
    return result


def weberlink(*arguments: str) -> str:
    """Standard output of a command."""
    command = [sys.executable, "-m", "weberlink", *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout  # noqa: S603


if __name__ == "__main__":
    sys.exit(main())
