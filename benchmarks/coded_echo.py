"""One end of an exchange of updates through encoder, endpoint, security, socket, endpoint and decoder, as a process.

The asking end is the master of a session and sends positions; the answering end is the slave and sends forces
(`benchmarks.latency`). Both run as in a daemon: an event loop woken by tick and socket, its shell and an endpoint. Only
the wait for the next tick is left out: a received update is decoded at once.
"""

import asyncio
import os
import sys
from pathlib import Path
from time import monotonic, monotonic_ns
from typing import Any

import uvloop

from benchmarks.arrangement import rights_of, serve, tell
from benchmarks.latency import ASK, CAME, HOST, SENT, Moments
from weberlink.codec import Decoder, Encoder
from weberlink.config import MASTER, SLAVE, Configuration, load
from weberlink.geometry.vector import Vector
from weberlink.master.trace import read_trace
from weberlink.protocol import Role
from weberlink.protocol.aio.udp import UdpShell
from weberlink.protocol.events import Event, PeerClosed, UpdateReceived
from weberlink.protocol.states import State
from weberlink.realtime.garbage import freeze_garbage
from weberlink.realtime.ticker import Ticker
from weberlink.session.composition.channels import streams
from weberlink.session.composition.link import Context, build_endpoint, build_security
from weberlink_studies.evaluate.traces import SHIPPED

OVERRIDES = ("codec.force.weber=0", "codec.force.floor_n=0", "codec.position.weber=0", "codec.position.bound_m=0")
"""Every sample is sent."""
PATIENCE_S = 10.0
CONTACT_N = 0.2
TREMBLE_M, TREMBLE_SHARE = 1e-4, 0.02


class EchoEnd:
    """One end: codec, endpoint, shell and moments.

    Args:
        every: whether the master sends every sample, and the slave answers at once; otherwise both send from their
            ticks what their deadband leaves.
    """

    def __init__(self, configuration: Configuration, role: Role, port: int, epoch: float, *, every: bool) -> None:
        system = configuration.system
        (forward,), (backward,) = streams(system)
        self._asks = role is Role.INITIATOR
        outgoing, incoming = (forward, backward) if self._asks else (backward, forward)
        self.encoder, self.decoder = Encoder(outgoing), Decoder(incoming)
        peer = (HOST, port) if self._asks else None
        context = Context(build_security(configuration), os.urandom, epoch, peer=peer)
        self.endpoint = build_endpoint(system, MASTER if self._asks else SLAVE, context)
        self._epoch, self._tick_period = epoch, system.tick_period
        # The shell asks for the time after every datagram that it takes: the moment to answer it.
        self.shell = UdpShell(self.endpoint, now=self._heard, listen=(HOST, 0))
        self._samples = contact(trembles=every)
        self._sends, self._answers = self._asks or not every, every and not self._asks
        self.moments: Moments = {SENT: {}, CAME: {}}
        self.ticks = 0
        self.ended = asyncio.Event()

    def tick(self, _index: int, deadline: float, now: float) -> None:
        """A tick of the daemon: receive, encode, send and flush."""
        self.shell.service(now)
        if self.endpoint.state is State.ENGAGED:
            self.ticks += 1
            if self._sends:
                self._send(round((deadline - self._epoch) / self._tick_period), now)
        self.shell.flush(now)

    def _send(self, tick: int, now: float) -> None:
        position, force = self._samples[tick % len(self._samples)]
        began = monotonic_ns()
        update = self.encoder.encode(tick, position if self._asks else force, position)
        if update is not None:
            self.endpoint.send_update(now, update)  # the shell sends it
            self.moments[SENT][tick] = began

    def _heard(self) -> float:
        """Take all events; the time [s]."""
        while (event := self.endpoint.next_event()) is not None:
            self._meet(event)
        return monotonic()

    def _meet(self, event: Event) -> None:
        if isinstance(event, UpdateReceived):
            tick = event.update.tick
            self.decoder.apply(event.update)
            self.decoder.value(tick + 1, self._samples[tick % len(self._samples)][0])
            self.moments[CAME][tick] = monotonic_ns()
            if self._answers:
                self._send(tick, monotonic())
        elif isinstance(event, PeerClosed):
            self.ended.set()


def contact(*, trembles: bool = True) -> list[tuple[Vector, Vector]]:
    """Positions and forces of the shipped recording during contact, by default with an unpredictable tremor."""
    trace = read_trace(SHIPPED)
    rows = zip(trace.position_m.tolist(), trace.force_n.tolist(), strict=True)
    touching = [(tuple(position), tuple(force)) for position, force in rows if max(map(abs, force)) > CONTACT_N]
    if not trembles:
        return touching
    return [_trembling(position, force, (-1) ** index) for index, (position, force) in enumerate(touching)]


def _trembling(position: Vector, force: Vector, sign: int) -> tuple[Vector, Vector]:
    x, y, z = position
    fx, fy, fz = force
    push = 1.0 + sign * TREMBLE_SHARE
    return (x, y, z + sign * TREMBLE_M), (push * fx, push * fy, push * fz)


async def run(end: EchoEnd, order: dict[str, Any]) -> None:
    """Run until the ticks of the order are done, or the peer has left."""
    await end.shell.open(asyncio.get_running_loop())
    end.endpoint.connect(monotonic())
    end.shell.flush(monotonic())
    # Without an advance, as the bare exchange: busy-waiting would warm the caches.
    ticker = Ticker(1.0 / order["rate_hz"], end.tick, advance=False)
    ticker.start()
    try:
        if order["end"] == ASK:
            until = monotonic() + order["count"] / order["rate_hz"] + PATIENCE_S
            while end.ticks < order["count"] and monotonic() < until:
                await asyncio.sleep(0.05)
            end.endpoint.close(monotonic(), "completed")
        else:
            tell(f"{end.shell.address[1]}\n")
            await end.ended.wait()
    finally:
        ticker.stop()
        end.shell.close()


def _serve(order: dict[str, Any]) -> Moments:
    role = Role.INITIATOR if order["end"] == ASK else Role.RESPONDER
    every = order["every"]
    configuration = load(Path(order["file"]), [*order["overrides"], *(OVERRIDES if every else ())])
    end = EchoEnd(configuration, role, order.get("port", 0), order["epoch"], every=every)
    rights_of(order).take(0 if role is Role.INITIATOR else 1)
    freeze_garbage()
    with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
        runner.run(run(end, order))
    return end.moments


if __name__ == "__main__":
    sys.exit(serve(_serve))
