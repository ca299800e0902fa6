"""`python -m trials.franka`: the driver `franka` before franka-sim, a third party's simulator of an FR3.

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
from dataclasses import asdict
from functools import partial
from importlib.metadata import version
from pathlib import Path
from time import monotonic, sleep
from typing import Any

from tests.laws import Laws
from tests.program import ENGAGED
from trials.franka.faults import END_S, FAULTS, FrankaSession, inflict
from trials.franka.robot import Found, SimulatedRobot, contact, likeness, own_address, pace, spread
from weberlink.config import MASTER, SIDES, SLAVE
from weberlink.figures.environment import environment, footer

PACKAGES = ("franka-sim", "pylibfranka", "mujoco", "numpy")
SUCCESS = 0.99
FORCES = {"measured by the slave": (SLAVE, "raw"), "received by the master": (MASTER, "decoded")} | {
    "at the hand": (MASTER, "output")
}
ALIKE = {"measured by the slave": 0.99, "at the hand": 0.8}
"""Least correlation with the force in the simulator; what the slave measures passes no codec and no control scheme."""
BRAKE = """
import json, sys
from time import monotonic
import numpy as np
import pylibfranka
robot = pylibfranka.Robot(sys.argv[1], pylibfranka.RealtimeConfig.kIgnore)
robot.automatic_error_recovery()
control = robot.start_torque_control()
state, _ = control.readOnce()
began = monotonic()
while monotonic() < began + float(sys.argv[2]):
    last = np.array(state.tau_J_d)
    step = np.clip(-2.0 * np.array(state.dq) - last, -0.99, 0.99)
    command = pylibfranka.Torques((last + step).tolist())
    control.writeOnce(command)
    state, _ = control.readOnce()
command.motion_finished = True
control.writeOnce(command)
print(json.dumps([began, monotonic()]))
"""
"""The least that pylibfranka can do, a loop that brakes the joints: what this machine and the simulator allow."""


def reference(robot: SimulatedRobot, seconds: float) -> Found:
    command = [sys.executable, "-c", BRAKE, robot.host, str(seconds)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=seconds + 30.0)
    if done.returncode:
        return {"failed": done.stderr.strip().splitlines()[-1]}
    return pace(robot, *json.loads(done.stdout))


def session(live: FrankaSession, seconds: float, laws: Laws) -> Found:
    """A minute of exploring the table, and its laws."""
    if live.seconds_until_it_follows() is None:
        laws.check("the arm follows the hand", False, said := live.sides[SLAVE].last_line)
        return {"failed": said}
    began = monotonic()
    sleep(seconds)
    ended = monotonic()
    records = {side: live.sides[side].records for side in SIDES}
    records = {side: each[each["at"] >= began] for side, each in records.items()}
    rows = live.robot.since(began)
    is_whole = len(records[SLAVE]) > 0 and records[SLAVE]["at"][-1] > ended - 0.5 and not rows["reflex"].any()
    if not is_whole:
        live.sides[SLAVE].ends(END_S)
    said = "" if is_whole else live.sides[SLAVE].outcome
    laws.check("no abort by the robot, and the slave runs to the end", is_whole, said)
    rows = rows[rows["moving"] == 1]  # after an abort the robot is on its own
    found = {
        "pace": pace(live.robot, began, ended),
        "said": said,
        "ticks": {
            side: {
                "missed": int(each["ticks_missed"][-1] - each["ticks_missed"][0]),
                "late_us": spread(each["lateness_us"]),
                "engaged": float((each["state"] == ENGAGED).mean()),
            }
            for side, each in records.items()
            if len(each)
        },
        "contact": contact(rows),
        "forces": {name: likeness(rows, records[side]["at"], records[side][at]) for name, (side, at) in FORCES.items()},
    }
    share = found["pace"]["success"]
    laws.check(f"{SUCCESS:.0%} of the robot's cycles are answered", share >= SUCCESS, f"{share:.2%}")
    for name, least in ALIKE.items():
        correlation = found["forces"][name]["correlation"]
        laws.check(f"the force {name} is the table's", correlation >= least, f"{correlation:.3f}")
    return found


def table(found: Found) -> list[str]:
    lines = ["", "loop          success   lost  in a row  period p50/p99/max ms     robot p50/p99/max ms      commands"]
    live = found.get("session", {})
    for name, of in {"pylibfranka": found.get("reference", {}), "weberlink": live.get("pace", live)}.items():
        if "success" not in of:
            lines.append(f"{name:13} {of.get('failed', '-')}")
            continue
        period, robot = ("{:7.3f}{:8.3f}{:9.3f}".format(*of[each]) for each in ("period_ms", "robot_ms"))
        head = f"{name:13} {of['success']:7.2%} {of['lost']:6} {of['lost_in_a_row']:9}"
        lines.append(f"{head}  {period:24}  {robot:24} {of['commands']:8}")
    if "contact" in live:
        lines += ["", "table: {times} contacts, {seconds:.1f} s, up to {most_n:.1f} N".format(**live["contact"])]
        lines.append("force                     lag ms  correlation   gain  error N RMS  largest N")
        form = "{name:24} {lag_ms:7.0f} {correlation:12.3f} {gain:6.2f} {error_n:12.2f} {most_n:10.1f}"
        lines += [form.format(name=name, **of) for name, of in live["forces"].items()]
    lines += ["", "fault                     rest s  travel mm  speed rad/s  force N  follows again s"]
    for each in found["faults"]:
        rest, back = (f"{each[key]:.2f}" if each[key] is not None else "-" for key in ("rest_s", "back_s"))
        figures = f"{1e3 * each['travel_m']:9.1f}  {each['speed_rad_s']:11.2f}  {each['force_n']:7.1f}"
        lines.append(f"{each['fault']:24} {rest:>7}  {figures}  {back:>15}  {each['told']}")
    return lines


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument(
        "--seconds", type=float, default=60.0, help="of the session, and a sixth of it for pylibfranka's"
    )
    parser.add_argument("--faults", nargs="*", choices=[*FAULTS], default=[*FAULTS], metavar="KIND", help="only these")
    parser.add_argument("--faults-only", action="store_true", help="no minute and no reference")
    parser.add_argument("--lenient", action="store_true", help="lost cycles do not stop the robot: for a busy machine")
    parser.add_argument(
        "--set", action="append", default=[], metavar="KEY=VALUE", help="of plugins/franka/configs/franka.yaml"
    )
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", type=Path, metavar="OUT")
    chosen = parser.parse_args()
    laws, host = Laws(), own_address()
    facts = environment() | {"simulator": {name: version(name) for name in PACKAGES}}
    found: dict[str, Any] = {"seed": chosen.seed, "lenient": chosen.lenient, "set": chosen.set, "environment": facts}
    with tempfile.TemporaryDirectory(prefix="weberlink-franka-") as name:
        session_of = partial(FrankaSession, Path(name), host, chosen.seed, chosen.lenient, chosen.set)
        if not chosen.faults_only:
            with SimulatedRobot(Path(name), host, chosen.lenient) as robot:
                found["reference"] = reference(robot, chosen.seconds / 6.0)
            with session_of() as live:
                found["session"] = session(live, chosen.seconds, laws)
        found["faults"] = []
        for fault in chosen.faults:  # a session each: what one leaves behind does not hide in the next
            with session_of() as live:
                outcome = inflict(fault, live)
            found["faults"].append(asdict(outcome))
            laws.check(f"fault: {fault}", not outcome.broken, "; ".join(outcome.broken) or outcome.told)
    found["broken"] = laws.broken
    simulator = ", ".join(f"{name} {number}" for name, number in facts["simulator"].items())
    print(*table(found), "", f"{footer(facts, chosen.seed)}; {simulator}", sep="\n")
    if chosen.json is not None:
        chosen.json.parent.mkdir(parents=True, exist_ok=True)
        chosen.json.write_text(json.dumps(found, indent=1), encoding="utf-8")
    return 1 if laws.broken else 0


if __name__ == "__main__":
    sys.exit(main())
