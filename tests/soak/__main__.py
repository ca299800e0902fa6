"""`python -m tests.soak --minutes 60`: soaks, shows a status line, writes JSON; exit status 1 if a law was violated."""

import argparse
import json
import sys
from contextlib import suppress
from pathlib import Path
from signal import SIG_IGN, SIGHUP, SIGINT, SIGTERM, Signals, signal
from time import monotonic
from types import FrameType

from tests.soak.faults import FAULTS
from tests.soak.report import Report
from tests.soak.rig import SILENCE_MS, RigError
from tests.soak.soak import Soak
from weberlink.system.environment import environment, footer

STOP_SIGNALS = (SIGHUP, SIGINT, SIGTERM)
LINE_EVERY_S = 60.0
"""Between two status lines where there is no terminal."""


class Status:
    """One line that is written over, or a line a minute where nobody looks."""

    def __init__(self) -> None:
        self._on_terminal = sys.stdout.isatty()
        self._told_at = -LINE_EVERY_S

    def __call__(self, report: Report, fault: str, left: float) -> None:
        if not self._on_terminal and monotonic() - self._told_at < LINE_EVERY_S:
            return
        self._told_at = monotonic()
        done = sum(kind.count for kind in report.kinds.values())
        text = f"{max(0.0, left):5.0f} s left, {done} faults, {len(report.failures())} violations; now: {fault}"
        write(f"\r\x1b[2K{text}" if self._on_terminal else f"{text}\n")


def write(text: str) -> None:
    """To a terminal that may have gone away meanwhile."""
    with suppress(OSError):
        sys.stdout.write(text)
        sys.stdout.flush()


class StoppedError(Exception):
    """Somebody wants it to end; what was seen until then is told."""


def stop(number: int, _frame: FrameType | None) -> None:
    for other in STOP_SIGNALS:  # tidying up takes a moment, and is not to be broken off
        signal(other, SIG_IGN)
    raise StoppedError(f"ended early by {Signals(number).name}")


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument(
        "--minutes", type=float, default=60.0, help="3 or less: every fault once, and as short as can be"
    )
    parser.add_argument("--faults", nargs="+", choices=[*FAULTS], default=[*FAULTS], metavar="KIND", help="only these")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--silence-ms", type=float, default=SILENCE_MS, help="limit of silence of the session")
    parser.add_argument("--json", type=Path, metavar="OUT")
    arguments = parser.parse_args()
    for number in STOP_SIGNALS:
        signal(number, stop)
    soak = Soak(arguments.minutes, arguments.seed, Status(), arguments.silence_ms, arguments.faults)
    began = monotonic()
    try:
        soak.run()
    except (RigError, StoppedError) as error:
        soak.report.violations.append(str(error))
    facts = environment()
    lines = [*soak.report.lines(), f"{monotonic() - began:.0f} s; {footer(facts, arguments.seed)}"]
    write("\n" + "\n".join(lines) + "\n")
    if arguments.json is not None:
        told = soak.report.to_dict() | {"environment": facts}
        arguments.json.write_text(json.dumps(told, indent=1, default=float), encoding="utf-8")
    return 1 if soak.report.failures() else 0


if __name__ == "__main__":
    sys.exit(main())
