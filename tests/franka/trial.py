"""`python -m tests.franka.trial`: the driver `franka` before franka-sim, a third party's simulator of an FR3.

Runs in the environment of `make franka`. A scripted hand leads the simulated arm through both daemons and a relay for a
minute at 1 kHz, with the robot's limits enforced: 20 lost cycles in a row stop it. Beside it runs the least loop that
the maker's pylibfranka allows. Then every fault is done to an arm that follows. Prints a table, writes JSON, and exits
with status 1 if a law was violated.
"""

import argparse
import json
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import asdict
from functools import partial
from importlib.metadata import version
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np

from tests.franka.faults import FAULTS, FOLLOW_S, Outcome, inflict
from tests.franka.figures import Likeness, Pace, contact, likeness, pace
from tests.franka.robot import own_address, simulated_robot
from tests.franka.session import ENGAGED, FrankaSession
from tests.laws import Laws, write
from weberlink.system.configuration import MASTER, SLAVE
from weberlink.system.environment import environment, footer

PACKAGES = ("franka-sim", "pylibfranka", "mujoco", "numpy")
SUCCESS = 0.99
MEASURED, RECEIVED, FELT = "measured by the slave", "received by the master", "at the hand"
ALIKE, FELT_ALIKE = 0.99, 0.8
"""Least correlation with the force in the simulator; what the slave measures passes no codec and no control scheme."""

Found = dict[str, Any]


def reference(folder: Path, host: str, seconds: float, lenient: bool) -> Found:
    """The least loop of pylibfranka."""
    with simulated_robot(folder, host, lenient) as robot:
        command = [sys.executable, "-m", "tests.franka.reference", robot.host, str(seconds)]
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=seconds + 30.0)
        if done.returncode:
            return {"failed": done.stderr.strip().splitlines()[-1]}
        told = json.loads(done.stdout)
        return pace(robot.truth, told["began"], told["ended"]).to_dict()


def session(live: FrankaSession, seconds: float, laws: Laws) -> Found:
    """A minute of exploring the table."""
    with live:
        if live.wait_until_it_follows(FOLLOW_S) is None:
            failed = (live.wait_for_end(SLAVE, 0.0) or {}).get("outcome", "no session")
            laws.check("the arm follows the hand", False, failed)
            return {"failed": failed}
        began = monotonic()
        live.watch(seconds)
        ended = monotonic()
        slave, master = live.recorded(SLAVE, began), live.recorded(MASTER, began)
        found: Found = {"pace": pace(live.robot.truth, began, ended).to_dict()}
        rows = live.robot.truth.since(began)
        whole = len(slave) > 0 and slave["at"][-1] > ended - 0.5 and not rows["reflex"].any()
        said = "" if whole else (live.wait_for_end(SLAVE, 5.0) or {}).get("outcome", "")
        laws.check("no abort by the robot, and the slave runs to the end", whole, said)
        found["ticks"] = {
            side: {
                "missed": int(records["ticks_missed"][-1] - records["ticks_missed"][0]),
                "late_us": [float(x) for x in np.percentile(records["lateness_us"], [50, 99, 100])],
                "engaged": float((records["state"] == ENGAGED).mean()),
            }
            for side, records in ((MASTER, master), (SLAVE, slave))
            if len(records)
        }
        rows = rows[rows["moving"] == 1]  # after an abort the robot is on its own
        found["contact"] = contact(rows)
        forces = {MEASURED: (slave, "raw"), RECEIVED: (master, "decoded"), FELT: (master, "output")}
        found["forces"] = {
            name: asdict(likeness(rows, records["at"], records[field])) for name, (records, field) in forces.items()
        }
        found["said"] = said
    return found


def judge(found: Found, laws: Laws) -> None:
    """The laws of the minute."""
    share = found["pace"]["success"]
    laws.check(f"{SUCCESS:.0%} of the robot's cycles are answered", share >= SUCCESS, f"{share:.2%}")
    measured, felt = (found["forces"][name] for name in (MEASURED, FELT))
    laws.check(
        "the slave measures the table's force", measured["correlation"] >= ALIKE, f"{measured['correlation']:.3f}"
    )
    laws.check("the hand feels the table", felt["correlation"] >= FELT_ALIKE, f"{felt['correlation']:.3f}")


def faults(session_of: Callable[[], FrankaSession], names: list[str], laws: Laws) -> list[Outcome]:
    outcomes = []
    for name in names:  # a session each: what one leaves behind does not hide in the next
        with session_of() as live:
            outcome = inflict(name, live)
        outcomes.append(outcome)
        laws.check(f"fault: {name}", not outcome.broken, "; ".join(outcome.broken) or outcome.told)
    return outcomes


def table(found: Found) -> list[str]:
    lines = ["", "loop          success   lost  in a row  period p50/p99/max ms     robot p50/p99/max ms      commands"]
    live = found.get("session", {})
    for name, values in {"pylibfranka": found.get("reference"), "weberlink": live.get("pace", live or None)}.items():
        if values is None or "failed" in values:
            lines.append(f"{name:13} {'-' if values is None else values['failed']}")
            continue
        of = Pace(**values)
        period, robot = ("{:7.3f}{:8.3f}{:9.3f}".format(*spread) for spread in (of.period_ms, of.robot_ms))
        lines.append(
            f"{name:13} {of.success:7.2%} {of.lost:6} {of.lost_in_a_row:9}  {period:24}  {robot:24} {of.commands:8}"
        )
    if "contact" in live:
        touched = live["contact"]
        lines += [
            "",
            "table: {times} contacts, {seconds:.1f} s, up to {most_n:.1f} N".format(**touched),
            "force                     lag ms  correlation   gain  error N RMS  largest N",
        ]
        for name, values in live["forces"].items():
            each = Likeness(**values)
            lines.append(
                f"{name:24} {each.lag_ms:7.0f} {each.correlation:12.3f} {each.gain:6.2f} {each.error_n:12.2f}"
                f" {each.most_n:10.1f}"
            )
    if found["faults"]:
        lines += ["", "fault                     rest s  travel mm  speed rad/s  force N  follows again s"]
    for each in found["faults"]:
        rest, back = (f"{each[key]:.2f}" if each[key] is not None else "-" for key in ("rest_s", "back_s"))
        lines.append(
            f"{each['fault']:24} {rest:>7}  {1e3 * each['travel_m']:9.1f}  {each['speed_rad_s']:11.2f}"
            f"  {each['force_n']:7.1f}  {back:>15}  {each['told']}"
        )
    return lines


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument(
        "--seconds", type=float, default=60.0, help="of the session, and a sixth of it for pylibfranka's"
    )
    parser.add_argument("--faults", nargs="*", choices=[*FAULTS], default=[*FAULTS], metavar="KIND", help="only these")
    parser.add_argument("--faults-only", action="store_true", help="no minute and no reference")
    parser.add_argument("--lenient", action="store_true", help="lost cycles do not stop the robot: for a busy machine")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="of configs/franka.yaml")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", type=Path, metavar="OUT")
    arguments = parser.parse_args()
    laws, host = Laws(), own_address()
    facts = environment() | {"simulator": {name: version(name) for name in PACKAGES}}
    found: Found = {"seed": arguments.seed, "lenient": arguments.lenient, "set": arguments.set, "environment": facts}
    with tempfile.TemporaryDirectory(prefix="weberlink-franka-") as name:
        folder = Path(name)
        settings = (folder, host, arguments.seed, arguments.lenient, arguments.set)
        session_of = partial(FrankaSession, *settings)
        if not arguments.faults_only:
            found["reference"] = reference(folder, host, arguments.seconds / 6.0, arguments.lenient)
            found["session"] = session(session_of(), arguments.seconds, laws)
            if "failed" not in found["session"]:
                judge(found["session"], laws)
        outcomes = faults(session_of, arguments.faults, laws)
    found["faults"] = [outcome.to_dict() for outcome in outcomes]
    found["broken"] = laws.broken
    simulator = ", ".join(f"{name} {number}" for name, number in facts["simulator"].items())
    write("\n".join([*table(found), "", f"{footer(facts, arguments.seed)}; {simulator}"]))
    if arguments.json is not None:
        arguments.json.parent.mkdir(parents=True, exist_ok=True)
        arguments.json.write_text(json.dumps(found, indent=1), encoding="utf-8")
    return 1 if laws.broken else 0


if __name__ == "__main__":
    sys.exit(main())
