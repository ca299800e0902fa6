"""The two MuJoCo scenes in real time, beside the default file: missed ticks, work per tick, and what is coded away.

Sessions of the three files take turns, so that what the machine does meanwhile falls on all alike. Bounded: ends by
itself.

    python -m benchmarks.mujoco_loopback --seconds 10 --rounds 5
"""

import argparse
import json
import subprocess
import sys
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import Any

from weberlink.geometry.vector import norm
from weberlink.system.composition.slave import build_robot
from weberlink.system.configuration import load
from weberlink.system.environment import environment, footer
from weberlink.system.simulate import build_simulation

CONFIGS = Path(__file__).parents[1] / "configs"
SCENES = ("mujoco-arm.yaml", "mujoco-peg.yaml")
FILES = (*SCENES, "loopback.yaml")
LIMIT = 0.02
"""Share of ticks that a side may miss."""
Figures = dict[str, Any]


def main() -> int:
    """Run and print; the exit status is 1 if a side of a MuJoCo scene misses more than its share, in the median."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seconds", type=float, default=5.0, help="of each session")
    parser.add_argument("--rounds", type=int, default=3, help="sessions of each file")
    asked = parser.parse_args()
    out = sys.stdout
    for scene in SCENES:
        out.write(f"{scene:16}  robot alone, us per tick: {robot_us(scene)}\n")
    sessions: dict[str, list[Figures]] = {file: [] for file in FILES}
    for _ in range(asked.rounds):
        for file in FILES:
            sessions[file].append(loopback(file, asked.seconds))
    out.write("\nfile              side    missed: median, least to most    work p50/p99 us, medians\n")
    for file in FILES:
        for side in ("master", "slave"):
            out.write(f"{file:16}  {side:6}  {ticks(sessions[file], side)}\n")
    out.write("\nfile              force packets/s   reduction   felt violation, medians\n")
    for file in FILES:
        rate, reduction, violation = (
            median(figures["force"][key] for figures in sessions[file])
            for key in ("packets_per_s", "reduction", "violation_fraction")
        )
        out.write(f"{file:16}  {rate:15.1f}  {100 * reduction:8.2f} %  {100 * violation:14.2f} %\n")
    worst = max(median(missed(sessions[scene], side)) for scene in SCENES for side in ("master", "slave"))
    out.write(f"\nmost missed by a side of a MuJoCo scene: {100 * worst:.2f} %, limit {100 * LIMIT:.0f} %\n")
    out.write(f"{footer(environment())}\n")
    return 0 if worst <= LIMIT else 1


def loopback(file: str, seconds: float) -> Figures:
    """What a session of two processes reports."""
    command = [sys.executable, "-m", "weberlink", "loopback", str(CONFIGS / file), "--duration", f"{seconds:g}"]
    output = subprocess.run([*command, "--json", "-"], capture_output=True, text=True, check=True).stdout  # noqa: S603
    figures: Figures = json.loads(output)
    return figures


def missed(sessions: list[Figures], side: str) -> list[float]:
    """Share of the ticks of a side, session by session."""
    counted = [figures["ticks"][side] for figures in sessions]
    return [one["missed"] / (one["count"] + one["missed"]) for one in counted]


def ticks(sessions: list[Figures], side: str) -> str:
    shares = [100 * share for share in missed(sessions, side)]
    work = "/".join(
        f"{median(figures['ticks'][side]['work_us'][key] for figures in sessions):.0f}" for key in ("p50", "p99")
    )
    return f"{median(shares):6.2f} %, {min(shares):.2f} to {max(shares):.2f} %{'':12}{work}"


def robot_us(file: str, seconds: float = 8.0) -> str:
    """Time of `latest` on the commands of a session in virtual time, in free space and in contact."""
    configuration = load(CONFIGS / file)
    simulation = build_simulation(configuration)
    period = configuration.system.tick_period
    commands = []
    for _ in range(round(seconds / period)):
        slave = simulation.step()[1]
        commands.append((slave.output_x, slave.output_y, slave.output_z))
    robot = build_robot(configuration)
    robot.open(0.0)
    times: dict[bool, list[float]] = {False: [], True: []}
    for tick, command in enumerate(commands, 1):
        robot.command(command, tick * period)
        began = perf_counter()
        reading = robot.latest(tick * period)
        times[norm(reading.force) > 0.1].append(perf_counter() - began)
    free, touching = (1e6 * median(times[contact]) for contact in (False, True))
    return f"{free:.0f} in free space, {touching:.0f} in contact (medians)"


if __name__ == "__main__":
    sys.exit(main())
