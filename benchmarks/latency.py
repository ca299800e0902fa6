"""One way of an update between two processes, beside that of the same bytes between two bare ones.

`coded_echo` are the ends with codec, endpoint and event loop, and `sealed_echo` those that only seal and open. Both are
measured twice: every sample is sent and answered at once, or both ends send what the deadbands of the file leave, and
the bare ones in the same ticks: then updates are rare, and the caches cold. An answering process prints its port and,
at its end, its moments; an asking one prints its moments. All moments are of the monotonic clock of this host [ns].
"""

from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from time import monotonic
from typing import Any

import numpy as np

from benchmarks.arrangement import MAIN_RATE_HZ, Arrangement, BenchError, Rights, answers, child
from benchmarks.percentiles import Series, ratios, summary

WAYS = ("position", "force")
"""From master to slave, and from slave to master."""
EVERY_SHARE = 0.25
"""Share of the duration for updates of every sample; the others are few, and take all of it."""
WARM_UP_S = 0.3
"""In which questions do not count."""
PATIENCE_S = 60.0
ASK, ANSWER = "ask", "answer"
SENT, CAME = "sent", "came"
HOST = "127.0.0.1"
SIZE = 48
"""Of a force update with history and tag, the longest of three axes [B]."""

Moments = dict[str, dict[int, int]]
"""When a datagram was begun here (`SENT`), and when one of the other end was open (`CAME`) [ns], by its number."""


@dataclass(frozen=True)
class OneWay:
    """Trip times of updates, and of the same bytes between bare processes [us], by way."""

    coded: Mapping[str, Series]
    sealed: Mapping[str, Series]

    def coded_us(self, name: str) -> float:
        """A percentile of the slower way [us]."""
        return max(value for way in WAYS if (value := summary(self.coded[way])[name]) is not None)

    def worst_ratio(self, name: str) -> float:
        """A percentile over that of the bare processes, of the worse way."""
        found = [ratios(summary(self.coded[way]), summary(self.sealed[way]))[name] for way in WAYS]
        return max(value for value in found if value is not None)

    def as_json(self) -> dict[str, Any]:
        coded, sealed = ({way: summary(each[way]) for way in WAYS} for each in (self.coded, self.sealed))
        return {
            "updates": {way: len(self.coded[way]) for way in WAYS},
            "weberlink_us": coded,
            "sealed_socket_us": sealed,
            "ratio_to_sealed": {way: ratios(coded[way], sealed[way]) for way in WAYS},
        }


@dataclass(frozen=True)
class Latency:
    """Of the updates that the file sends, and with a deadband of 0."""

    due: OneWay
    every: OneWay

    def as_json(self) -> dict[str, Any]:
        both = {"due": self.due.as_json(), "every": self.every.as_json()}
        return {"rate_hz": MAIN_RATE_HZ, "size_bytes": SIZE, **both}


def measure(arrangement: Arrangement, rights: Rights) -> Latency:
    order = {"file": str(arrangement.file), "overrides": arrangement.overrides(MAIN_RATE_HZ)}
    long_s = arrangement.duration_s
    return Latency(
        one_way(order, long_s, rights, every=False), one_way(order, EVERY_SHARE * long_s, rights, every=True)
    )


def one_way(order: Mapping[str, Any], duration_s: float, rights: Rights, *, every: bool) -> OneWay:
    """Measure updates, then the bare processes in the ticks that had one.

    Args:
        order: file and overrides.
        duration_s: of each of the two [s].
        rights: of all processes; those of the master for the asking one.
        every: whether every sample is sent; otherwise those that the deadbands of the file leave.
    """
    coded = exchange("coded_echo", {**order, "every": every}, duration_s, rights)
    began = min(number for moments in coded for number in moments[SENT])
    ticks = [[number - began for number in moments[SENT]] for moments in coded]
    sealed = exchange("sealed_echo", {"ticks": ticks, "every": every}, duration_s, rights)
    return OneWay(trips(*coded), trips(*sealed))


def exchange(module: str, order: Mapping[str, Any], duration_s: float, rights: Rights) -> tuple[Moments, Moments]:
    """Run an asking and an answering process of a module; their moments."""
    common = dict(order) | {
        "rate_hz": MAIN_RATE_HZ,
        "count": round(MAIN_RATE_HZ * (WARM_UP_S + duration_s)),
        "epoch": monotonic(),
    }
    with ExitStack() as stack:
        answering = stack.enter_context(child(module, common | {"end": ANSWER}, rights))
        assert answering.stdout is not None
        port = answering.stdout.readline().strip()
        if not port.isdigit():
            raise BenchError(f"{module}: the answering process did not start")
        asking = stack.enter_context(child(module, common | {"end": ASK, "port": int(port)}, rights))
        asked, answered = answers([asking, answering], 2.0 * duration_s + PATIENCE_S, module)
    return tuple(  # type: ignore[return-value]
        {what: {int(number): at for number, at in each.items()} for what, each in end.items()}
        for end in (asked, answered)
    )


def trips(asked: Moments, answered: Moments) -> dict[str, Series]:
    """The times [us] of the datagrams that both ends know, by way; those of the first `WARM_UP_S` do not count."""
    first = min((number for end in (asked, answered) for number in end[SENT]), default=0) + MAIN_RATE_HZ * WARM_UP_S
    found = {}
    for way, sender, receiver in zip(WAYS, (asked, answered), (answered, asked), strict=True):
        sent, came = sender[SENT], receiver[CAME]
        found[way] = np.array(
            [(came[number] - sent[number]) * 1e-3 for number in sent if number >= first and number in came]
        )
        if not len(found[way]):
            raise BenchError(f"one way: no {way} arrived")
    return found
