"""One end of an echo through encoder, endpoint, security, socket, endpoint and decoder, as a process.

The asking end is the master of a session and sends positions; the answering end is the slave and sends forces
(`benchmarks.latency`). Both run as in a daemon: an event loop woken by the socket, its shell and an endpoint. Only the
wait for the next tick is left out: a received update is decoded at once.
"""

import asyncio
import os
import sys
from pathlib import Path
from time import monotonic, monotonic_ns
from typing import Any

import uvloop

from benchmarks.arrangement import rights_of, serve, tell
from benchmarks.latency import ASK, HOST, Moments
from weberlink.codec import Decoder, Encoder
from weberlink.config import Configuration, load
from weberlink.geometry.vector import Vector
from weberlink.master.trace import read_trace
from weberlink.protocol import Role
from weberlink.protocol.aio.udp import UdpShell
from weberlink.protocol.events import Event, PeerClosed, UpdateReceived
from weberlink.protocol.states import State
from weberlink.realtime.garbage import freeze_garbage
from weberlink.realtime.ticker import Ticker
from weberlink.session.composition.channels import channels
from weberlink.session.composition.link import build_endpoint, build_security
from weberlink_studies.evaluate.traces import SHIPPED

OVERRIDES = ("codec.force.weber=0", "codec.force.floor_n=0", "codec.position.weber=0", "codec.position.bound_m=0")
"""Every sample is sent."""
PATIENCE_S = 10.0
CONTACT_N = 0.2
TREMBLE_M, TREMBLE_SHARE = 1e-4, 0.02


class EchoEnd:
    """One end of the echo: codec, endpoint, shell and moments."""

    def __init__(self, configuration: Configuration, role: Role, port: int, epoch: float) -> None:
        system = configuration.system
        forward, backward = channels(system)
        asks = role is Role.INITIATOR
        outgoing, incoming = (forward, backward) if asks else (backward, forward)
        self.encoder, self.decoder = Encoder(outgoing), Decoder(incoming)
        peer = (HOST, port) if asks else None
        security = build_security(configuration)
        self.endpoint = build_endpoint(system, role, security, os.urandom, epoch, (outgoing,), (incoming,), peer)
        self._epoch, self._tick_period = epoch, system.tick_period
        # The shell asks for the time after every datagram that it takes: the moment to answer it.
        self.shell = UdpShell(self.endpoint, now=self._heard, listen=(HOST, 0))
        self.samples = contact()
        self.moments: dict[int, list[int]] = {}
        self.ended = asyncio.Event()
        self._take = self._end_trip if asks else self._answer

    def position(self, tick: int) -> Vector:
        return self.samples[tick % len(self.samples)][0]

    def ask(self, _index: int, deadline: float, now: float) -> None:
        """A tick of the daemon: receive, encode, send and flush."""
        self.shell.service(now)
        if self.endpoint.state is State.ENGAGED:
            tick = round((deadline - self._epoch) / self._tick_period)
            position = self.position(tick)
            began = monotonic_ns()
            update = self.encoder.encode(tick, position)
            if update is not None:
                self.endpoint.send_update(now, update)
                self.moments[tick] = [began]
        self.shell.flush(now)

    def _heard(self) -> float:
        """Take all events; the time [s]."""
        while (event := self.endpoint.next_event()) is not None:
            self._meet(event)
        return monotonic()

    def _meet(self, event: Event) -> None:
        if isinstance(event, UpdateReceived):
            self.decoder.apply(event.update)
            self.decoder.value(event.update.tick + 1, self.position(event.update.tick))
            self._take(event.update.tick)
        elif isinstance(event, PeerClosed):
            self.ended.set()

    def _answer(self, tick: int) -> None:
        there = monotonic_ns()
        position, force = self.samples[tick % len(self.samples)]
        back = monotonic_ns()
        update = self.encoder.encode(tick, force, position)
        if update is not None:
            self.endpoint.send_update(monotonic(), update)  # the shell sends it
            self.moments[tick] = [there, back]

    def _end_trip(self, tick: int) -> None:
        moment = self.moments.get(tick)
        if moment is not None:
            moment.append(monotonic_ns())

    def answered(self) -> Moments:
        """The moments of the answered questions."""
        return {tick: (pair[0], pair[1]) for tick, pair in self.moments.items() if len(pair) == 2}


def contact() -> list[tuple[Vector, Vector]]:
    """Positions and forces of the shipped recording during contact, with an unpredictable tremor."""
    trace = read_trace(SHIPPED)
    rows = zip(trace.position_m.tolist(), trace.force_n.tolist(), strict=True)
    touching = [(position, force) for position, force in rows if max(map(abs, force)) > CONTACT_N]
    return [_trembling(position, force, (-1) ** index) for index, (position, force) in enumerate(touching)]


def _trembling(position: Vector, force: Vector, sign: int) -> tuple[Vector, Vector]:
    x, y, z = position
    fx, fy, fz = force
    push = 1.0 + sign * TREMBLE_SHARE
    return (x, y, z + sign * TREMBLE_M), (push * fx, push * fy, push * fz)


async def run(end: EchoEnd, order: dict[str, Any]) -> None:
    """Run until all questions are asked, or the peer has left."""
    loop = asyncio.get_running_loop()
    await end.shell.open(loop)
    end.endpoint.connect(monotonic())
    end.shell.flush(monotonic())
    try:
        if order["end"] == ASK:
            await _ask(end, order)
        else:
            tell(f"{end.shell.address[1]}\n")
            await end.ended.wait()
    finally:
        end.shell.close()


async def _ask(end: EchoEnd, order: dict[str, Any]) -> None:
    wanted = order["warm_up"] + order["questions"]
    # Without a lead, as the plain echo: busy-waiting would warm the caches.
    ticker = Ticker(1.0 / order["rate_hz"], end.ask, advance=False)
    ticker.start()
    try:
        until = monotonic() + wanted / order["rate_hz"] + PATIENCE_S
        while len(end.moments) < wanted and monotonic() < until:
            await asyncio.sleep(0.05)
    finally:
        ticker.stop()
    end.endpoint.close(monotonic(), "completed")


def _serve(order: dict[str, Any]) -> Moments:
    asks = order["end"] == ASK
    configuration = load(Path(order["file"]), [*order["overrides"], *OVERRIDES])
    end = EchoEnd(configuration, Role.INITIATOR if asks else Role.RESPONDER, order.get("port", 0), order["epoch"])
    rights_of(order).take(0 if asks else 1)
    freeze_garbage()
    with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
        runner.run(run(end, order))
    return end.answered()


if __name__ == "__main__":
    sys.exit(serve(_serve))
