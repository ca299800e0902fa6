"""One attempt to find one path, by ICE (RFC 8445, aioice).

Everything that depends on the inside of aioice is in `_Connection` and `PathAttempt._found`.
"""

import asyncio
from functools import partial
from typing import NamedTuple

import aioice
from aioice import stun, turn
from aioice.ice import CandidatePair, StunProtocol

from weberlink.protocol.events import Address
from weberlink_anywhere.signalling import MOST_CANDIDATES, Description
from weberlink_anywhere.sockets import BINDING, Binding, OwnSocket

GATHER_S = 2
"""Longest wait for the servers: two round trips and one repetition (0.5 s) fit, and no more is worth waiting for."""
RELAY_PATIENCE_S = 0.5
"""How long each relay on a way gives a shorter one the advantage: as long as aioice takes to repeat a check."""
PERMISSION_S = 240
"""Bind channels again so often; a relay forgets whom it lets through after 300 s (RFC 8656 section 9)."""
_HOST, _RELAY, _OUTSIDE = "host", "relay", "srflx"


class NoPath(Exception):  # noqa: N818 - the condition is the name
    """No pair of addresses worked in time."""


class Servers(NamedTuple):
    """Servers with their addresses resolved, and the credentials for the relay."""

    stun: Address | None = None
    turn: Address | None = None
    user: str | None = None
    password: str | None = None


class Found(NamedTuple):
    """A path that works.

    Args:
        socket: own.
        remote: where to send to.
        channel: of the relay; None without one on our side.
        route: "direct", "punched" or "relayed".
        foreign_relay: address of the peer's relay if it is another one than ours; "" otherwise.
    """

    socket: OwnSocket
    remote: Address
    channel: int | None
    route: str
    foreign_relay: str


class PathAttempt:
    """An attempt to find a path, and the path that came of it; `controlling` chooses among the pairs that work."""

    def __init__(self, binding: Binding, servers: Servers, *, controlling: bool) -> None:
        self._binding = binding
        self._servers = servers
        self._connection = _Connection(binding.addresses, servers, controlling=controlling)
        self._connecting: asyncio.Task[None] | None = None
        self.description = Description(self._connection.local_username, self._connection.local_password, ())
        """Of this end; its candidates are known after `gather`."""

    async def gather(self, patience: float = GATHER_S) -> Description:
        """Open sockets, and ask the servers for addresses outside; wait no longer for them than `patience` [s]."""
        BINDING.set(self._binding)
        self._connection.patience = patience
        await self._connection.gather_candidates()
        for transport in self._binding.sockets:
            protocol: asyncio.DatagramProtocol | None = transport.protocol
            if isinstance(protocol, turn.TurnClientUdpProtocol):
                protocol.channel_refresh_time = PERMISSION_S
                protocol = protocol.receiver
            transport.held = partial(self._connection.accept, protocol)
        # The peer takes no more; what leads outside is worth more than a ninth own address.
        own = sorted(self._connection.local_candidates, key=lambda each: each.type == _HOST)
        candidates = tuple(candidate.to_sdp() for candidate in own[:MOST_CANDIDATES])
        self.description = Description(self.description.username, self.description.password, candidates)
        return self.description

    async def connect(self, remote: Description, timeout: float) -> Found:
        """Try all pairs of addresses; the one that this or the other end nominates is handed back.

        Raises:
            NoPath: none works within `timeout` s.
        """
        BINDING.set(self._binding)
        connection = self._connection
        connection.remote_username, connection.remote_password = remote.username, remote.password
        for line in remote.candidates:
            await connection.add_remote_candidate(aioice.Candidate.from_sdp(line))
        await connection.add_remote_candidate(None)
        self._connecting = asyncio.create_task(connection.connect())
        chosen = asyncio.create_task(connection.chosen.wait())
        try:
            await asyncio.wait({self._connecting, chosen}, timeout=timeout, return_when=asyncio.FIRST_COMPLETED)
        finally:
            chosen.cancel()
        if not connection.chosen.is_set():
            self._connecting.cancel()
            await asyncio.gather(self._connecting, return_exceptions=True)
            raise NoPath
        return self._found(connection.pair, is_mapped(self.description) == is_mapped(remote))

    async def ended(self) -> None:
        """Return when the peer has not answered for 30 s (consent lost, RFC 7675)."""
        await self._connection.get_event()

    async def close(self) -> None:
        """Close all sockets, and tell the relay to forget us."""
        if self._connecting is not None:
            self._connecting.cancel()
            await asyncio.gather(self._connecting, return_exceptions=True)
        await self._connection.close()
        for transport in self._binding.sockets:
            transport.close()

    def _found(self, pair: CandidatePair, is_alike: bool) -> Found:
        """What the nominated pair means; `is_alike` if both ends have an address translated, or neither has."""
        types = {pair.local_candidate.type, pair.remote_candidate.type}
        is_direct = types == {_HOST} and is_alike
        route = "relayed" if _RELAY in types else "direct" if is_direct else "punched"
        transport = pair.protocol.transport
        if isinstance(transport, OwnSocket):
            is_ours = self._servers.turn is not None and self._servers.turn[0] == pair.remote_addr[0]
            foreign = pair.remote_addr[0] if route == "relayed" and not is_ours else ""
            return Found(transport, pair.remote_addr, None, route, foreign)
        for carrier in self._binding.sockets:
            relay = carrier.protocol
            if isinstance(relay, turn.TurnClientUdpProtocol) and relay.receiver is pair.protocol:
                return Found(carrier, relay.server, relay.peer_to_channel[pair.remote_addr], route, "")
        raise AssertionError("the nominated pair is on no socket of ours")


def is_mapped(description: Description) -> bool:
    """Whether a NAT translates an address of this end, as a STUN server saw it."""
    candidates = [aioice.Candidate.from_sdp(line) for line in description.candidates]
    own = {candidate.host for candidate in candidates if candidate.type == _HOST}
    return any(candidate.type == _OUTSIDE and candidate.host not in own for candidate in candidates)


class _Connection(aioice.Connection):
    """ICE with our choice of own addresses, no haste for relays, and none lost after a check that a NAT dropped."""

    def __init__(self, addresses: dict[str, str], servers: Servers, *, controlling: bool) -> None:
        super().__init__(
            ice_controlling=controlling,
            stun_server=servers.stun,
            turn_server=servers.turn,
            turn_username=servers.user,
            turn_password=servers.password,
        )
        # Nominate one pair that works (RFC 8445 section 8.1.1), as aioice does towards such a peer; otherwise it
        # nominates every pair that it checks, and the two ends may take different ones.
        self.remote_is_lite = True
        self._addresses = addresses
        self.patience: float = GATHER_S
        self.chosen = asyncio.Event()
        self._repeated: set[CandidatePair] = set()
        """Pairs whose check had its delay, or its repetition."""

    @property
    def pair(self) -> CandidatePair:
        """The nominated one."""
        return self._nominated[1]

    async def get_component_candidates(
        self,
        component: int,
        addresses: list[str],  # noqa: ARG002 - ours are those of the binding
        timeout: int = 0,  # noqa: ARG002 - ours is `patience`
    ) -> list[aioice.Candidate]:
        return await super().get_component_candidates(component, list(self._addresses), self.patience)  # type: ignore[arg-type]

    def check_complete(self, pair: CandidatePair) -> None:
        super().check_complete(pair)
        if self._nominated:
            self.chosen.set()  # `connect` returns up to 20 ms later

    async def check_start(self, pair: CandidatePair) -> None:
        relays = [pair.local_candidate.type, pair.remote_candidate.type].count(_RELAY)
        if self.ice_controlling and relays and pair not in self._repeated:
            self._repeated.add(pair)
            self.check_state(pair, CandidatePair.State.IN_PROGRESS)
            await asyncio.sleep(RELAY_PATIENCE_S * relays)
        await super().check_start(pair)

    def check_incoming(self, message: stun.Message, addr: Address, protocol: StunProtocol) -> None:
        """Check back at once, as RFC 8445 section 7.3.1.4 says: a NAT may have dropped our check before this one."""
        super().check_incoming(message, addr, protocol)
        if self._nominating:
            return  # the check in progress may be the nomination, which happens once
        for pair in self._check_list:
            if pair.protocol is protocol and pair.remote_addr == addr:
                self._repeat(pair)

    def accept(self, protocol: asyncio.DatagramProtocol | None) -> None:
        """Take the pair that the peer has nominated, and sends on: so our answer has reached it, by this pair."""
        for pair in list(self._check_list):
            is_this = pair.protocol is protocol and pair.remote_nominated
            if is_this and pair.state == CandidatePair.State.IN_PROGRESS:
                if pair.task is not None:
                    pair.task.cancel()
                pair.nominated = True
                self.check_state(pair, CandidatePair.State.SUCCEEDED)
                self.check_complete(pair)

    def _repeat(self, pair: CandidatePair) -> None:
        """Replace a check that was sent before by a new one, once; not one that waits for its turn."""
        if pair.state == CandidatePair.State.IN_PROGRESS and pair.task is not None and pair not in self._repeated:
            self._repeated.add(pair)
            pair.task.cancel()
            pair.task = asyncio.create_task(self.check_start(pair))
