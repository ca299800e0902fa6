"""How a master finds paths to its slave, and when it calls again."""

import asyncio
from contextlib import suppress
from math import inf
from time import monotonic

from weberlink.anywhere import ice
from weberlink.anywhere.networks import Networks, Watch
from weberlink.anywhere.order import FinderOrder
from weberlink.anywhere.paths import Paths, ServerNames
from weberlink.anywhere.peers import Peer
from weberlink.anywhere.rendezvous import Caller
from weberlink.anywhere.signalling import Answer, Busy, Description, MailboxUnreachable, PeerAbsent
from weberlink.protocol.aio.hand_over import ENGAGED, SILENT, SessionState

CALL_S = 5.0
"""For the answer of a slave that is there."""
CONNECT_S = 6.0
"""For a path: a check that is lost is repeated after 0.5, 1.5 and 3.5 s."""
SILENCE_S = 0.2
"""Of this length beyond the silence limit, a hole in the path is taken for its end."""
ABSENT_S, UNREACHABLE_S = 30.0, 10.0
"""How long, before the first path, a slave or the mailbox may be missing."""
TRIES = 2
"""Before the first path, without success, of which the first was no fault of blocked UDP."""
PAUSES_S = (0.5, 1.0, 2.0, 4.0)
"""Between calls that come to nothing; the last one again and again."""


class Refused(Exception):  # noqa: N818 - the condition is the name
    """The slave serves another master; the message is one line for a person."""


class Calling:
    """Calls a slave until there is a path, and again when the session is silent or the networks have changed.

    Args:
        order: of the daemon.
        peer: the slave.
        caller: the way to it before there is a path.
        paths: takes what is found.
    """

    def __init__(self, order: FinderOrder, peer: Peer, caller: Caller, paths: Paths) -> None:
        self._order = order
        self._peer = peer
        self._caller = caller
        self._paths = paths
        self._was_found = False
        self._was_engaged = False
        self._reason = asyncio.Event()
        self._silence: asyncio.TimerHandle | None = None
        paths.lost = self._reason.set

    def hear(self, state: SessionState) -> None:
        """Take the state of the session."""
        self._paths.sessions[state.peer] = state.state
        if self._silence is not None:
            self._silence.cancel()
            self._silence = None
        if state.state == ENGAGED:
            self._was_engaged = True
        elif self._was_engaged:
            delay = SILENCE_S if state.state == SILENT else 0.0
            self._silence = asyncio.get_running_loop().call_later(delay, self._reason.set)

    async def run(self) -> None:
        """Find paths until cancelled."""
        watch = Watch(self._on_networks, self._order.interfaces)
        try:
            while await self._find():
                await self._wait_for_reason()
            await asyncio.Event().wait()  # said why there will be no path; the daemon ends this process
        finally:
            watch.close()

    def _on_networks(self, networks: Networks) -> None:
        if networks.of(self._order.interfaces):
            self._reason.set()

    async def _wait_for_reason(self) -> None:
        """Return when another path is needed; soon if the session did not come back on the last one."""
        patience = iter(PAUSES_S)
        while not self._reason.is_set():
            pause = next(patience, PAUSES_S[-1]) + SILENCE_S if self._is_down else None
            with suppress(TimeoutError):
                await asyncio.wait_for(self._reason.wait(), pause)
            if self._is_down:
                break

    @property
    def _is_down(self) -> bool:
        return self._was_engaged and self._paths.sessions.get(self._peer.name) != ENGAGED

    async def _find(self) -> bool:
        """Call until there is a path; False if there will be none."""
        started, tries, last = monotonic(), 0, ""
        while True:
            self._reason.clear()
            limit, at_most = inf, 0
            try:
                await self._call()
            except (Refused, _Blocked) as problem:
                text, limit = str(problem), 0.0
            except ice.NoPath as problem:
                text, at_most = str(problem), TRIES
            except PeerAbsent as problem:
                text, limit = str(problem), ABSENT_S
            except MailboxUnreachable as problem:
                text, limit = str(problem), UNREACHABLE_S
            else:
                self._was_found = True
                return True
            tries += 1
            is_final = not self._was_found and (monotonic() - started >= limit or tries == at_most)
            if is_final or text != last:
                self._paths.news(self._peer.name, text, is_final=is_final)
            if is_final:
                return False
            last = text
            with suppress(TimeoutError):
                await asyncio.wait_for(self._reason.wait(), PAUSES_S[min(tries, len(PAUSES_S)) - 1])

    async def _call(self) -> None:
        """Offer paths, and find those that the answer allows; the first is enough.

        Raises:
            Refused, NoPath, PeerAbsent, MailboxUnreachable: the message is one line for a person.
        """
        attempts = await self._paths.prepare(self._order.paths, controlling=True)
        left = list(attempts)
        try:
            offered = [attempt.description for attempt in attempts]
            reply = await self._caller.call(offered, self._order.take_over, CALL_S)
            if isinstance(reply, Busy):
                raise Refused(f"{self._peer.label} serves {reply.serves} now; --take-over replaces it")
            uses = [
                self._paths.use(self._peer.name, place, attempt, remote, CONNECT_S)
                for place, (attempt, remote) in enumerate(zip(attempts, reply.paths, strict=False))
            ]
            del left[: len(uses)]
            results = await asyncio.gather(*uses, return_exceptions=True)
        finally:
            await self._paths.drop(left)
        for result in results:
            if isinstance(result, BaseException) and not isinstance(result, ice.NoPath):
                raise result
        failed = [place for place, result in enumerate(results) if result is not None]
        if len(failed) == len(results):
            raise self._reason_for(offered, reply)
        if failed:
            self._paths.news(self._peer.name, f"{len(results) - len(failed)} of {len(results)} paths found")

    def _reason_for(self, offered: list[Description], reply: Answer) -> ice.NoPath:
        return why_none(self._peer.label, self._paths.servers, offered, reply.paths)


class _Blocked(ice.NoPath):
    """Another try would not help."""


def why_none(
    label: str, servers: ServerNames, offered: list[Description], answered: tuple[Description, ...]
) -> ice.NoPath:
    """Why no path to a peer was found, from what the servers told both ends."""
    here, there = any(map(ice.reaches_server, offered)), any(map(ice.reaches_server, answered))
    if servers.asked and not here:
        return _Blocked(f"no path to {label}: UDP is blocked between here and {servers.asked}")
    if servers.asked and not there:
        return _Blocked(f"no path to {label}: UDP is blocked between {label} and its relay")
    if servers.relay and not any(map(ice.has_relay, offered)):
        return _Blocked(f"no path to {label}: the relay {servers.relay} refuses; compare the secret with its own")
    if not any(map(ice.has_relay, (*offered, *answered))):
        return _Blocked(f"no path to {label}: the two NATs let nothing through, and there is no relay; set link.turn")
    return ice.NoPath(f"no path to {label}: nothing came through within {CONNECT_S:g} s, also by the relay")
