"""Failures made on purpose, and what the report says of each: rows of the table in docs/operation/logs.md."""

import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from math import inf
from pathlib import Path
from typing import Any

import pytest

from tests.program import ROOT, document
from tests.safety.observed_link import ObservedLink, observed
from tests.system.systems import CONFIGS, configuration
from weberlink.protocol.emulation import Emulation
from weberlink.system.composition.channels import banks
from weberlink.system.scoring.session import SessionScore
from weberlink.system.simulate import simulate
from weberlink.system.verdict import verdict

TIMES = r"(?:once|\d+ times)"
PAGE = (ROOT / "docs" / "operation" / "logs.md").read_text(encoding="utf-8")
LOOPBACK = CONFIGS / "loopback.yaml"


@dataclass(frozen=True)
class Row:
    """What a run reported, or what the page says of it: the verdict in one line, and the exit status."""

    line: str
    status: int
    errors: str = ""


def table() -> dict[str, Row]:
    """The rows of the page by what was done."""
    rows = re.findall(r"^\| (.+?) \| `((?:good|degraded|failed)[^`]*)` \| (\d) \|$", PAGE, re.M)
    return {done: Row(line, int(status)) for done, line, status in rows}


ROWS = table()


def report(ended: tuple[int, str, str]) -> Row:
    """What a program said at its end."""
    status, output, errors = ended
    told = document(output)["verdict"]
    return Row(f"{told['word']} because {'; '.join(each['text'] for each in told['causes'])}", status, errors)


# --- in virtual time


def of(summary: dict[str, Any]) -> Row:
    return Row(verdict(summary).line, summary["status"])


def virtual(*overrides: str, file: str = "loopback.yaml", duration: float = 3.0) -> Row:
    return of(simulate(configuration(*overrides, file=file), duration)[0])


def cut(for_s: float, *, to_slave: bool = True) -> Row:
    """The link carries nothing in one direction from 2 s on; a run of 6 s, which the master ends in order."""
    loaded = configuration()
    score = SessionScore(loaded.system.rate_hz, *banks(loaded.system))
    links = ObservedLink(Emulation(blackouts=((2.0, for_s),))), ObservedLink()
    observed(loaded, *(links if to_slave else links[::-1])).run(6.0, [score])
    summary = score.summary() | {"outcome": "completed"}
    return of(summary | {"status": verdict(summary).status})


def full_disk(folder: Path) -> Row:
    """A file may grow to 200 kB, which stops the recorder as a full disk does."""
    command = [sys.executable, "-m", "weberlink", "simulate", LOOPBACK, "--duration", "3", "--json", "-"]
    limited = ["prlimit", "--fsize=200000", *command, "--record", folder / "full.mcap"]
    done = subprocess.run(limited, cwd=ROOT, capture_output=True, text=True, check=False)
    return report((done.returncode, done.stdout, done.stderr))


VIRTUAL: dict[str, Callable[[Path], Row]] = {
    "no room for the recording": full_disk,
    "30 % of the datagrams lost": lambda _: virtual("link.emulate={loss: 0.3, seed: 3}"),
    "60 ms of delay": lambda _: virtual("link.emulate={delay_ms: 30, seed: 3}", "control.scheme=none"),
    "a contact stronger than `slave.limits.trip_n`": lambda _: virtual("slave.limits.trip_n=3"),
    "a scene stiffer than `master.limits.force_n`": lambda _: virtual("master.limits.force_n=0.5"),
    "the link cut in one direction for 2 s": lambda _: cut(2.0),
    "the link cut in one direction until the end": lambda _: cut(inf),
    "nothing": lambda _: virtual(),
}


def same(said: Row, written: Row) -> None:
    """The word, every cause of the page, and the status; numbers may differ, and the host may add causes and stalls."""

    def shape(line: str) -> str:
        line = re.sub(rf"the (?:master|slave) {TIMES}(?: and the slave {TIMES})?,", "a process,", line)
        return re.sub(r"(?:127\.0\.0\.1:)?\d+(?:\.\d+)?", "#", line)

    word, _, causes = written.line.partition(" because ")
    assert said.line.split()[0] == word, said
    for cause in filter(None, causes.split("; ")):
        assert shape(cause) in shape(said.line), said
    assert said.status == written.status, said


@pytest.mark.parametrize("done", VIRTUAL)
def test_report_in_virtual_time_is_as_written(done: str, tmp_path: Path) -> None:
    same(VIRTUAL[done](tmp_path), ROWS[done])
