"""`python -m trials.franka`: the driver `franka` before franka-sim, a third party's simulator of an FR3.

Runs in the environment of `make franka`. A scripted hand leads the simulated arm through both daemons and a relay for a
minute at 1 kHz, with the robot's limits enforced: 20 lost cycles in a row stop it. Then every fault is done to an arm
that follows. Prints each law, writes JSON, and exits with status 1 if one was violated.
"""

import argparse
import json
import sys
import tempfile
from dataclasses import asdict
from functools import partial
from importlib.metadata import version
from pathlib import Path
from time import monotonic, sleep
from typing import Any

import numpy as np

from tests.laws import Laws
from trials.franka.faults import END_S, FAULTS, FrankaSession, inflict
from trials.franka.robot import likeness, own_address
from weberlink.config import MASTER, SIDES, SLAVE
from weberlink_figures.environment import environment, footer

PACKAGES = ("franka-sim", "pylibfranka", "mujoco", "numpy")
SUCCESS = 0.99
FORCES = {"measured by the slave": (SLAVE, "raw", 0.99), "at the hand": (MASTER, "output", 0.8)}
"""Records, and least correlation with the force in the simulator; what the slave measures passes no codec."""


def session(live: FrankaSession, seconds: float, laws: Laws) -> dict[str, Any]:
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
    laws.check(
        "no abort by the robot, and the slave runs to the end", is_whole, "" if is_whole else live.sides[SLAVE].outcome
    )
    rows = rows[rows["moving"] == 1]  # after an abort the robot is on its own
    share = float(rows["success"][rows["at"] > rows["at"][0] + 0.2].mean())
    laws.check(f"{SUCCESS:.0%} of the robot's cycles are answered", share >= SUCCESS, f"{share:.2%}")
    found = {"success": share, "lost_in_a_row": int(rows["lost"].max())}
    found["period_ms"] = np.percentile(1e3 * np.diff(rows["at"]), [50, 99, 100]).tolist()  # of the robot's own steps
    found["force_n"] = float(np.linalg.norm(rows["force"], axis=1).max())
    for name, (side, column, least) in FORCES.items():
        found[name] = likeness(rows, records[side]["at"], records[side][column])
        laws.check(f"the force {name} is the table's", found[name] >= least, f"{found[name]:.3f}")
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seconds", type=float, default=60.0, help="of the session; 0 for the faults alone")
    parser.add_argument("--faults", nargs="*", choices=[*FAULTS], default=[*FAULTS], metavar="KIND", help="only these")
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
        if chosen.seconds:
            with session_of() as live:
                found["session"] = session(live, chosen.seconds, laws)
        found["faults"] = []
        for fault in chosen.faults:  # a session each: what one leaves behind does not hide in the next
            with session_of() as live:
                outcome = inflict(fault, live)
            found["faults"].append(asdict(outcome))
            rest, back = (f"{each:.2f} s" if each is not None else "-" for each in (outcome.rest_s, outcome.back_s))
            figures = (
                f"at rest after {rest}, {1e3 * outcome.travel_m:.1f} mm, {outcome.force_n:.1f} N, follows after {back}"
            )
            told = filter(None, (*outcome.broken, outcome.told, figures))
            laws.check(f"fault: {fault}", not outcome.broken, "; ".join(told))
    found["broken"] = laws.broken
    simulator = ", ".join(f"{name} {number}" for name, number in facts["simulator"].items())
    print(f"{footer(facts, chosen.seed)}; {simulator}")
    if chosen.json is not None:
        chosen.json.parent.mkdir(parents=True, exist_ok=True)
        chosen.json.write_text(json.dumps(found, indent=1), encoding="utf-8")
    return 1 if laws.broken else 0


if __name__ == "__main__":
    sys.exit(main())
