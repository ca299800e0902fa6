"""A link measured in virtual time: the endpoint of a real slave, and the one with which `doctor --link` calls it."""

from random import Random

from tests.protocol.harness import AGREEMENT, KEY, MASTER, SLAVE, TICK, Pair, Side, forms
from weberlink.apps.doctor.link_figures import LinkTrial
from weberlink.apps.doctor.link_trial import Measurement
from weberlink.protocol import Role
from weberlink.protocol.emulation import Emulation
from weberlink.protocol.probing import ProbingEndpoint
from weberlink.protocol.psk import PresharedKey

EVERY = 5
"""Ticks between two looks at what is due."""
OFFSET = 300.0
"""Of the slave's clock [s]."""


class _Master(Side):
    """The side that measures, which takes its events itself."""

    def collect(self, world: float) -> None:
        pass


class MeasuredLink:
    """A link with known faults, and its measurement.

    Args:
        to_slave, to_master: faults of each direction.
        seconds: of questions.
        silence: limit of both ends [s].
        slave: what differs at the slave's endpoint.
    """

    def __init__(
        self,
        to_slave: Emulation,
        to_master: Emulation,
        *,
        seconds: float = 10.0,
        silence: float = 1.0,
        seed: int = 1,
        slave: dict[str, object] | None = None,
    ) -> None:
        self.pair = Pair(
            forward=to_slave,
            backward=to_master,
            seed=seed,
            slave={"silence": silence, **(slave or {})},
            offsets=(0.0, OFFSET),
            on_tick=self._on_tick,
            every=EVERY,
        )
        self.endpoint = ProbingEndpoint(
            role=Role.INITIATOR,
            agreement=AGREEMENT,
            outgoing=(forms(3),),
            incoming=(forms(6),),
            security=PresharedKey(KEY),
            entropy=Random(f"doctor {seed}").randbytes,
            epoch=0.0,
            tick_period=TICK,
            silence=silence,
            peer=SLAVE,
        )
        self.pair.master = _Master(self.endpoint, MASTER)
        self.pair.slave.endpoint.connect(self.pair.slave.local(0.0))
        self.measurement = Measurement(self.endpoint, 0.0, seconds)
        self._due = 0.0
        self.was_encoding = False
        """Whether the slave ever took this master for one that leads."""

    def run(self) -> "MeasuredLink":
        """Measure to the end."""
        while not self.measurement.is_done:
            self.pair.run(0.1)
        self.pair.run(0.5)
        return self

    def _on_tick(self, pair: Pair, now: float, _tick: int) -> None:
        if now >= self._due:
            self._due = self.measurement.service(now)
        slave = pair.slave
        self.was_encoding |= slave.endpoint.is_peer_encoding(slave.local(now))

    @property
    def trial(self) -> LinkTrial:
        return self.measurement.result()
