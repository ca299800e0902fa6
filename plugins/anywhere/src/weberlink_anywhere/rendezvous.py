"""Meeting a known peer at the mailbox server: a master calls, a slave waits to be called."""

import asyncio
import os
import random
from collections.abc import Awaitable, Callable, Iterator, Sequence
from contextlib import suppress
from typing import Final, TypeVar

from weberlink.protocol.keys import Right
from weberlink_anywhere.calls import Called, IncomingCalls, Message, OutgoingCall, Ready
from weberlink_anywhere.mailbox import Mailbox, MailboxRefuses, Received, open_mailbox, sweep
from weberlink_anywhere.peers import Peer
from weberlink_anywhere.sealing import Sealing
from weberlink_anywhere.signalling import (
    Answer,
    Busy,
    Description,
    Handler,
    MailboxUnreachable,
    Note,
    PeerAbsent,
    Presence,
)

CALL_AGAIN_S: Final = 5.0
"""Without a word of the peer, a master connects and calls again."""
ANSWER_LIMIT_S: Final = 15.0
"""From an offer to its answer; the slave gathers its candidates meanwhile."""
RENEW_S: Final = 60.0
"""A slave that waits connects anew: it empties a mailbox of `MANY`, and hears again if somebody else emptied it."""
FORGOTTEN_S: Final = 1020.0
"""After so long without a connection a server has forgotten a mailbox, also a crowded one: 11 + 5 minutes, and one."""
STALE_S: Final = 30.0
"""A call that the server held for longer is not answered: its master has called again, or gone."""
FIRST_PAUSE_S: Final = 0.25
LONGEST_PAUSE_S: Final = 5.0
MANY: Final = 64
"""Messages at which a slave that connects empties a quiet mailbox, since everyone who opens it gets them all."""
TOO_MANY: Final = 1024
"""The same for one that is not quiet, and for a master: while a slave waits, so many do not gather."""
QUIET_S: Final = 10.0
"""A call that began longer ago is over; who has a mailbox open that is emptied hears nothing more."""

Told = TypeVar("Told")


class Caller:
    """A master's way to one slave, by a mailbox server."""

    def __init__(self, peer: Peer, mailbox: str) -> None:
        self._peer, self._url = peer, mailbox
        self._sealing = Sealing(peer.key, "master")
        self._is_heard = self._may_be_full = False

    async def call(self, paths: Sequence[Description], take_over: bool, timeout: float) -> Answer | Busy:
        """Offer paths, and wait for the answer; may be called again, also while the session lives.

        Raises:
            PeerAbsent: no answer within `timeout` s.
            MailboxUnreachable: the server was not reached within `timeout` s, or refuses.
        """

        async def offer(mailbox: Mailbox) -> Answer | Busy | None:
            call = OutgoingCall(self._sealing, os.urandom)
            if await self._begin(mailbox, call) is None:
                return None
            await mailbox.add(call.offer(paths, take_over))
            told = await _hear(mailbox, call, ANSWER_LIMIT_S)
            return told if isinstance(told, Answer | Busy) else None

        return await self._persist(offer, timeout)

    async def ask(self, timeout: float) -> Ready:
        """Ask whether the slave waits, without calling it.

        Raises:
            PeerAbsent, MailboxUnreachable: as `call`.
        """

        async def begin(mailbox: Mailbox) -> Ready | None:
            return await self._begin(mailbox, OutgoingCall(self._sealing, os.urandom))

        return await self._persist(begin, timeout)

    async def _begin(self, mailbox: Mailbox, call: OutgoingCall) -> Ready | None:
        if self._may_be_full:
            self._may_be_full = False
            await mailbox.stored()
            if mailbox.count >= TOO_MANY:
                await sweep(self._url, self._sealing)
                return None
        await mailbox.add(call.first())
        told = await _hear(mailbox, call, CALL_AGAIN_S)
        if isinstance(told, Ready):
            self._is_heard = True
            return told
        self._may_be_full = mailbox.count >= TOO_MANY
        return None

    async def _persist(self, converse: Callable[[Mailbox], Awaitable[Told | None]], timeout: float) -> Told:
        """Connect and converse until something comes of it."""
        outage: MailboxUnreachable | None = MailboxUnreachable(f"the mailbox server {self._url} does not answer")
        self._is_heard = False
        pauses = _pauses()
        with suppress(TimeoutError):
            async with asyncio.timeout(timeout):
                while True:
                    try:
                        async with open_mailbox(self._url, self._sealing) as mailbox:
                            outage = None
                            told = await converse(mailbox)
                            if told is not None:
                                return told
                    except MailboxRefuses:
                        raise
                    except MailboxUnreachable as problem:
                        outage = problem
                        await asyncio.sleep(next(pauses))
        raise outage or PeerAbsent(self._absence())

    def _absence(self) -> str:
        if self._is_heard:
            return f"{self._peer.label} is there, and does not answer"
        return f"{self._peer.label} is not there: no slave waits for this host at the mailbox server {self._url}"


async def presence(peer: Peer, timeout: float) -> Presence:
    """Ask a slave whether it waits, by the mailbox server of its pairing; says in `note` what failed."""
    if peer.role == "master":
        return Presence(False, note="an operator calls, and does not wait to be called")
    if not peer.mailbox:
        return Presence(False, note="no mailbox server is known for it")
    try:
        ready = await Caller(peer, peer.mailbox).ask(timeout)
    except PeerAbsent:
        return Presence(False)
    except MailboxUnreachable as problem:
        return Presence(False, note=str(problem))
    return Presence(True, ready.serves)


class Waiter:
    """A slave that waits for the masters that it knows; `note` takes what happens to the mailbox server."""

    def __init__(self, mailbox: str, note: Note, too_many: int = TOO_MANY) -> None:
        self.serves: str | None = None
        """Name of the master that is served now, as told to those who ask; set by the owner."""
        self._url, self._note, self.too_many = mailbox, note, too_many
        self._lines: dict[Peer, tuple[_Line, asyncio.Task[None]]] = {}
        self._outages: dict[str, str] = {}
        self._begin: Callable[[Peer], None] = lambda _peer: None
        self._peers: Sequence[Peer] = ()

    def meet(self, peers: Sequence[Peer]) -> None:
        """Wait for these peers from now on, and for no others."""
        self._peers = peers
        for peer in [peer for peer in self._lines if peer not in peers]:
            line, attending = self._lines.pop(peer)
            attending.cancel()
            line.cancel()
            self._outages.pop(peer.label, None)
        for peer in peers:
            if peer not in self._lines:
                self._begin(peer)

    async def serve(self, handler: Handler) -> None:
        """Answer every offer by `handler`, until cancelled; survives outages of the server.

        A newer offer of the same peer cancels the handler of the older one. What a handler raises ends it, in an
        `ExceptionGroup`.
        """
        async with asyncio.TaskGroup() as tasks:

            def begin(peer: Peer) -> None:
                line = _Line(peer, self._url, self)
                self._lines[peer] = line, tasks.create_task(line.attend(handler, tasks))

            self._begin = begin
            self.meet(self._peers)
            await asyncio.Future()

    def renew(self) -> None:
        """Connect to the server anew, since the addresses of this host changed."""
        for line, _ in self._lines.values():
            line.renew()

    def lost(self, label: str, problem: MailboxUnreachable) -> None:
        """The line to a peer is lost; one note for each outage."""
        refuses = isinstance(problem, MailboxRefuses)
        outage = f"{label}: {problem}" if refuses else f"the mailbox server {self._url} is not reached"
        if outage not in self._outages.values():
            self._note(f"{outage if refuses else problem}; trying again")
        self._outages[label] = outage

    def reached(self, label: str) -> None:
        """The line to a peer works."""
        outage = self._outages.pop(label, None)
        if outage is not None and outage not in self._outages.values():
            self._note(f"the mailbox server {self._url} is reached again")


class _Line:
    """The connection by which a slave waits for one master."""

    def __init__(self, peer: Peer, url: str, waiter: Waiter) -> None:
        self._peer, self._url, self._waiter = peer, url, waiter
        self._sealing = Sealing(peer.key, "slave")
        self._calls = IncomingCalls(self._sealing, os.urandom)
        self._mailbox: Mailbox | None = None
        self._unsent: Message | None = None
        self._handling: asyncio.Task[None] | None = None
        self._limit: asyncio.Timeout | None = None

    def cancel(self) -> None:
        """End the handler of the newest offer."""
        if self._handling is not None:
            self._handling.cancel()

    def renew(self) -> None:
        if self._limit is not None:
            with suppress(RuntimeError):  # it is ending already
                self._limit.reschedule(asyncio.get_running_loop().time())

    async def attend(self, handler: Handler, tasks: asyncio.TaskGroup) -> None:
        pauses, is_swept = _pauses(), False
        while True:
            try:
                with suppress(TimeoutError):
                    async with (
                        asyncio.timeout(RENEW_S) as self._limit,
                        open_mailbox(self._url, self._sealing) as mailbox,
                    ):
                        stored = await mailbox.stored()
                        self._waiter.reached(self._peer.label)
                        pauses = _pauses()
                        is_swept = not is_swept and self._is_full(mailbox, stored)
                        if is_swept:  # once, also if the server keeps what it should delete
                            await sweep(self._url, self._sealing)
                            continue
                        await self._listen(mailbox, stored, handler, tasks)
            except MailboxUnreachable as problem:
                self._waiter.lost(self._peer.label, problem)
                pause = FORGOTTEN_S if isinstance(problem, MailboxRefuses) else next(pauses)
                with suppress(TimeoutError):
                    async with asyncio.timeout(pause) as self._limit:
                        await asyncio.Future()

    async def _listen(
        self, mailbox: Mailbox, stored: list[Received], handler: Handler, tasks: asyncio.TaskGroup
    ) -> None:
        """Take calls until the connection is lost."""
        self._mailbox = mailbox
        try:
            await self._flush()
            for received in stored:
                if received.age < STALE_S:
                    await self._take(mailbox, received.message, handler, tasks)
            async for received in mailbox:
                await self._take(mailbox, received.message, handler, tasks)
        finally:
            self._mailbox = None

    def _is_full(self, mailbox: Mailbox, stored: list[Received]) -> bool:
        is_handling = self._unsent is not None or (self._handling is not None and not self._handling.done())
        is_quiet = not is_handling and all(each.age > QUIET_S for each in stored)
        return mailbox.count >= (MANY if is_quiet else self._waiter.too_many)

    async def _take(self, mailbox: Mailbox, message: Message, handler: Handler, tasks: asyncio.TaskGroup) -> None:
        now = asyncio.get_running_loop().time()
        serves = None if self._peer.right is Right.STOP else self._waiter.serves
        match self._calls.receive(message, now, serves):
            case Message() as ready:
                await mailbox.add(ready)
            case Called() as called:
                self.cancel()
                self._handling = tasks.create_task(self._handle(called, handler))

    async def _handle(self, called: Called, handler: Handler) -> None:
        told = await handler(self._peer, called.offer)
        self._unsent = self._calls.reply(called, told)
        await self._flush()

    async def _flush(self) -> None:
        """Send the newest answer, now or with the next connection."""
        if self._mailbox is None or self._unsent is None:
            return
        message, self._unsent = self._unsent, None
        try:
            await self._mailbox.add(message)
        except MailboxUnreachable:
            self._unsent = message


async def _hear(mailbox: Mailbox, call: OutgoingCall, limit: float) -> Ready | Answer | Busy | None:
    """What the peer tells of a call within `limit` s."""
    with suppress(TimeoutError):
        async with asyncio.timeout(limit):
            async for received in mailbox:
                told = call.receive(received.message)
                if told is not None:
                    return told
    return None


def _pauses() -> Iterator[float]:
    """Seconds between attempts to connect: doubled each time, and scattered, so that not all come back at once."""
    pause = FIRST_PAUSE_S
    while True:
        yield pause * random.uniform(0.5, 1.5)  # noqa: S311 - no secret
        pause = min(2 * pause, LONGEST_PAUSE_S)
