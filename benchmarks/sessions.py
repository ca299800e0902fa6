"""Live sessions of two processes: cost of the MuJoCo scenes, and cost of recording.

Sessions with and without what is measured take turns, so that other load of the machine affects both alike. They end by
themselves. The exit status is 1 if a limit is missed.

    python -m benchmarks.sessions mujoco --seconds 10 --rounds 5
    python -m benchmarks.sessions recording --seconds 30 --rounds 20
"""

import argparse
import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any, NamedTuple

from weberlink.geometry.vector import norm
from weberlink.system.composition.slave import build_robot
from weberlink.system.configuration import SIDES, load
from weberlink.system.environment import environment, footer
from weberlink.system.simulate import build_simulation

CONFIGS = Path(__file__).parents[1] / "configs"
MUJOCO = ("mujoco-arm.yaml", "mujoco-peg.yaml")
MISSED_LIMIT = 0.02
"""Share of ticks that a side of a MuJoCo scene may miss."""
RECORDER_LIMIT = 0.03
"""Share of a core that the recorder may use."""

CommandJson = dict[str, Any]
"""The JSON of a command."""


def weberlink(*arguments: str) -> CommandJson:
    """Run a command and return its JSON."""
    command = [sys.executable, "-m", "weberlink", *arguments, "--json", "-"]
    output = subprocess.run(command, capture_output=True, text=True, check=True).stdout  # noqa: S603
    document: CommandJson = json.loads(output)
    return document


def missed(reports: Sequence[CommandJson], side: str) -> list[float]:
    """Share of missed ticks of a side in each session."""
    ticks = [report["ticks"][side] for report in reports]
    return [one["missed"] / (one["count"] + one["missed"]) for one in ticks]


def line(reports: Sequence[CommandJson], side: str, figure: str) -> str:
    """Missed ticks of a side, and the median percentiles of a figure [us]."""
    shares = [100 * share for share in missed(reports, side)]
    medians = (
        median(report["ticks"][side][figure][name] for report in reports)
        for name in ("p50", "p99", "p99_9")
        if name in reports[0]["ticks"][side][figure]
    )
    return (
        f"{median(shares):7.3f} %, {min(shares):.3f} to {max(shares):.3f} %   {'/'.join(f'{us:.0f}' for us in medians)}"
    )


def mujoco(seconds: float, rounds: int) -> bool:
    """The MuJoCo scenes beside the default file; returns whether the limit is met."""
    out = sys.stdout
    for scene in MUJOCO:
        out.write(f"{scene:16}  robot alone, us per tick: {robot_us(scene)}\n")
    files = (*MUJOCO, "loopback.yaml")
    reports: dict[str, list[CommandJson]] = {file: [] for file in files}
    for _ in range(rounds):
        for file in files:
            reports[file].append(weberlink("loopback", str(CONFIGS / file), "--duration", f"{seconds:g}"))
    out.write("\nfile              side    missed: median, least to most    work us, medians of percentiles\n")
    for file in files:
        for side in SIDES:
            out.write(f"{file:16}  {side:6}  {line(reports[file], side, 'work_us')}\n")
    out.write("\nfile              force packets/s   reduction   felt violation, medians\n")
    for file in files:
        rate, reduction, violation = (
            median(report["force"][key] for report in reports[file])
            for key in ("packets_per_s", "reduction", "violation_fraction")
        )
        out.write(f"{file:16}  {rate:15.1f}  {100 * reduction:8.2f} %  {100 * violation:14.2f} %\n")
    worst = max(median(missed(reports[scene], side)) for scene in MUJOCO for side in SIDES)
    out.write(
        f"\nmost missed by a side of a MuJoCo scene: {100 * worst:.2f} %, limit {100 * MISSED_LIMIT:.0f} %\n"
        f"{footer(environment())}\n"
    )
    return worst <= MISSED_LIMIT


def robot_us(file: str, seconds: float = 8.0) -> str:
    """Run time of `latest` on the commands of a session in virtual time, in free space and in contact."""
    configuration = load(CONFIGS / file)
    simulation = build_simulation(configuration)
    period = configuration.system.tick_period
    robot = build_robot(configuration)
    robot.open(0.0)
    times: dict[bool, list[float]] = {False: [], True: []}
    for tick in range(1, round(seconds / period) + 1):
        slave = simulation.step()[1]
        robot.command((slave.output_x, slave.output_y, slave.output_z), tick * period)
        began = perf_counter()
        reading = robot.latest(tick * period)
        times[norm(reading.force) > 0.1].append(perf_counter() - began)
    free, touching = (1e6 * median(times[contact]) for contact in (False, True))
    return f"{free:.0f} in free space, {touching:.0f} in contact (medians)"


class RecordedRun(NamedTuple):
    """The report of a recorded session, and whether its file holds every tick."""

    report: CommandJson
    whole: bool


def recording(seconds: float, rounds: int) -> bool:
    """Sessions with and without recording; returns whether every file is whole and the limit is met."""
    without, sessions = [_loopback(0.5 * seconds)], []
    for number in range(rounds):
        with TemporaryDirectory() as folder:
            sessions.append(_recorded(seconds, Path(folder) / "session.mcap"))
        without.append(_loopback(0.5 * seconds if number == rounds - 1 else seconds))
    out = sys.stdout
    out.write("recording  side    missed: median, least to most   late us, medians of percentiles\n")
    for name, reports in (("without", without), ("with", [session.report for session in sessions])):
        for side in SIDES:
            out.write(f"{name:9}  {side:6}  {line(reports, side, 'lateness_us')}\n")
    files = [session.report["recording"] for session in sessions]
    share = sum(each["cpu_s"] for each in files) / sum(each["elapsed_s"] for each in files)
    lost = sum(count for each in files for count in each["lost"].values())
    whole = all(session.whole for session in sessions)
    out.write(
        f"recorder: {100 * share:.2f} % of a core, limit {100 * RECORDER_LIMIT:.0f} %; "
        f"{sum(each['bytes'] for each in files) / 1e6:.1f} MB; {lost} records lost; "
        f"{'every file has a record for every tick' if whole else 'A FILE IS INCOMPLETE'}\n{footer(environment())}\n"
    )
    return whole and share <= RECORDER_LIMIT


def _loopback(seconds: float, *options: str) -> CommandJson:
    return weberlink("loopback", "--duration", f"{seconds:g}", *options)


def _recorded(seconds: float, path: Path) -> RecordedRun:
    report = _loopback(seconds, "--record", str(path))
    file = weberlink("info", str(path))["files"][0]
    counted = {side: ticks["count"] for side, ticks in report["ticks"].items()}
    return RecordedRun(report, file["complete"] and file["records"] == counted)


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("what", choices=("mujoco", "recording"))
    parser.add_argument("--seconds", type=float, default=5.0, help="of each session")
    parser.add_argument("--rounds", type=int, default=3, help="sessions of each kind")
    asked = parser.parse_args()
    return 0 if {"mujoco": mujoco, "recording": recording}[asked.what](asked.seconds, asked.rounds) else 1


if __name__ == "__main__":
    sys.exit(main())
