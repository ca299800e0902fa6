"""Measures in a child process the link to the slave, in a session that moves nothing.

The child is a master without a device. It says that its encoder does not run, so the slave's robot stays at rest.
Run as a program, this file is that child and writes a JSON result to standard output.
"""

import asyncio
import json
import os
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from random import Random
from time import monotonic, time_ns
from typing import Any

import uvloop

from weberlink.apps.doctor.link_figures import LinkSamples
from weberlink.apps.doctor.trial import run_child
from weberlink.protocol import DropReason, PeerClosed, PeerSilent, Refused, Role, State
from weberlink.protocol.aio.udp import UdpShell
from weberlink.protocol.probing import Heard, ProbingEndpoint
from weberlink.realtime.process import prepare
from weberlink.system import description
from weberlink.system.composition.channels import streams
from weberlink.system.composition.link import Identity, build_endpoint, build_link, build_security
from weberlink.system.configuration import MASTER, Configuration, ConfigurationError, System, load
from weberlink.system.configuration.model import split_address

PERIOD_S = 0.005
"""Between two questions: as dense as the updates of a busy session."""
LEAST_PAUSE_S = 0.001
"""Resolution of the timers of uvloop."""
WARM_UP_S = 1.0
"""From the session's beginning to the first question, in which the ends map their clocks."""
ANSWER_S = 5.0
"""Longest time until the slave answers a call."""
PATH_S = 40.0
"""Longest time until a path is found."""
FAREWELL = "measured"


@dataclass(frozen=True, slots=True)
class LinkRequest:
    """What to measure.

    Args:
        file: the configuration.
        overrides: of it.
        seconds: for how long.
    """

    file: str
    overrides: Sequence[str]
    seconds: float


@dataclass(frozen=True, slots=True)
class LinkTrial:
    """Result: the fields of `LinkSamples`, the paths in use at the end, and why there is no result, if so."""

    asked: list[float] = field(default_factory=list)
    heard: list[Any] = field(default_factory=list)
    delays: list[Any] = field(default_factory=list)
    silences: int = 0
    paths: list[dict[str, Any]] = field(default_factory=list)
    priority: str = ""
    """What came of real-time rights."""
    failure: str | None = None

    @property
    def samples(self) -> LinkSamples:
        return LinkSamples(
            self.asked, [Heard(*each) for each in self.heard], [(*each,) for each in self.delays], self.silences
        )


def run_link_trial(request: LinkRequest) -> LinkTrial:
    """Run the measurement in a child process; a failure is in the result."""
    return run_child(__name__, request, LinkTrial, request.seconds + WARM_UP_S + PATH_S + 2.0 * ANSWER_S)


class Measurement:
    """What a master without a device does: call, wait, ask, and wait for the last answers.

    Args:
        endpoint: not yet connected.
        now: [s].
        seconds: for how long to ask.
        patience: longest time until the session [s].
    """

    def __init__(self, endpoint: ProbingEndpoint, now: float, seconds: float, patience: float = ANSWER_S) -> None:
        self._endpoint = endpoint
        self._seconds = seconds
        self._give_up_at = now + patience
        self._patience = patience
        self._first_at: float | None = None
        self._due = now
        self.delays: list[tuple[float, float, float]] = []
        self.silences = 0
        self.failure: str | None = None
        self.is_done = False
        endpoint.report_encoding(now, is_encoding=False)
        endpoint.connect(now)

    def service(self, now: float) -> float:
        """Do what is due; returns when to be called again [s]."""
        endpoint = self._endpoint
        self._hear()
        endpoint.report_encoding(now, is_encoding=False)
        if self._first_at is None and not self.is_done:
            self._wait(now)
        if self._first_at is None or self.is_done:
            return now + PERIOD_S
        last_at = self._first_at + self._seconds
        if now > last_at + self._settling():
            self.finish(now)
        elif self._due <= min(now, last_at):
            endpoint.ask(now)
            if endpoint.rtt is not None:
                self.delays.append((now, endpoint.rtt, endpoint.jitter))
            # What this process was too late for is left out: questions in a heap would measure its own stall.
            self._due = max(self._due + PERIOD_S, now)
        return max(self._due, now + LEAST_PAUSE_S)

    def finish(self, now: float, failure: str | None = None) -> None:
        """Leave the session."""
        self.failure = self.failure or failure
        self.is_done = True
        if self._endpoint.state is not State.CLOSED:
            self._endpoint.close(now, FAREWELL)

    def _settling(self) -> float:
        """How long to wait for the last answers."""
        return max(0.1, 2.0 * ((self._endpoint.rtt or 0.0) + self._endpoint.jitter))

    def _wait(self, now: float) -> None:
        endpoint = self._endpoint
        if endpoint.state is State.ENGAGED and endpoint.peer_time(now) is not None:
            self._due = self._first_at = now + WARM_UP_S
        elif now > self._give_up_at:
            why = f"the slave did not answer in {self._patience:g} s: is it started, with the same file?"
            if DropReason.UNPROVEN in endpoint.statistics.dropped:
                why = "something answers, but not with this key: do both hosts have the same?"
            self.finish(now, why)

    def _hear(self) -> None:
        while (event := self._endpoint.next_event()) is not None:
            match event:
                case PeerSilent():
                    self.silences += self._first_at is not None
                case Refused(message):
                    self.failure, self.is_done = f"refused: {message}", True
                case PeerClosed(reason) if self._first_at is not None:
                    self.failure, self.is_done = f"the slave left: {reason}", True


async def measure(measurement: Measurement, shell: UdpShell) -> None:
    """Run a measurement to its end.

    Raises:
        OSError: the port cannot be opened, or a name does not resolve.
    """
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


def build_probe(configuration: Configuration, epoch: float) -> ProbingEndpoint:
    """The endpoint of a master that measures.

    Raises:
        ConfigurationError: the key cannot be read, or the peer is not known.
    """
    system = configuration.system
    link, identity = system.link, _identity(configuration)
    forward, backward = _streams(system)
    endpoint = build_endpoint(
        system,
        Role.INITIATOR,
        build_security(configuration),
        os.urandom,
        epoch,
        forward,
        backward,
        split_address(link.slave),
        identity,
        ProbingEndpoint,
    )
    assert isinstance(endpoint, ProbingEndpoint)
    return endpoint


def _streams(system: System) -> Any:
    if system.codec.joints is None:
        return streams(system)
    from weberlink.system.composition.joint_channels import joint_streams  # noqa: PLC0415 - for arms alone

    return joint_streams(system)


def _identity(configuration: Configuration) -> Identity:
    link = configuration.system.link
    name, expects = description.default_name(MASTER, link.listen), ""
    if link.security == "peers":
        from weberlink.system.composition.acquaintance import acquaintance  # noqa: PLC0415 - where a file asks for it

        known = acquaintance(configuration, MASTER)
        name, expects = known.own, known.expects
    return Identity(name, expects, False, lambda _now: time_ns())


def trial(request: LinkRequest) -> LinkTrial:
    """Measure; changes the scheduling class of this process."""
    try:
        configuration = load(Path(request.file), request.overrides, sides=[MASTER])
        epoch = monotonic()
        endpoint = build_probe(configuration, epoch)
    except ConfigurationError as error:
        return LinkTrial(failure=str(error))
    system = configuration.system
    emulate, link = system.link.emulate, None
    if emulate is not None:
        uniform = Random(f"{emulate.seed}/{MASTER}").random  # noqa: S311
        link = build_link(emulate.directions[0], uniform, epoch)
    grant = prepare(system.realtime.priority, lock_memory=False, cpu=None).priority
    shell = UdpShell(endpoint, now=monotonic, link=link)
    measurement = Measurement(endpoint, monotonic(), request.seconds)
    try:
        asyncio.Runner(loop_factory=uvloop.new_event_loop).run(measure(measurement, shell))
    except OSError as error:
        return LinkTrial(failure=error.strerror or str(error))
    return LinkTrial(
        endpoint.asked,
        endpoint.heard,
        measurement.delays,
        measurement.silences,
        [],
        f"{'real time' if grant else 'not real time'}: {grant.detail}",
        measurement.failure,
    )


if __name__ == "__main__":
    sys.stdout.write(json.dumps(asdict(trial(LinkRequest(**json.loads(sys.argv[1]))))))
