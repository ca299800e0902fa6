"""Measures in a child process the link to the slave, in a session that moves nothing.

Every end answers a question at once, whatever else it does. So the measurement needs no other program at the slave, and
its datagrams are as long and as well protected as those of the session. Each answer tells the delay of both directions,
and the numbers of the slave's datagrams tell whether a question or its answer was lost.

The child is a master without a device. It says that its encoder does not run, so the slave's robot stays at rest.
Run as a program, this file is that child and writes a JSON result to standard output.
"""

import asyncio
import json
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from time import monotonic
from typing import Any, NamedTuple

import uvloop

from weberlink.config import MASTER, Configuration, ConfigurationError, load
from weberlink.config.finders import PathFinder, finder_of, finding
from weberlink.protocol import Endpoint, PeerClosed, PeerSilent, Refused, State
from weberlink.protocol.aio.udp import TIMER_STEP_S, UdpShell
from weberlink.protocol.wire import TOKEN_BYTES
from weberlink.realtime.process import prepare
from weberlink.session.composition.link import build_endpoint, live_context
from weberlink.session.daemon import emulated_link
from weberlink_doctor.host.trial import run_child

PERIOD_S = 0.005
"""Between two questions: as dense as the updates of a busy session."""
WARM_UP_S = 1.0
"""From the session's beginning to the first question, in which the ends map their clocks."""
ANSWER_S = 5.0
"""Longest time until the slave answers a call."""
PATH_S = 40.0
"""Longest time until a path is found."""


class Heard(NamedTuple):
    """An authentic datagram of the slave: number of the session, from 0; its own number; arrival [s]; the question that
    it answers, None for any other datagram; delay from the slave to here by the mapped clocks [s], None while
    unknown."""

    session: int
    sequence: int
    at: float
    question: int | None
    delay: float | None


@dataclass(frozen=True, slots=True)
class LinkTrial:
    """What a measurement recorded; times on the clock of the master [s]."""

    asked: Sequence[float] = ()  # departure of each question
    heard: Sequence[Heard] = ()  # all of the slave; before the first question they tell only how the numbers go on
    jitters: Sequence[float] = ()  # as the endpoint measured it, in order
    silences: int = 0  # how often the session fell silent, at the limit of the file
    paths: list[dict[str, Any]] = field(default_factory=list)  # in use at the end
    priority: str = ""  # what came of real-time rights
    failure: str | None = None  # why there is no result


class Measurement:
    """What a master without a device does: call, wait, ask for so many seconds, and wait for the last answers."""

    def __init__(self, endpoint: Endpoint, now: float, seconds: float, patience: float = ANSWER_S) -> None:
        self._endpoint = endpoint
        self._seconds = seconds
        self._give_up_at = now + patience
        self._patience = patience
        self._first_at: float | None = None
        self._due = now
        self._jitters: list[float] = []
        self._silences = 0
        self._asked: list[float] = []
        self._heard: list[Heard] = []
        self.failure: str | None = None
        self.is_done = False
        endpoint.report_encoding(now, is_encoding=False)
        endpoint.on_heard = self._on_heard
        endpoint.connect(now)

    def _on_heard(self, sequence: int, now: float, token: bytes) -> None:
        number = int.from_bytes(token, "big") if token else len(self._asked)
        question = number if number < len(self._asked) else None
        endpoint = self._endpoint
        self._heard.append(Heard(endpoint.sessions - 1, sequence, now, question, endpoint.clock.one_way))

    def service(self, now: float) -> float:
        """Do what is due; returns when to be called again [s]."""
        endpoint, clock = self._endpoint, self._endpoint.clock
        while (event := endpoint.next_event()) is not None:
            match event:
                case PeerSilent():
                    self._silences += self._first_at is not None
                case Refused(message):
                    self.failure, self.is_done = f"refused: {message}", True
                case PeerClosed(reason) if self._first_at is not None:
                    self.failure, self.is_done = f"the slave left: {reason}", True
        endpoint.report_encoding(now, is_encoding=False)
        if self._first_at is None and not self.is_done:
            self._wait_for_session(now)
        if self._first_at is None or self.is_done:
            return now + PERIOD_S
        last_at = self._first_at + self._seconds
        if now > last_at + max(0.1, 2.0 * ((clock.rtt or 0.0) + clock.jitter)):  # the last answers have come
            self.finish(now)
        elif self._due <= min(now, last_at):
            self._ask(now)
            # What this process was too late for is left out: questions in a heap would measure its own stall.
            self._due = max(self._due + PERIOD_S, now)
        return max(self._due, now + TIMER_STEP_S)

    def _ask(self, now: float) -> None:
        if self._endpoint.ask(now, len(self._asked).to_bytes(TOKEN_BYTES, "big")):
            self._asked.append(now)
        if self._endpoint.clock.rtt is not None:
            self._jitters.append(self._endpoint.clock.jitter)

    def _wait_for_session(self, now: float) -> None:
        if self._endpoint.state is State.ENGAGED and self._endpoint.clock.peer_time(now) is not None:
            self._due = self._first_at = now + WARM_UP_S
        elif now > self._give_up_at:
            why = f"the slave did not answer in {self._patience:g} s: is it started, with the same file and key?"
            self.finish(now, why)

    def finish(self, now: float, failure: str | None = None) -> None:
        """Leave the session."""
        self.failure = self.failure or failure
        self.is_done = True
        if self._endpoint.state is not State.CLOSED:
            self._endpoint.close(now, "measured")

    def result(self, paths: Sequence[Any] = (), priority: str = "") -> LinkTrial:
        used = [path._asdict() for path in paths]
        return LinkTrial(self._asked, self._heard, self._jitters, self._silences, used, priority, self.failure)


def run_link_trial(file: Path, overrides: Sequence[str], seconds: float) -> LinkTrial:
    """Measure the link of a file for some seconds in a child process; a failure is in the result."""
    limit_s = seconds + WARM_UP_S + PATH_S + 2.0 * ANSWER_S
    return run_child(__name__, received, "link", limit_s, file=str(file), overrides=list(overrides), seconds=seconds)


def received(heard: Sequence[Sequence[Any]] = (), **fields: Any) -> LinkTrial:
    """A result as it comes from the child."""
    return LinkTrial(heard=[Heard(*each) for each in heard], **fields)


def build_probe(configuration: Configuration, epoch: float, finder: PathFinder | None) -> Endpoint:
    """The endpoint of a master that measures. Raises ConfigurationError: no key can be read, or no such peer."""
    context = live_context(configuration, MASTER, finder, epoch)
    return build_endpoint(configuration.system, MASTER, context)


def trial(file: str, overrides: Sequence[str], seconds: float) -> LinkTrial:
    """Measure; changes the scheduling class of this process."""

    async def measure() -> None:
        await shell.open(asyncio.get_running_loop())
        try:
            while not measurement.is_done:
                now = monotonic()
                shell.service(now)
                due = measurement.service(now)
                shell.flush(now)
                await asyncio.sleep(due - now)
        finally:
            shell.close()

    try:
        configuration = load(Path(file), overrides, sides=[MASTER])
        system, epoch = configuration.system, monotonic()
        finder = finder_of(configuration, MASTER)
        endpoint = build_probe(configuration, epoch, finder)
        # The process that finds paths starts before the rights are taken, so that it gets none.
        with finding(configuration, finder, take_over=False) as paths:
            grant = prepare(system.realtime.priority, lock_memory=False, cpu=None).priority
            measurement = Measurement(endpoint, monotonic(), seconds, PATH_S if configuration.finds_path else ANSWER_S)
            emulated = emulated_link(MASTER, system, epoch)
            shell = UdpShell(
                endpoint,
                now=monotonic,
                link=None if emulated is None else emulated.link,
                dscp=system.link.dscp,
                paths=paths,
                on_no_path=lambda why: measurement.finish(monotonic(), why),
            )
            with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
                runner.run(measure())
            granted = "in real time" if grant else "not in real time"
            return measurement.result(shell.paths, f"{granted}: {grant.detail}")
    except (ConfigurationError, OSError) as error:  # the port cannot be opened, or a name does not resolve
        return LinkTrial(failure=getattr(error, "strerror", None) or str(error))


if __name__ == "__main__":
    sys.stdout.write(json.dumps(asdict(trial(**json.loads(sys.argv[2])))))
