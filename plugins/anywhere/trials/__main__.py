"""`python -m plugins.anywhere.trials`: two hosts behind NATs of every kind meet, and their paths fail in contact.

Runs the commands of docs/anywhere.md in the network namespaces of `plugins.anywhere.tests.testbed`, with the shipped
file, relay and mailbox. `--rows nat,cut` runs these rows only, `--nats cone,symmetric` these kinds; `--json OUT`
writes the figures. Prints tables in 80 columns, leaves nothing behind, also when it is interrupted, and exits with
status 1 if a promise was broken.
"""

import argparse
import json
import signal
import sys
from dataclasses import asdict
from functools import partial
from pathlib import Path
from types import FrameType
from typing import Any

from plugins.anywhere.tests.namespaces import missing
from plugins.anywhere.tests.testbed import NATS
from plugins.anywhere.trials.faults import FAULTS, inflict
from plugins.anywhere.trials.laws import Laws, write
from plugins.anywhere.trials.scene import nat_row, readme_row
from weberlink_figures.environment import environment, footer

ATTEMPTS = 3  # A row in which the host itself stood still says nothing, and is tried again
HEADING = f"\n{'in contact':32} {'away ms':>7} {'back':>6} {'force':>6} {'robot':>6} {'step N':>6}"


def fault_row(name: str, laws: Laws) -> dict[str, Any]:
    fault = FAULTS[name]
    for attempt in range(ATTEMPTS):
        found, broken = inflict(fault)
        if found is None or not broken or not any("stalled" in faults for faults in found.faults):
            break
        write(f"       the host stood still (attempt {attempt + 1}); again")
    if found is not None:
        back = "-" if found.back_ms is None else f"{found.back_ms:.0f}"
        times = f"{found.away_ms:7.0f} {back:>6} {found.force_ms:6.0f} {found.robot_ms:6.0f}"
        write(f"{fault.meaning:32} {times} {found.step_n:6.3f}")
    effects = sorted({name for side in found.faults for name in side}) if found is not None else []
    laws.check(f"{name}: promises kept", not broken, "; ".join(broken) or ", ".join(effects) or "no fault")
    return {"figures": None if found is None else asdict(found), "broken": broken}


def interrupted(number: int, frame: FrameType | None) -> None:
    """Unwind once; what is cleaned up then is not interrupted again."""
    for each in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(each, signal.SIG_IGN)
    raise KeyboardInterrupt


def main() -> int:
    names = ("nat", "readme", *FAULTS)
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n\n")[2])
    parser.add_argument("--rows", default=",".join(names), help=f"some of {', '.join(names)}")
    parser.add_argument("--nats", default=",".join(NATS), help=f"of the row nat, some of {', '.join(NATS)}")
    parser.add_argument("--json", type=Path, metavar="OUT", help="where to write the figures")
    arguments = parser.parse_args()
    chosen, kinds = (tuple(words.split(",")) for words in (arguments.rows, arguments.nats))
    if unknown := {*chosen, *kinds} - {*names, *NATS}:
        parser.error(f"no such row or kind: {', '.join(sorted(unknown))}; there are {', '.join((*names, *NATS))}")
    if missing():
        write(f"skipped: {missing()}")
        return 0
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, interrupted)
    laws, found = Laws(), {}
    rows = {"nat": partial(nat_row, kinds=kinds), "readme": readme_row}
    try:
        for name in chosen:
            if name in FAULTS and not set(found) & set(FAULTS):
                write(HEADING)
            try:
                found[name] = (rows.get(name) or partial(fault_row, name))(laws)
            except (OSError, RuntimeError, ValueError) as error:  # the next row goes on
                laws.check(f"{name} ends", False, f"{type(error).__name__}: {error}")
    except KeyboardInterrupt:
        write("interrupted; all is cleaned up")
        return 130
    write(f"\n{len(laws.broken)} broken")
    write(footer(environment()))
    if arguments.json is not None:
        document = {"environment": environment(), "rows": found, "broken": laws.broken}
        arguments.json.write_text(json.dumps(document, indent=2) + "\n", encoding="utf-8")
    return 1 if laws.broken else 0


if __name__ == "__main__":
    sys.exit(main())
