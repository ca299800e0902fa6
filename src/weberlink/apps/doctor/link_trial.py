"""Measures in a child process the link to the slave, in a session that moves nothing.

The child is a master without a device. It says that its encoder does not run, so the slave's robot stays at rest.
Run as a program, this file is that child and writes a JSON result to standard output.
"""

import asyncio
import json
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from random import Random
from socket import socket
from subprocess import TimeoutExpired
from time import monotonic, time_ns
from typing import Any

import uvloop

from weberlink.apps.doctor.link_figures import LinkSamples
from weberlink.apps.doctor.link_measurement import ANSWER_S, WARM_UP_S, Measurement
from weberlink.apps.doctor.trial import run_child
from weberlink.protocol import Role
from weberlink.protocol.aio.hand_over import address_of
from weberlink.protocol.aio.udp import UdpShell
from weberlink.protocol.emulation import EmulatedLink
from weberlink.protocol.events import Address
from weberlink.protocol.probing import Heard, ProbingEndpoint
from weberlink.realtime.process import prepare
from weberlink.system import description
from weberlink.system.composition.channels import streams
from weberlink.system.composition.link import Identity, build_endpoint, build_link, build_security
from weberlink.system.configuration import MASTER, Configuration, ConfigurationError, System, load
from weberlink.system.configuration.model import split_address

PATH_S = 40.0
"""Longest time until a path is found."""
ENDS_S = 2.0
"""Time for the process that finds paths to end."""


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
    return run_child(
        __name__, LinkTrial, "link", asdict(request), request.seconds + WARM_UP_S + PATH_S + 2.0 * ANSWER_S
    )


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
        split_address(link.slave) if link.path == "direct" else address_of(identity.expects),
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
    return Identity(name, expects, take_over=False, stamp=lambda _now: time_ns())


def _emulated_link(configuration: Configuration, epoch: float) -> EmulatedLink[Address] | None:
    emulate = configuration.system.link.emulate
    if emulate is None:
        return None
    uniform = Random(f"{emulate.seed}/{MASTER}").random  # noqa: S311
    return build_link(emulate.directions[0], uniform, epoch)


@contextmanager
def finder(configuration: Configuration) -> Iterator[socket | None]:
    """The socket to the process that finds paths, which has ended when this is left; None for a direct path.

    Raises:
        ConfigurationError: a package that it needs is not installed.
    """
    if configuration.system.link.path == "direct":
        yield None
        return
    from weberlink.anywhere.order import start_finder  # noqa: PLC0415 - where a file asks for it
    from weberlink.system.composition.acquaintance import acquaintance, finder_order  # noqa: PLC0415

    peers = acquaintance(configuration, MASTER).peers
    process, end = start_finder(finder_order(configuration, MASTER, peers, take_over=False))
    try:
        yield end
    finally:
        end.close()
        try:
            process.wait(ENDS_S)
        except TimeoutExpired:
            process.kill()
            process.wait()


def trial(request: LinkRequest) -> LinkTrial:
    """Measure; changes the scheduling class of this process."""
    try:
        configuration = load(Path(request.file), request.overrides, sides=[MASTER])
        epoch = monotonic()
        endpoint = build_probe(configuration, epoch)
        with finder(configuration) as end:  # before the rights are taken, so that it gets none
            return _measured(configuration, endpoint, epoch, end, request.seconds)
    except (ConfigurationError, OSError) as error:
        text = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        return LinkTrial(failure=text)


def _measured(
    configuration: Configuration, endpoint: ProbingEndpoint, epoch: float, end: socket | None, seconds: float
) -> LinkTrial:
    system = configuration.system
    grant = prepare(system.realtime.priority, lock_memory=False, cpu=None).priority
    measurement = Measurement(endpoint, monotonic(), seconds, ANSWER_S if end is None else PATH_S)
    shell = UdpShell(
        endpoint,
        now=monotonic,
        link=_emulated_link(configuration, epoch),
        dscp=system.link.dscp,
        finder=end,
        on_no_path=lambda why: measurement.finish(monotonic(), why),
    )
    with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
        runner.run(measure(measurement, shell))
    return LinkTrial(
        endpoint.asked,
        endpoint.heard,
        measurement.delays,
        measurement.silences,
        [path._asdict() for path in shell.paths],
        f"{'in real time' if grant else 'not in real time'}: {grant.detail}",
        measurement.failure,
    )


if __name__ == "__main__":
    sys.stdout.write(json.dumps(asdict(trial(LinkRequest(**json.loads(sys.argv[2]))))))
