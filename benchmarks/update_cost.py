"""What the code of an update costs at each end, with warm caches and with cold ones.

Encoder and endpoint of the master's side, endpoint and decoder of the slave's, back to back in one process without a
socket. The same work is timed again and again at once, and after a sleep of a tick each time: that is how a daemon does
it, and by then other programs, or other guests of the machine, have had the caches.

Also a process: it takes an order as JSON, with the rights of a daemon, and prints what it saw.
"""

import json
import os
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from signal import SIGHUP
from time import monotonic, monotonic_ns, sleep
from typing import Any

import numpy as np

from benchmarks.arrangement import MAIN_RATE_HZ, Arrangement, BenchError, module, tell
from benchmarks.coded_echo import OVERRIDES, contact
from benchmarks.percentiles import Series, summary
from benchmarks.rights import Rights
from weberlink.codec import Decoder, Encoder
from weberlink.protocol import Role
from weberlink.protocol.events import UpdateReceived
from weberlink.protocol.states import State
from weberlink.realtime.garbage import freeze_garbage
from weberlink.realtime.process import die_with_parent
from weberlink.system.composition.channels import channels
from weberlink.system.composition.link import build_endpoint, build_security
from weberlink.system.configuration import Configuration, load

UPDATES, QUICK_UPDATES = 2000, 200
PATIENCE_S = 60.0
WARM, COLD = "warm", "cold"
STEPS = ("send", "receive")
"""From before the encoder to the sealed datagram, and from the datagram to what the decoder says."""
HERE = ("127.0.0.1", 1)


@dataclass(frozen=True)
class UpdateCost:
    """Of every update, by step and by the state of the caches [us]."""

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
        "rights": asdict(rights),
        "parent": os.getpid(),
    }
    try:
        ended = subprocess.run(  # noqa: S603
            module("update_cost", json.dumps(order)), stdout=subprocess.PIPE, text=True, timeout=PATIENCE_S, check=False
        )
    except subprocess.TimeoutExpired:
        raise BenchError("the cost of an update: did not come to an end") from None
    if ended.returncode:
        raise BenchError("the cost of an update: its process failed")
    found = json.loads(ended.stdout)
    return UpdateCost({step: {state: np.array(found[state][step]) for state in (WARM, COLD)} for step in STEPS})


class Pair:
    """Both ends of a session, without anything between them."""

    def __init__(self, configuration: Configuration) -> None:
        system, now = configuration.system, monotonic()
        forward, backward = channels(system)
        security, there, back = build_security(configuration), (forward,), (backward,)
        self.encoder, self.decoder = Encoder(forward), Decoder(forward)
        self.sender = build_endpoint(system, Role.INITIATOR, security, os.urandom, now, there, back, HERE)
        self.receiver = build_endpoint(system, Role.RESPONDER, security, os.urandom, now, back, there, None)
        self.samples = [position for position, _ in contact()]
        self.tick_period = system.tick_period
        self.began = now
        for endpoint in (self.receiver, self.sender):
            endpoint.connect(now)

    def exchange(self) -> None:
        """Carry what both have to say, and let time do what is due."""
        for sender, receiver in ((self.sender, self.receiver), (self.receiver, self.sender)):
            sender.handle_timer(monotonic())
            for data, _ in sender.datagrams_to_send():
                receiver.receive_datagram(data, HERE, monotonic())
        for endpoint in (self.sender, self.receiver):
            while endpoint.next_event() is not None:
                pass

    def engage(self) -> None:
        """Until both are in a session, and know each other's clock.

        Raises:
            BenchError: if they do not find each other.
        """
        until = monotonic() + PATIENCE_S / 2.0
        while self.sender.state is not State.ENGAGED or self.receiver.rtt is None or self.sender.rtt is None:
            if monotonic() > until:
                raise BenchError("the cost of an update: the two ends did not find each other")
            self.exchange()
            sleep(0.002)

    def times(self, count: int, pause_s: float) -> dict[str, list[float]]:
        """Of `count` updates, with a sleep before each step [us]."""
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


def main(text: str) -> int:
    order = json.loads(text)
    die_with_parent(SIGHUP, order["parent"])
    pair = Pair(load(Path(order["file"]), [*order["overrides"], *OVERRIDES]))
    Rights(**order["rights"]).take(0)
    freeze_garbage()
    pair.engage()
    pair.times(order["updates"] // 4, 0.0)  # whatever is done once
    found = {WARM: pair.times(order["updates"], 0.0), COLD: pair.times(order["updates"], pair.tick_period)}
    tell(json.dumps(found))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
