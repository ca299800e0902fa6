"""The runs of the models, and how spin and the C compiler execute one."""

import re
import shutil
import subprocess
import time
from dataclasses import dataclass
from pathlib import Path

FOLDER = Path(__file__).parent
DEPTH = 2_000_000
"""Longest path that the search follows [steps]; a run that reaches it does not count as exhaustive."""
PATIENCE = 300.0
"""Longest time that one run may take [s]."""


@dataclass(frozen=True)
class Run:
    """One verification.

    Args:
        name: shown in the table.
        model: file without its suffix.
        defines: switches of the model.
    """

    name: str
    model: str
    defines: tuple[str, ...] = ()


@dataclass(frozen=True)
class Found:
    """The result of a run; `failure` is the assertion that does not hold, "" if all do."""

    failure: str
    is_exhaustive: bool
    states: int
    depth: int
    seconds: float

    @property
    def holds(self) -> bool:
        return not self.failure


SMALL = ("LIMIT=2", "EXPIRE=1")
WRAPS = (*SMALL, "WRAP=9", "ECHO_WRAP=9")

PASSING = (
    Run("link: loss, delay, one-way cuts, limit of 3", "link"),
    Run("link: two datagrams held in each direction", "link", (*SMALL, "SLOTS=2")),
    Run("link: replay, processes that stop", "link", (*SMALL, "REPLAYS=1", "STOPS=1")),
    Run("link: ticks that stop", "link", (*SMALL, "TICKS=1")),
    Run("link: datagrams held until stamps and echoes wrap", "link", WRAPS),
    Run("limits: an agreed round trip, held datagrams", "limits", ("CHECK=10",)),
    Run("limits: the round trip changes", "limits", ("CHECK=10", "CHANGES=1", "SESSIONS=1")),
    Run("authority: two masters, two slaves, all recorded", "authority"),
)

FORMER = (
    Run("link: age of what is taken, asymmetric path", "link", ("PROTOCOL=0", "CHECK=1")),
    Run("link: age of what is taken, stamps wrap", "link", ("PROTOCOL=0", "CHECK=1", "ERROR=0", "WRAP=9")),
    Run("link: age of what drives", "link", ("PROTOCOL=0", "CHECK=2")),
    Run("link: one end alone", "link", ("PROTOCOL=0", "CHECK=3")),
    Run("link: fade after a stop", "link", ("PROTOCOL=0", "CHECK=5", "STOPS=1")),
    Run("authority: takeover not asked for", "authority", ("PROTOCOL=0", "CHECK=1")),
    Run("authority: another slave", "authority", ("PROTOCOL=0", "CHECK=2")),
    Run("authority: an old HELLO is answered", "authority", ("PROTOCOL=0", "CHECK=3")),
)

MUTANTS = (
    Run("link 1: event loop says encoding without a tick", "link", (*SMALL, "TICKS=1", "MUTANT=1")),
    Run("link 2: loops look at the state alone", "link", (*SMALL, "MUTANT=2")),
    Run("link 3: session never expires", "link", (*WRAPS, "MUTANT=3")),
    Run("link 4: no replay window", "link", (*SMALL, "REPLAYS=1", "MUTANT=4")),
    Run("link 5: age by number is not asked", "link", (*WRAPS, "MUTANT=5")),
    Run("link 6: loop age of an update is not asked", "link", (*SMALL, "MUTANT=6")),
    Run("link 7: newest by arrival, not by number", "link", (*SMALL, "MUTANT=7")),
    Run("link 8: no guardian", "link", (*SMALL, "STOPS=1", "MUTANT=8")),
    Run("link 9: pending session never expires", "link", (*WRAPS, "MUTANT=9")),
    Run("link 10: engaged while the other is heard", "link", (*SMALL, "MUTANT=10")),
    Run("limits 11: no limit of reception", "limits", ("CHECK=10", "MUTANT=11")),
    Run("limits 26: a session opens without its round trip", "limits", ("CHECK=10", "MUTANT=26")),
    Run("limits 29: an end drives while its session opens", "limits", ("CHECK=10", "MUTANT=29")),
    Run("authority 1: slave minds only a session that is heard", "authority", ("MUTANT=1",)),
    Run("authority 2: old HELLOs are answered", "authority", ("MUTANT=2",)),
    Run("authority 3: takeover without the flag", "authority", ("MUTANT=3",)),
    Run("authority 4: HELLO with take_over ends the session", "authority", ("MUTANT=4", "CHECK=3")),
    Run("authority 5: slave's name is not compared", "authority", ("MUTANT=5",)),
    Run("authority 6: other pending sessions outlive one", "authority", ("MUTANT=6",)),
    Run("authority 7: session never expires", "authority", ("MUTANT=7",)),
)


def missing_tool() -> str | None:
    """The first tool that is needed and not installed."""
    return next((tool for tool in ("spin", "gcc") if shutil.which(tool) is None), None)


def verify(run: Run, folder: Path, *, is_quick: bool = False) -> Found:
    """Search all states of a model until an assertion fails.

    Args:
        folder: where the verifier is made.
        is_quick: compile fast instead of well, for a search that fails soon.

    Raises:
        RuntimeError: with the output of the tool that failed.
    """
    began = time.monotonic()
    defines = [f"-D{define}" for define in run.defines]
    _output(["spin", "-a", *defines, str(FOLDER / f"{run.model}.pml")], folder)
    level = "-O0" if is_quick else "-O2"
    _output(["gcc", level, "-w", "-DSAFETY", "-DNOFAIR", "-DMEMLIM=3000", "-o", "pan", "pan.c"], folder)
    output = _output(["./pan", f"-m{DEPTH}", "-n"], folder)
    failure = re.search(r"assertion violated (.*) \(at depth", output)
    states, depth = re.search(r"(\d+) states, stored", output), re.search(r"depth reached (\d+)", output)
    if states is None or depth is None or ("errors: 0" not in output and failure is None):
        raise RuntimeError(output)
    return Found(
        failure=failure[1] if failure else "",
        is_exhaustive="errors: 0" in output and "max search depth too small" not in output and "out of" not in output,
        states=int(states[1]),
        depth=int(depth[1]),
        seconds=time.monotonic() - began,
    )


def _output(command: list[str], folder: Path) -> str:
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=PATIENCE, check=False)
    if done.returncode:
        raise RuntimeError(f"{' '.join(command)}: {done.stdout}{done.stderr}")
    return done.stdout + done.stderr
