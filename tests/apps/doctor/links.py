"""A measurement of a link in virtual time: a real slave's endpoint, and the one that `doctor --network` calls it with."""

from collections.abc import Callable, Sequence
from random import Random

from tests.protocol.harness import AGREEMENT, KEY, SLAVE, TICK, Pair, forms
from weberlink.apps.doctor.link_figures import LinkSamples
from weberlink.apps.doctor.link_measurement import Measurement
from weberlink.protocol import Event, Role
from weberlink.protocol.emulation import Emulation
from weberlink.protocol.probing import ProbingEndpoint
from weberlink.protocol.psk import PresharedKey


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
        offset: float = 300.0,
    ) -> None:
        self.pair = Pair(
            forward=to_slave,
            backward=to_master,
            seed=seed,
            slave={"silence": silence, **(slave or {})},
            offsets=(0.0, offset),
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
        self.pair.master.endpoint = self.endpoint
        self.pair.slave.endpoint.connect(self.pair.slave.local(0.0))
        self.measurement = Measurement(self.endpoint, 0.0, seconds)
        self.was_encoding = False

    def run(self, limit: float = 60.0, on_tick: Callable[[float], None] = lambda now: None) -> "MeasuredLink":
        """Measure to the end, or until `limit` [s]."""
        due = 0.0
        while not self.measurement.is_done and self.pair.now < limit:
            now = self.pair.now
            if now >= due:
                due = self.measurement.service(now)
            on_tick(now)
            slave = self.pair.slave
            self.was_encoding |= slave.endpoint.is_peer_encoding(slave.local(now))
            self.pair.run(TICK)
        self.pair.run(0.5)
        return self

    @property
    def samples(self) -> LinkSamples:
        return LinkSamples(
            self.endpoint.asked, self.endpoint.heard, self.measurement.delays, self.measurement.silences
        )

    @property
    def slave_events(self) -> Sequence[Event]:
        return self.pair.slave.events
