"""Run every model and print what spin found: `make model`."""

import re
import shutil
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

FOLDER = Path(__file__).parent
DEPTH = 2_000_000  # longest path that the search follows [steps]; a run that reaches it does not count as exhaustive
PATIENCE = 300.0  # longest time that one run may take [s]


@dataclass(frozen=True)
class Run:
    name: str  # shown in the table
    model: str  # file without its suffix
    defines: tuple[str, ...] = ()  # switches of the model


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


SMALL = ("LONGEST=1",)
DEAF = ("LONGEST=0", "EXPIRE=8")
TOO_LONG = (*SMALL, "EXPIRE=3", "CHECK=4")
ONE_SESSION = ("CHANGES=1", "SESSIONS=1")
TOO_YOUNG = (*ONE_SESSION, "CHECK=10", "ERROR=1")
CHANGING = (*ONE_SESSION, "LIMIT=1", "LONGEST=2", "GOOD=5")
CHANGING_LITTLE = (*ONE_SESSION, "LIMIT=1", "LONGEST=1")
CHANGING_MUCH = (*ONE_SESSION, "LIMIT=1", "LONGEST=3", "CHECK=10")
CHANGING_IN_SILENCE = (*CHANGING, "CHECK=10", "EXPIRE=3")
WRAPS = (*CHANGING_LITTLE, "WRAP=8")
ANSWERS_LOST = (*SMALL, *ONE_SESSION, "DELAY=1", "CHECK=4")
LONG_PATH = ("DELAY=3", "SLOTS=3", "LONGEST=6", "HOSTILE=0", "GOOD=30", "CHECK=4")
PATH_CHANGES = ("DELAY=2", "SLOTS=2", "LONGEST=4", "LIMIT=1", "CHANGES=1", "HOSTILE=0", "PACE=0", "CHECK=4")
FORMERLY = ("PROTOCOL=0", "LIMIT=3", "LONGEST=0")

PASSING = (
    Run("link: loss, delay, one-way cuts", "link", ("GOOD=5",)),
    Run("link: limit of 3", "link", ("LIMIT=3", "LONGEST=1", "EXPIRE=2")),
    Run("link: two datagrams held in each direction", "link", (*SMALL, "SLOTS=2")),
    Run("link: long silence", "link", DEAF),
    Run("link: path too long for a while", "link", TOO_LONG),
    Run("link: R changes", "link", CHANGING),
    Run("link: R changes, any number of sessions", "link", (*CHANGING, "SESSIONS=0")),
    Run("link: R changes, datagrams held until stamps and echoes wrap", "link", WRAPS),
    Run("link: R changes, replay", "link", (*CHANGING, "REPLAYS=1")),
    Run("link: R changes, processes that stop", "link", (*CHANGING, "STOPS=1")),
    Run("link: R changes, ticks that stop", "link", (*CHANGING_LITTLE, "TICKS=1")),
    Run("link: R changes, two datagrams held", "link", (*CHANGING, "CHECK=10", "SLOTS=2")),
    Run("link: R changes, silence of 3 until the end", "link", CHANGING_IN_SILENCE),
    Run("link: R changes, limit of 2", "link", (*ONE_SESSION, "CHECK=10")),
    Run("link: R changes, limit of 2, datagrams seem younger by 1", "link", TOO_YOUNG),
    Run("link: R changes up to three limits", "link", CHANGING_MUCH),
    Run("link: long path", "link", LONG_PATH),
    Run("link: path changes, R follows", "link", PATH_CHANGES),
    Run("link: path changes, R follows, limit of 2", "link", (*PATH_CHANGES, "LIMIT=2")),
    Run("link: R agreed with losses, then delay of 1", "link", ANSWERS_LOST),
    Run(
        "link: R agreed with losses, then delays to 3",
        "link",
        (*ONE_SESSION, "DELAY=3", "SLOTS=3", "HOLDS=1", "CHECK=4"),
    ),
    Run("authority: two masters, two slaves, all recorded", "authority"),
    Run("streams: lost apart, interruptions", "streams"),
    Run("streams: one of each end", "streams", ("WAYS=2",)),
    Run("streams: limit of 3", "streams", ("LIMIT=3",)),
    Run("streams: one of each end, limit of 3", "streams", ("WAYS=2", "LIMIT=3")),
)

FORMER = (
    Run("link: age of what is taken, asymmetric path", "link", (*FORMERLY, "CHECK=1", "ERROR=1")),
    Run("link: age of what is taken, stamps wrap", "link", (*FORMERLY, "CHECK=1", "WRAP=9")),
    Run("link: age of what drives", "link", (*FORMERLY, "CHECK=2")),
    Run("link: one end alone", "link", (*FORMERLY, "CHECK=3")),
    Run("link: fade after a stop", "link", (*FORMERLY, "CHECK=5", "STOPS=1")),
    Run("authority: takeover not asked for", "authority", ("PROTOCOL=0", "CHECK=1")),
    Run("authority: another slave", "authority", ("PROTOCOL=0", "CHECK=2")),
    Run("authority: an old HELLO is answered", "authority", ("PROTOCOL=0", "CHECK=3")),
    Run("streams: who follows is not held", "streams", ("PROTOCOL=0", "CHECK=1")),
    Run("streams: one stream stands for both", "streams", ("PROTOCOL=0", "CHECK=2")),
    Run("streams: who returns does not know that it is shown", "streams", ("PROTOCOL=1", "WAYS=2", "CHECK=4")),
)

MUTANTS = (
    *(
        Run(f"link {number}: {fault}", "link", (*switches, f"MUTANT={number}"))
        for number, fault, switches in (
            (1, "event loop says encoding without a tick", (*CHANGING_LITTLE, "TICKS=1")),
            (2, "loops look at the state alone", CHANGING),
            (3, "session never expires", WRAPS),
            (4, "no replay window", (*CHANGING, "REPLAYS=1")),
            (5, "age by number is not asked", WRAPS),
            (6, "loop age of an update is not asked", TOO_YOUNG),
            (7, "newest by arrival, not by number", CHANGING),
            (8, "no guardian", (*CHANGING, "STOPS=1")),
            (9, "pending session never expires", WRAPS),
            (10, "engaged while the other is heard", CHANGING),
            (11, "no limit of reception", CHANGING),
            (12, "R does not extend the limit of the loop age", LONG_PATH),
            (13, "R does not extend the limit of freshness", LONG_PATH),
            (14, "freshness by the own R", CHANGING_MUCH),
            (15, "loop age of an update by the smaller R", CHANGING),
            (16, "no generation", CHANGING),
            (17, "generation is that of the last agreement", CHANGING),
            (18, "master changes R without the answer", CHANGING),
            (19, "next proposal at once", CHANGING),
            (20, "next proposal as soon as the slave has changed", CHANGING),
            (21, "next proposal without having heard the slave", CHANGING),
            (22, "pause counted from before the own change", CHANGING_MUCH),
            (23, "R above the longest", CHANGING),
            (24, "R falls by more than half", CHANGING_MUCH),
            (25, "session opens on a path too long", CHANGING),
            (26, "session opens without its round trip", CHANGING),
            (27, "pending session kept for the limit of reception", LONG_PATH),
            (28, "no time for the first round trip", LONG_PATH),
            (29, "an end drives while its session opens", CHANGING),
            (30, "session ends by loop age, not by silence", PATH_CHANGES),
            (31, "fade does not allow for R", LONG_PATH),
            (32, "a repeated proposal is not answered", ANSWERS_LOST),
            (33, "echo is repeated for ever", DEAF),
            (34, "path too long for a while ends the master", TOO_LONG),
            (35, "silent end keeps its update", CHANGING_IN_SILENCE),
        )
    ),
    Run("authority 1: slave minds only a session that is heard", "authority", ("MUTANT=1",)),
    Run("authority 2: old HELLOs are answered", "authority", ("MUTANT=2",)),
    Run("authority 3: takeover without the flag", "authority", ("MUTANT=3",)),
    Run("authority 4: HELLO with take_over ends the session", "authority", ("MUTANT=4", "CHECK=3")),
    Run("authority 5: slave's name is not compared", "authority", ("MUTANT=5",)),
    Run("authority 6: other pending sessions outlive one", "authority", ("MUTANT=6",)),
    Run("authority 7: session never expires", "authority", ("MUTANT=7",)),
    Run("streams 1: only the first stream is watched", "streams", ("MUTANT=1",)),
    Run("streams 2: a new update starts the time anew", "streams", ("MUTANT=2",)),
    Run("streams 3: an end follows at once after an interruption", "streams", ("MUTANT=3",)),
    Run("streams 4: an update of one stream stands for both", "streams", ("MUTANT=4",)),
    Run("streams 5: heartbeats stand for updates", "streams", ("MUTANT=5",)),
    Run("streams 6: what was heard before the interruption counts", "streams", ("WAYS=2", "MUTANT=6")),
)


def missing_tool() -> str | None:
    return next((tool for tool in ("spin", "gcc") if shutil.which(tool) is None), None)


def verify(run: Run, folder: Path, *, is_quick: bool = False) -> Found:
    """Search all states of a model until an assertion fails."""
    began = time.monotonic()
    defines = [f"-D{define}" for define in run.defines]
    _output(["spin", "-a", *defines, str(FOLDER / f"{run.model}.pml")], folder)
    level = "-O1" if is_quick else "-O2"
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
        ("former protocols: must fail", FORMER, False),
        ("present protocol with a fault put in: must fail", MUTANTS, False),
    ):
        say(f"--- {title}")
        for run in runs:
            with TemporaryDirectory() as folder:
                found = verify(run, Path(folder), is_quick=not passes)
            is_right = found.holds is passes and (found.is_exhaustive or not passes)
            result = "holds" if found.holds else f"fails: {found.failure}"
            figures = f"{found.states:9,d} {found.depth:8,d} {found.seconds:6.1f}"
            say(f"{run.name:64} {result[:22]:22} {figures}{'' if is_right else '  <-- WRONG'}")
            wrong += not is_right
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
