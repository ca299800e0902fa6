"""How a master finds paths to its slave, and when it calls again."""

import asyncio
from contextlib import suppress
from itertools import count
from time import monotonic

from weberlink_anywhere import ice
from weberlink_anywhere.hand_over import ENGAGED, SILENT, SessionState
from weberlink_anywhere.networks import Watch
from weberlink_anywhere.order import FinderOrder
from weberlink_anywhere.paths import Paths, ServerNames
from weberlink_anywhere.peers import Peer
from weberlink_anywhere.rendezvous import Caller
from weberlink_anywhere.signalling import Busy, Description, MailboxUnreachable, PeerAbsent, SignallingError

CALL_S = 6.0
"""For the answer of a slave that is there."""
CONNECT_S = 6.0
"""For a path: a check that is lost is repeated after 0.5, 1.5 and 3.5 s."""
NEAR_S = 2.0
"""For a path in the same network, where no server can be reached."""
SILENCE_S = 0.2
"""Of this length beyond the silence limit, a hole in the path is taken for its end."""
ABSENT_S, UNREACHABLE_S = 30.0, 10.0
"""How long, before the first path, a slave or the mailbox may be missing."""
TRIES = 2
"""Calls before the first path, where the second one may do better."""
PAUSES_S = (0.5, 1.0, 2.0, 4.0)
"""Between calls that come to nothing; the last one again and again."""
QUICK_TRIES, QUICK_S = 2, 1.0
"""Once there was a session, calls that are given up when no server answers so soon. Where the outage is, or that of the
relay, a call that waits longer comes to nothing, and keeps the next one waiting."""
SESSION_S = 2.0
"""For the first session, once there is a path: twenty HELLOs (weberlink.protocol.handshake)."""
LACK_S = 15.0
"""Between calls, while a session lives on fewer paths than it could have."""


class Refused(Exception):  # noqa: N818 - the condition is the name
    """The slave serves another master; the message is one line for a person."""


class MasterFinder:
    """Calls a slave until there is a path, and again when the session is silent or the networks have changed."""

    def __init__(self, order: FinderOrder, peer: Peer, caller: Caller, paths: Paths) -> None:
        self._order, self._peer, self._caller, self._paths = order, peer, caller, paths
        self._was_found = False
        self._expected = self._fruitless = 0
        self._changed = asyncio.Event()
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
            self._fruitless = 0
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

    def _on_networks(self) -> None:
        self._reason.set()
        self._changed.set()

    async def _wait_for_reason(self) -> None:
        """Return when another path is needed; also, after a while, without a session or with too few paths."""
        while not self._reason.is_set():
            patience = self._patience
            try:
                await asyncio.wait_for(self._reason.wait(), patience)
            except TimeoutError:
                if self._patience == patience:
                    break
        self._fruitless = self._fruitless + 1 if self._is_down else 0

    @property
    def _is_down(self) -> bool:
        return self._paths.sessions.get(self._peer.name) != ENGAGED

    @property
    def _patience(self) -> float | None:
        """How long to wait for a reason before calling again without one [s]; None for ever."""
        if self._is_down:
            return self._pause + (SILENCE_S if self._was_engaged else SESSION_S)
        return LACK_S if self._paths.count(self._peer.name) < self._expected else None

    @property
    def _pause(self) -> float:
        return PAUSES_S[min(self._fruitless, len(PAUSES_S) - 1)]

    async def _find(self) -> bool:
        """Call until there is a path; False if there will be none."""
        started, last = monotonic(), ""
        for tries in count(1):
            self._reason.clear()
            self._changed.clear()
            problem = await self._call_until_change()
            if problem is None:
                self._was_found = True
                self._reason.clear()  # what happened meanwhile was to the former path
                return True
            is_final = not self._was_found and is_hopeless(problem, tries, monotonic() - started)
            if is_final or str(problem) != last:
                last = str(problem)
                self._paths.news(self._peer.name, last, is_final=is_final)
            if is_final:
                return False
            self._fruitless += 1
            with suppress(TimeoutError):
                await asyncio.wait_for(self._reason.wait(), self._pause)
        raise AssertionError("count() does not end")

    async def _call_until_change(self) -> Exception | None:
        """Why a call came to nothing; it is given up, and another one begun, when the networks change."""
        while True:
            call = asyncio.create_task(self._call())
            changed = asyncio.create_task(self._changed.wait())
            try:
                await asyncio.wait({call, changed}, return_when=asyncio.FIRST_COMPLETED)
                if call.done():
                    call.result()
                    return None
                self._changed.clear()
            except FAILURES as problem:
                return problem
            finally:
                call.cancel()
                changed.cancel()
                await asyncio.gather(call, changed, return_exceptions=True)

    async def _call(self) -> None:
        """Offer paths, and find those that the answer allows; the first is enough.

        Raises:
            Refused, NoPath, PeerAbsent, MailboxUnreachable: the message is one line for a person.
        """
        is_quick = self._was_engaged and self._fruitless < QUICK_TRIES
        patience = QUICK_S if is_quick else ice.GATHER_S
        attempts = await self._paths.prepare(self._order.paths, controlling=True, patience=patience)
        left = list(attempts)
        try:
            offered = [attempt.description for attempt in attempts]
            if is_quick and self._paths.servers.asked and not any(each.reaches_server for each in offered):
                raise await why_none(self._peer.label, self._paths.servers, offered, tuple(offered))
            reply = await self._caller.call(offered, self._order.take_over and not self._was_engaged, CALL_S)
            if isinstance(reply, Busy):
                raise Refused(f"{self._peer.label} serves {reply.serves} now; --take-over replaces it")
            far = all(any(each.reaches_server for each in end) for end in (offered, reply.paths))
            patience = CONNECT_S if far or not self._paths.servers.asked else NEAR_S
            uses = [
                self._paths.use(self._peer.name, place, attempt, remote, patience)
                for place, (attempt, remote) in enumerate(zip(attempts, reply.paths, strict=False))
            ]
            del left[: len(uses)]
            self._expected = len(uses)
            results = await asyncio.gather(*uses, return_exceptions=True)
        finally:
            await self._paths.drop(left)
        for result in results:
            if isinstance(result, BaseException) and not isinstance(result, ice.NoPath):
                raise result
        failed = [place for place, result in enumerate(results) if result is not None]
        if len(failed) == len(results):
            raise await why_none(self._peer.label, self._paths.servers, offered, reply.paths)
        if failed:
            self._paths.news(self._peer.name, f"{len(results) - len(failed)} of {len(results)} paths found")


FAILURES = (Refused, ice.NoPath, SignallingError)


def is_hopeless(problem: Exception, tries: int, seconds: float) -> bool:
    """Whether to give up, before there ever was a path: why the last call failed, calls so far, since the first one."""
    if isinstance(problem, PeerAbsent):
        return seconds >= ABSENT_S
    if isinstance(problem, MailboxUnreachable):
        return seconds >= UNREACHABLE_S
    return isinstance(problem, Refused | Blocked) or tries >= TRIES


class Blocked(ice.NoPath):
    """Another try would not help."""


async def why_none(
    label: str, servers: ServerNames, offered: list[Description], answered: tuple[Description, ...]
) -> ice.NoPath:
    """Why no path to a peer was found, from what the servers told both ends."""
    here, there = (any(each.reaches_server for each in end) for end in (offered, answered))
    if not answered:
        reason = "it is not connected by the network interfaces that its file names"
    elif servers.asked and not here and await servers.answers_tcp():
        reason = f"UDP is blocked between here and {servers.asked}"
    elif servers.asked and not here:
        reason = f"{servers.asked} does not answer from here; it is down, or UDP is blocked"
    elif servers.asked and not there:
        reason = f"UDP is blocked between {label} and its relay"
    elif servers.relay and not any(each.has("relay") for each in offered):
        reason = f"the relay {servers.relay} refuses; compare the secret of link.finder.turn with that of the relay"
    elif not any(each.has("relay") for each in (*offered, *answered)):
        reason = "the two NATs let nothing through, and there is no relay; set link.finder.turn"
    else:
        return ice.NoPath(f"no path to {label}: nothing came through within {CONNECT_S:g} s, also by the relay")
    return Blocked(f"no path to {label}: {reason}")
