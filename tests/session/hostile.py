"""A real side against a peer that has its keys and says what it likes, in virtual time.

The peer is an endpoint of the protocol, so that its handshakes and its datagrams are authentic.
"""

from collections.abc import Callable
from dataclasses import dataclass
from random import Random
from typing import Any

import numpy as np

from weberlink.config import Configuration
from weberlink.protocol import Endpoint, State
from weberlink.protocol.wire import CHANGE_TICK_BITS, Kind, pack
from weberlink.session.composition.channels import streams
from weberlink.session.composition.link import Context, build_endpoint, build_security
from weberlink.session.simulation import MASTER_ADDRESS, SLAVE_ADDRESS, as_array, build_simulation
from weberlink.telemetry.record import FORCE
from weberlink.update import Payload, PreviousSample, Update

CONNECTS_WITHIN = 40  # ticks after which a peer that begins is in a session


@dataclass(frozen=True)
class Content:
    """What an update says, before it is cut to the form of its stream and selector."""

    stream: int  # modulo the number of streams
    selector: int  # modulo the number of forms
    ahead: int  # tick of the sample after that of the datagram
    newest: tuple[int, ...]  # levels, repeated as often as the form needs them
    payload: Payload  # levels of a `PreviousSample` likewise


class Duel:
    """A side and its hostile peer; `hero` is the end that is real, "master" or "slave"."""

    def __init__(self, configuration: Configuration, hero: str) -> None:
        self._configuration, self._hero = configuration, hero
        addresses = MASTER_ADDRESS, SLAVE_ADDRESS
        self._own_address, self._peer_address = addresses if hero == "master" else addresses[::-1]
        simulation = build_simulation(configuration)
        self.side = simulation.master if hero == "master" else simulation.slave
        self._period = configuration.system.tick_period
        self._sessions = 0
        self.index = 0
        self.side.open(0.0)
        self.peer = self._begun()

    @property
    def now(self) -> float:
        return self.index * self._period

    def _begun(self) -> Endpoint:
        self._sessions += 1
        system, calls = self._configuration.system, self._hero == "slave"
        security, entropy = build_security(self._configuration), Random(f"peer {self._sessions}").randbytes
        context = Context(security, entropy, 0.0, peer=SLAVE_ADDRESS if calls else None, take_over=calls)
        peer = build_endpoint(system, "master" if calls else "slave", context)
        peer.connect(self.now)
        return peer

    def tick(self, count: int = 1) -> None:
        """Ticks of the side, with a record of each."""
        for _ in range(count):
            now = self.now
            self.carry()
            self.side.endpoint.handle_timer(now)
            if not self.side.stopped:
                self.side.tick(self.index, now, now)
                self._look()
            self.index += 1

    def _look(self) -> None:
        """What must hold in every tick: the record can be written, and what is commanded is within the limits."""
        (record,) = as_array([self.side.record()])
        assert np.isfinite(record["output"]).all()
        if self._hero == "master":
            assert np.linalg.norm(record["output"][FORCE]) <= self._configuration.system.master.limits.force_n * (
                1.0 + 1e-9
            )

    def carry(self) -> None:
        """Deliver everything that both ends have said, until neither answers."""
        said = True
        while said:
            said = False
            self.peer.handle_timer(self.now)
            for data, _ in self.peer.datagrams_to_send():
                self.side.endpoint.receive_datagram(data, self._peer_address, self.now)
                said = True
            for data, _ in self.side.endpoint.datagrams_to_send():
                self.peer.receive_datagram(data, self._own_address, self.now)
                said = True
            while self.peer.next_event() is not None:
                pass

    def engage(self) -> None:
        """Tick until both are in a session."""
        for _ in range(CONNECTS_WITHIN):
            self.tick()
            if self.side.engaged:
                return
        raise AssertionError(f"{self.side.endpoint.state} {self.peer.state}")

    def update(self, content: Content) -> bool:
        """Send an update; False if there is no session."""
        forms = self._forms[content.stream % len(self._forms)]
        form = forms[content.selector % len(forms)]
        size = sum(form.newest)
        payload = content.payload
        if isinstance(payload, PreviousSample):
            payload = payload._replace(levels=cut(payload.levels, sum(form.previous or ())))
        if payload is not None and isinstance(payload, PreviousSample) is (form.previous is None):
            payload = None
        tick = max(0, self.index + content.ahead)
        update = Update(tick, content.selector % len(forms), cut(content.newest, size), payload)
        return self.peer.send_update(self.now, update, content.stream % len(self._forms))

    @property
    def _forms(self) -> Any:
        forward, backward = streams(self._configuration.system)
        return [channel.forms for channel in (forward if self._hero == "slave" else backward)]

    def change(self, number: int, ahead: int, body: bytes, *, is_answer: bool) -> None:
        """Send a proposal or an answer of any number, whether or not its turn has come."""

        def packed(envelope: Any) -> bytes:
            tick = (self.index + ahead) % (1 << CHANGE_TICK_BITS)
            return pack(envelope, Kind.CHANGE, body, mark=is_answer, selector=number, tick=tick)

        self._forge(packed)

    def garble(self, kind: Kind, flags: int, body: bytes) -> None:
        """Send any bits as the content of any kind."""

        def packed(envelope: Any) -> bytes:
            return bytes([kind | flags & 0x78]) + pack(envelope, Kind.PATH, body)[1:]

        self._forge(packed)

    def _forge(self, packed: Callable[[Any], bytes]) -> None:
        session = self.peer._session
        if session is None:
            return
        envelope, sequence = session._envelope(self.now)
        self.peer._post(session._protection.seal(sequence, packed(envelope), self.now))

    def renew(self, reason: str | None) -> None:
        """End the session, with a farewell or without one, and begin another one before the next tick of the side."""
        if reason is not None and self.peer.state is not State.CLOSED:
            self.peer.close(self.now, reason)
        left = self.peer.datagrams_to_send()
        self.peer = self._begun()
        for data, _ in left:
            self.side.endpoint.receive_datagram(data, self._peer_address, self.now)
        self.carry()


def cut(levels: tuple[int, ...], size: int) -> tuple[int, ...]:
    """As many of these levels, from the first one again where they do not suffice."""
    return tuple(levels[index % len(levels)] for index in range(size))
