"""What a recording costs a live session: missed ticks and lateness with and without it, and the recorder's own time.

Sessions with and without recording take turns, so that what the machine does meanwhile falls on both alike. Bounded:
ends by itself.

    python -m benchmarks.recording --minutes 10 --sessions 1      # one long recorded session
    python -m benchmarks.recording --minutes 10 --sessions 20     # the fairer comparison of lateness
"""

import argparse
import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from weberlink.system.environment import environment, footer

LIMIT = 0.03
"""Share of a core that the recorder may take."""


class Session(NamedTuple):
    """What a session reported, and whether its recording holds every tick."""

    recorded: bool
    figures: dict[str, Any]
    whole: bool


def main() -> int:
    """Run and print; the exit status is 1 if a file is not whole or the recorder takes more than its share."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--minutes", type=float, default=1.0, help="recorded in all")
    parser.add_argument("--sessions", type=int, default=4, help="that are recorded; each ends after its share")
    asked = parser.parse_args()
    sessions = list(run(60.0 * asked.minutes / asked.sessions, asked.sessions))
    out = sys.stdout
    out.write("recording  side    sessions  missed: median, least to most     late p50/p99/p99.9 us, medians\n")
    for recorded in (False, True):
        for side in ("master", "slave"):
            out.write(f"{'with' if recorded else 'without':9}  {side:6}  {line(sessions, recorded, side)}\n")
    recordings = [session.figures["recording"] for session in sessions if session.recorded]
    share = sum(each["cpu_s"] for each in recordings) / sum(each["elapsed_s"] for each in recordings)
    lost = sum(count for each in recordings for count in each["lost"].values())
    whole = all(session.whole for session in sessions)
    out.write(
        f"recorder: {100 * share:.2f} % of a core, limit {100 * LIMIT:.0f} %; "
        f"{sum(each['bytes'] for each in recordings) / 1e6:.1f} MB; {lost} records lost; "
        f"{'every file whole, a record for every tick' if whole else 'A FILE IS NOT WHOLE'}\n{footer(environment())}\n"
    )
    return 0 if whole and share <= LIMIT else 1


def run(seconds: float, count: int) -> Iterator[Session]:
    """Sessions without and with recording in turn; the first and the last of those without are half as long."""
    yield loopback(0.5 * seconds, None)
    for number in range(count):
        with TemporaryDirectory() as folder:
            yield loopback(seconds, Path(folder) / "session.mcap")
        yield loopback(0.5 * seconds if number == count - 1 else seconds, None)


def loopback(seconds: float, record: Path | None) -> Session:
    """One session and, if it is recorded, a look at its file."""
    options = () if record is None else ("--record", str(record))
    figures = weberlink("loopback", "--duration", f"{seconds:g}", *options)
    if record is None:
        return Session(False, figures, whole=True)
    file = weberlink("info", str(record))["files"][0]
    counted = {side: ticks["count"] for side, ticks in figures["ticks"].items()}
    return Session(True, figures, whole=file["complete"] and file["records"] == counted)


def line(sessions: list[Session], recorded: bool, side: str) -> str:
    """Missed ticks and lateness of one side over its sessions."""
    ticks = [session.figures["ticks"][side] for session in sessions if session.recorded is recorded]
    missed = [100 * one["missed"] / (one["count"] + one["missed"]) for one in ticks]
    late = "/".join(f"{median(one['lateness_us'][key] for one in ticks):.0f}" for key in ("p50", "p99", "p99_9"))
    return f"{len(ticks):8}  {median(missed):6.3f} %, {min(missed):.3f} to {max(missed):.3f} %    {late}"


def weberlink(*arguments: str) -> dict[str, Any]:
    """The JSON of a command."""
    command = [sys.executable, "-m", "weberlink", *arguments, "--json", "-"]
    output = subprocess.run(command, capture_output=True, text=True, check=True).stdout  # noqa: S603
    document: dict[str, Any] = json.loads(output)
    return document


if __name__ == "__main__":
    sys.exit(main())
