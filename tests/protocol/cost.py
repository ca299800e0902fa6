"""What an endpoint costs per datagram on this machine: `python -m tests.protocol.cost`. Reports, asserts nothing."""

import platform
import sys
from time import perf_counter

from tests.protocol.harness import KEY, MASTER, SLAVE, make_endpoint
from weberlink.protocol import Endpoint, Role
from weberlink.protocol.checksum import Checksum
from weberlink.protocol.psk import PresharedKey
from weberlink.protocol.security import Security

COUNT = 20_000
BATCH = 50
NEWEST = (1000, -2000, 3000, 10, 20, 30)
PREVIOUS = (990, -2010, 3010, 9, 21, 33)


def engaged(security: Security, outgoing: int = 6) -> tuple[Endpoint, Endpoint]:
    """A master and a slave, which sends `outgoing` values, that have found each other at time 0."""
    master = make_endpoint(Role.INITIATOR, security=security, incoming_values=(outgoing,))
    slave = make_endpoint(Role.RESPONDER, security=security, outgoing_values=(outgoing,))
    slave.connect(0.0)
    master.connect(0.0)
    for _ in range(4):
        exchange(master, slave, 0.0)
    return master, slave


def exchange(master: Endpoint, slave: Endpoint, now: float) -> None:
    for data, _ in master.datagrams_to_send():
        slave.receive_datagram(data, MASTER, now)
    for data, _ in slave.datagrams_to_send():
        master.receive_datagram(data, SLAVE, now)


def measure(security: Security) -> dict[str, float]:
    """Mean cost [us] of each call over a session at 1 kHz."""
    master, slave = engaged(security)
    spent = {"send": 0.0, "receive": 0.0, "timer": 0.0}
    for tick in range(COUNT):
        now = tick * 0.001
        start = perf_counter()
        slave.send_update(now, tick, 3, NEWEST, 5, PREVIOUS)
        datagrams = slave.datagrams_to_send()
        sent = perf_counter()
        for data, _ in datagrams:
            master.receive_datagram(data, SLAVE, now)
        received = perf_counter()
        slave.handle_timer(now)
        slave.next_timer()
        spent["send"] += sent - start
        spent["receive"] += received - sent
        spent["timer"] += perf_counter() - received
        while master.next_event() is not None:
            pass
        master.handle_timer(now)
        exchange(master, slave, now)
    assert master.statistics.updates_received[0] == COUNT
    return {name: seconds / COUNT * 1e6 for name, seconds in spent.items()}


def main() -> None:
    out = sys.stdout
    out.write(
        f"{platform.python_implementation()} {platform.python_version()}, {platform.machine()}, {COUNT} updates\n"
    )
    for name, security in (("psk", PresharedKey(KEY)), ("none", Checksum())):
        costs = measure(security)
        out.write(f"{name:5}" + "  ".join(f"{call} {cost:6.2f} us" for call, cost in costs.items()) + "\n")


if __name__ == "__main__":
    main()
