"""Run every model and print what spin found: `make model`."""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from trials.model.spin import FORMER, MUTANTS, PASSING, Run, missing_tool, verify


def say(line: str) -> None:
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


def main() -> int:
    if tool := missing_tool():
        say(f"{tool} is not installed: make system")
        return 1
    wrong = 0
    say(f"{'run':64} {'result':22} {'states':>9} {'depth':>8} {'s':>6}")
    for title, runs, passes in (
        ("present protocol: must hold", PASSING, True),
        ("protocol as of 3a86b41: must fail", FORMER, False),
        ("present protocol with a fault put in: must fail", MUTANTS, False),
    ):
        say(f"--- {title}")
        for run in runs:
            wrong += _report(run, passes=passes)
    return 1 if wrong else 0


def _report(run: Run, *, passes: bool) -> bool:
    with TemporaryDirectory() as folder:
        found = verify(run, Path(folder), is_quick=not passes)
    is_right = found.holds is passes and (found.is_exhaustive or not passes)
    result = "holds" if found.holds else f"fails: {found.failure}"
    say(
        f"{run.name:64} {result[:22]:22} {found.states:9,d} {found.depth:8,d} {found.seconds:6.1f}"
        f"{'' if is_right else '  <-- WRONG'}"
    )
    return not is_right


if __name__ == "__main__":
    sys.exit(main())
