"""How a slave lets itself be found by the masters that it knows."""

import asyncio
from contextlib import suppress

from weberlink.protocol.keys import Right
from weberlink_anywhere import ice
from weberlink_anywhere.hand_over import ENGAGED, GONE, SessionState
from weberlink_anywhere.master_finder import CALL_S, CONNECT_S, SILENCE_S
from weberlink_anywhere.networks import Watch
from weberlink_anywhere.order import FinderOrder
from weberlink_anywhere.paths import Paths
from weberlink_anywhere.peers import Peer, PeerError, PeerStore
from weberlink_anywhere.rendezvous import Waiter
from weberlink_anywhere.signalling import Answer, Busy, Description, Offer

LOOK_S = 0.3
"""Between two looks at the known peers."""
RENEWAL_GROWTH, LONGEST_RENEWAL_S = 5.0, 10.0
"""While there is no session after one, the mailbox is connected anew after 0.2, 1, 5 and 25 s."""


class SlaveFinder:
    """Answers the calls of known masters; one of them is served."""

    def __init__(self, order: FinderOrder, store: PeerStore, paths: Paths) -> None:
        self._order, self._store, self._paths = order, store, paths
        self._peers: list[Peer] = []
        self._waiter = Waiter(order.mailbox, self._note)
        self._finding: dict[str, asyncio.Task[None]] = {}
        self._renewal: asyncio.TimerHandle | None = None

    def hear(self, state: SessionState) -> None:
        """Take the state of a session."""
        self._paths.sessions[state.peer] = state.state
        self._waiter.serves = self._served
        if self._renewal is not None:
            self._renewal.cancel()
            self._renewal = None
        if state.state != ENGAGED:
            self._renew_later(SILENCE_S)

    def _renew_later(self, delay: float) -> None:
        """What cut the session may have cut the connection to the mailbox too, which is noticed later there."""

        def renew() -> None:
            self._waiter.renew()
            if delay < LONGEST_RENEWAL_S:
                self._renew_later(RENEWAL_GROWTH * delay)

        self._renewal = asyncio.get_running_loop().call_later(delay, renew)

    @property
    def _served(self) -> str | None:
        """Name of the master that has a session."""
        return next((peer for peer, state in self._paths.sessions.items() if state != GONE), None)

    async def run(self) -> None:
        """Answer until cancelled."""
        watch = Watch(self._waiter.renew, self._order.interfaces)
        looking = asyncio.create_task(self._look_for_peers())
        try:
            await self._waiter.serve(self.answer)
        finally:
            looking.cancel()
            watch.close()
            for task in self._finding.values():
                task.cancel()

    async def _look_for_peers(self) -> None:
        """Wait for those that the store has now; who was removed, or has another key, is left."""
        while True:
            with suppress(PeerError):  # no folder: as before
                wanted = self._order.peers
                known = (peer.for_stream(self._order.stream) for peer in self._store.usable())
                peers = [peer for peer in known if peer.role == "master"]
                peers = [peer for peer in peers if not wanted or peer.label in wanted]
                for name in {peer.name for peer in self._peers} - {peer.name for peer in peers}:
                    if (finding := self._finding.pop(name, None)) is not None:
                        finding.cancel()
                    self._paths.forget(name)
                self._peers = peers
                self._waiter.meet(peers)
            await asyncio.sleep(LOOK_S)

    async def answer(self, peer: Peer, offer: Offer) -> Answer | Busy:
        """Prepare as many paths as offered, and begin to find them."""
        served = self._served
        if served not in (None, peer.name) and not offer.take_over and peer.right is Right.DRIVE:
            return Busy(served or "")
        if (former := self._finding.pop(peer.name, None)) is not None:
            former.cancel()
        try:
            attempts = await self._paths.prepare(min(self._order.paths, len(offer.paths)), controlling=False)
        except ice.NoPath as problem:
            self._paths.news(peer.name, f"{peer.label} called: {problem}")
            return Answer(())
        self._finding[peer.name] = asyncio.create_task(self._find(peer, attempts, offer.paths))
        return Answer(tuple(attempt.description for attempt in attempts))

    async def _find(self, peer: Peer, attempts: list[ice.PathAttempt], remotes: tuple[Description, ...]) -> None:
        # The master begins when the answer has reached it.
        patience = CALL_S + CONNECT_S
        results = await asyncio.gather(
            *(
                self._paths.use(peer.name, place, attempt, remote, patience)
                for place, (attempt, remote) in enumerate(zip(attempts, remotes, strict=False))
            ),
            return_exceptions=True,
        )
        if all(isinstance(result, ice.NoPath) for result in results):
            self._paths.news(peer.name, f"{peer.label} called, and no path to it was found")

    def _note(self, text: str) -> None:
        """The mailbox is the same for all."""
        for peer in self._peers:
            self._paths.news(peer.name, text)
