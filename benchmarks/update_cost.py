"""Run time of the code of an update at each end, with warm and with cold caches.

Encoder and endpoint of the master, endpoint and decoder of the slave run back to back in one process without a socket.
The same work is timed repeatedly without a pause, and after a sleep of one tick as in a daemon, in which other programs
use the caches. This module is also the process that measures, with the rights of a daemon.
"""

import os
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from time import monotonic, monotonic_ns, sleep
from typing import Any

import numpy as np

from benchmarks.arrangement import MAIN_RATE_HZ, Arrangement, BenchError, Rights, answers, child, rights_of, serve
from benchmarks.coded_echo import OVERRIDES, contact
from benchmarks.percentiles import Series, summary
from weberlink.codec import Decoder, Encoder
from weberlink.config import MASTER, SLAVE, Configuration, load
from weberlink.protocol.events import UpdateReceived
from weberlink.protocol.states import State
from weberlink.realtime.garbage import freeze_garbage
from weberlink.session.composition.channels import streams
from weberlink.session.composition.link import Context, build_endpoint, build_security

UPDATES, QUICK_UPDATES = 2000, 200
PATIENCE_S = 60.0
WARM, COLD = "warm", "cold"
STEPS = ("send", "receive")
"""From before the encoder to the sealed datagram, and from the datagram to the decoded value."""
HERE = ("127.0.0.1", 1)


@dataclass(frozen=True)
class UpdateCost:
    """Run time of every update, by step and by the state of the caches [us]."""

    times_us: Mapping[str, Mapping[str, Series]]

    def as_json(self) -> dict[str, Any]:
        return {
            step: {caches: summary(values) for caches, values in states.items()}
            for step, states in self.times_us.items()
        }


def measure(arrangement: Arrangement, rights: Rights) -> UpdateCost:
    """Run it in a process of its own.

    Raises:
        BenchError: if that fails.
    """
    order = {
        "file": str(arrangement.file),
        "overrides": arrangement.overrides(MAIN_RATE_HZ),
        "updates": QUICK_UPDATES if arrangement.quick else UPDATES,
    }
    with child("update_cost", order, rights) as process:
        found = answers([process], PATIENCE_S, "the cost of an update")[0]
    return UpdateCost({step: {state: np.array(found[state][step]) for state in (WARM, COLD)} for step in STEPS})


class EndpointPair:
    """Both ends of a session without a network between them."""

    def __init__(self, configuration: Configuration) -> None:
        system, now = configuration.system, monotonic()
        (forward,), _ = streams(system)
        context = Context(build_security(configuration), os.urandom, now)
        self.encoder, self.decoder = Encoder(forward), Decoder(forward)
        self.sender = build_endpoint(system, MASTER, context._replace(peer=HERE))
        self.receiver = build_endpoint(system, SLAVE, context)
        self.samples = [position for position, _ in contact()]
        self.tick_period = system.tick_period
        self.began = now
        for endpoint in (self.receiver, self.sender):
            endpoint.connect(now)

    def exchange(self) -> None:
        """Exchange datagrams and run expired timers."""
        for sender, receiver in ((self.sender, self.receiver), (self.receiver, self.sender)):
            sender.handle_timer(monotonic())
            for data, _ in sender.datagrams_to_send():
                receiver.receive_datagram(data, HERE, monotonic())
        for endpoint in (self.sender, self.receiver):
            while endpoint.next_event() is not None:
                pass

    def engage(self) -> None:
        """Run until both are engaged and know the round trip.

        Raises:
            BenchError: if they do not connect.
        """
        until = monotonic() + PATIENCE_S / 2.0
        while (
            self.sender.state is not State.ENGAGED or self.receiver.clock.rtt is None or self.sender.clock.rtt is None
        ):
            if monotonic() > until:
                raise BenchError("the cost of an update: the two ends did not connect")
            self.exchange()
            sleep(0.002)

    def times(self, count: int, pause_s: float) -> dict[str, list[float]]:
        """Run times of `count` updates with a sleep before each step [us]."""
        found: dict[str, list[float]] = {step: [] for step in STEPS}
        for number in range(count):
            position = self.samples[number % len(self.samples)]
            tick = int((monotonic() - self.began) / self.tick_period)
            self.exchange()
            sleep(pause_s)
            began = monotonic_ns()
            update = self.encoder.encode(tick, position)
            if update is None:
                continue
            self.sender.send_update(monotonic(), update)
            datagrams = self.sender.datagrams_to_send()
            sealed = monotonic_ns()
            sleep(pause_s)
            arrived = monotonic_ns()
            for data, _ in datagrams:
                self.receiver.receive_datagram(data, HERE, monotonic())
            event = self.receiver.next_event()
            if not isinstance(event, UpdateReceived):
                continue
            self.decoder.apply(event.update)
            self.decoder.value(event.update.tick + 1, position)
            found["receive"].append((monotonic_ns() - arrived) * 1e-3)
            found["send"].append((sealed - began) * 1e-3)
        return found


def _serve(order: Mapping[str, Any]) -> dict[str, dict[str, list[float]]]:
    pair = EndpointPair(load(Path(order["file"]), [*order["overrides"], *OVERRIDES]))
    rights_of(order).take(0)
    freeze_garbage()
    pair.engage()
    pair.times(order["updates"] // 4, 0.0)  # warm up
    return {WARM: pair.times(order["updates"], 0.0), COLD: pair.times(order["updates"], pair.tick_period)}


if __name__ == "__main__":
    sys.exit(serve(_serve))
