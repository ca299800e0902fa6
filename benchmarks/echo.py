"""An echo between two processes: how the asking and the answering process are started, and what they say.

Each is a module of this package that is run with an order as JSON. The answering one prints its port and, at the end,
its moments; the asking one prints its moments. All moments are of the monotonic clock of this host [ns].
"""

import json
import os
import subprocess
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from time import monotonic
from typing import Any

import numpy as np

from benchmarks.arrangement import BenchError, module
from benchmarks.percentiles import Series
from benchmarks.rights import Rights

WARM_UP_S = 0.3
"""Of questions that do not count."""
PATIENCE_S = 60.0
ASK, ANSWER = "ask", "answer"


@dataclass(frozen=True)
class Trips:
    """Of each question that was answered: there, back, and both [us]."""

    there_us: Series
    back_us: Series
    round_us: Series


def measure(name: str, order: Mapping[str, Any], rate_hz: float, duration_s: float, rights: Rights) -> Trips:
    """Run a pair of processes.

    Args:
        name: of the module.
        order: what else it is to know.
        rate_hz: of questions [Hz].
        duration_s: of those that count [s].
        rights: of both processes; those of the master for who asks.

    Raises:
        BenchError: if one of them fails.
    """
    common = dict(order) | {
        "rate_hz": rate_hz,
        "questions": max(1, round(rate_hz * duration_s)),
        "warm_up": round(rate_hz * WARM_UP_S),
        "rights": asdict(rights),
        "parent": os.getpid(),
        "epoch": monotonic(),
    }
    with ExitStack() as stack:
        answering = _start(name, common | {"end": ANSWER}, stack)
        assert answering.stdout is not None
        port = answering.stdout.readline().strip()
        if not port.isdigit():
            raise BenchError(f"{name}: the answering process did not start")
        asking = _start(name, common | {"end": ASK, "port": int(port)}, stack)
        try:
            asked = asking.communicate(timeout=2.0 * duration_s + PATIENCE_S)[0]
            answered = answering.communicate(timeout=PATIENCE_S)[0]
        except subprocess.TimeoutExpired:
            raise BenchError(f"{name}: did not come to an end") from None
    if asking.returncode or answering.returncode:
        raise BenchError(f"{name}: a process failed")
    return join(json.loads(asked), json.loads(answered), common["warm_up"])


def join(asked: Mapping[str, list[int]], answered: Mapping[str, list[int]], warm_up: int) -> Trips:
    """The trips of the questions that both ends know of.

    Args:
        asked: by number of the question, when it began and when its answer was there [ns].
        answered: by number, when it was there and when its answer began [ns].
        warm_up: so many numbers from the first one on do not count.
    """
    first = min(map(int, asked), default=0) + warm_up
    numbers = [number for number in sorted(asked.keys() & answered.keys(), key=int) if int(number) >= first]
    if not numbers:
        raise BenchError("echo: no question was answered")
    moments = np.array([[*asked[number], *answered[number]] for number in numbers], dtype=np.float64)
    began, ended, there, back = moments.T * 1e-3
    return Trips(there - began, ended - back, ended - began)


def _start(name: str, order: Mapping[str, Any], stack: ExitStack) -> subprocess.Popen[str]:
    process = subprocess.Popen(  # noqa: S603
        module(name, json.dumps(order)), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True
    )
    stack.callback(_end, process)
    return process


def _end(process: subprocess.Popen[str]) -> None:
    process.kill()
    if process.stdout is not None and not process.stdout.closed:
        process.communicate()
