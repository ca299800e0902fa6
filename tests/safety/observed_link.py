"""One direction of the link that notes when each datagram left, when it arrived, and whether it was executed.

It can also hold datagrams for any time while others pass.
"""

from collections.abc import Callable
from heapq import heappop, heappush
from random import Random
from typing import Any

from weberlink.config import Configuration
from weberlink.protocol.emulation import EmulatedLink, Emulation
from weberlink.protocol.events import Address
from weberlink.session.simulation import Simulation, build_simulation

Hold = Callable[[bytes, float], float | None]
"""A datagram and its departure [s] to the age [s] at which it arrives; None for one that is not held."""


class ObservedLink(EmulatedLink[Any]):
    """Takes the place of an `EmulatedLink` in a simulation.

    Datagrams are handed over one at a time, so that a risen count of executed updates belongs to the one before.

    Attributes:
        executed: how many updates the receiving end has executed so far; set once that end is there.
        departures: when each datagram was sent [s].
        arrivals: (arrival, departure) of each datagram handed over [s].
        executions: the age of each executed update when it arrived [s].
    """

    def __init__(self, emulation: Emulation | None = None, *, hold: Hold = lambda *_: None, seed: int = 1) -> None:
        super().__init__(emulation or Emulation(), Random(seed).random)
        self._hold = hold
        self._last: tuple[float, float] | None = None
        self._executed_before = 0
        self.executed: Callable[[], int] = lambda: 0
        self.departures: list[float] = []
        self.arrivals: list[tuple[float, float]] = []
        self.executions: list[float] = []

    def send(self, data: bytes, tag: Address, now: float) -> None:
        self.departures.append(now)
        age = self._hold(data, now)
        if age is None:
            super().send(data, (tag, now), now)
        else:
            heappush(self._flights, (now + age, next(self._numbers), data, (tag, now)))

    def receive(self, now: float) -> list[tuple[bytes, Address]]:
        """The next datagram that has arrived by now, if there is one."""
        self.settle()
        due = self.next_due()
        if due is None or due > now:
            return []
        _, _, data, (address, departure) = heappop(self._flights)
        self._last = now, departure
        self.arrivals.append(self._last)
        return [(data, address)]

    def settle(self) -> None:
        """Note whether the datagram handed over last was executed."""
        executed = self.executed()
        if self._last is not None and executed > self._executed_before:
            arrival, departure = self._last
            self.executions.append(arrival - departure)
        self._executed_before, self._last = executed, None


def observed(loaded: Configuration, forward: ObservedLink, backward: ObservedLink) -> Simulation:
    built = build_simulation(loaded)
    forward.executed = lambda: sum(built.slave.endpoint.statistics.updates_received)
    backward.executed = lambda: sum(built.master.endpoint.statistics.updates_received)
    links: Any = (forward, backward)
    return Simulation(master=built.master, slave=built.slave, links=links, tick_period=loaded.system.tick_period)


def agreed_by(simulated: Simulation) -> float:
    """The longest round trip that an end has agreed on by now [s]."""
    return max(side.endpoint.liveness.round_trip for side in (simulated.master, simulated.slave))
