"""The process that pairs two hosts by a code, through a magic-wormhole mailbox server.

The code is the password of a SPAKE2 exchange: whoever does not know it has one guess among 65,536 pairs of words, and
that guess ends the invitation. The mailbox sees sealed messages, addresses and times. `key_confirmation` tells what the
two hosts say to each other, and `PairingOrder` how a command talks to this process.
"""

import json
import os
import shlex
import sys
import time
from collections.abc import Callable, Coroutine
from contextlib import suppress
from difflib import get_close_matches
from pathlib import Path
from typing import Any, TextIO

from twisted.internet import reactor as _reactor
from twisted.internet.defer import CancelledError, Deferred, TimeoutError as DeferredTimeoutError
from twisted.internet.main import CONNECTION_DONE
from twisted.logger import globalLogBeginner
from wormhole import create, errors
from wormhole._wordlist import byte_to_even_word, byte_to_odd_word, even_words_lowercase, odd_words_lowercase

from weberlink.protocol.keys import KEY_BYTES, Right
from weberlink.realtime.process import conceal_memory
from weberlink.text import one_line
from weberlink_anywhere import key_confirmation
from weberlink_anywhere.key_confirmation import (
    CONFIRM,
    HELLO,
    KEPT,
    NONCE,
    NONCE_BYTES,
    REFUSED,
    Names,
    PairingError,
    RefusedThereError,
)
from weberlink_anywhere.order import PairingOrder
from weberlink_anywhere.peers import Peer, PeerError, PeerStore, default_folder

reactor: Any = _reactor
APP = "weberlink/pairing/1"
"""Pairings are apart from all else on the same mailbox server, and from those of another version."""
PURPOSE = "weberlink pairing"
FAREWELL_S = 3.0
"""How long the mailbox server may take to let us go."""
Tell = Callable[[str, str], None]
"""Takes a key of `PairingOrder`, and its text."""
Consent = Callable[[], "Deferred[bool]"]
"""Asks the person at the robot whether both hosts show the same words."""


class PairingSession:
    """One pairing, by magic-wormhole; `tell` takes what the user is to see, `consent` asks the one at the robot."""

    def __init__(self, order: PairingOrder, tell: Tell, consent: Consent) -> None:
        self._order, self._tell, self._consent = order, tell, consent
        self._store = PeerStore(Path(order.store))
        self._code = order.code
        self._is_connected = False

    async def run(self) -> Peer:
        """Pair; returns the peer, which is in the store.

        Raises:
            PairingError, CancelledError: they did not; nothing is kept.
        """
        self._check_words()
        self._wormhole: Any = create(APP, self._order.mailbox, reactor, on_status_update=self._on_status)
        try:
            return await self._pair()
        finally:
            with suppress(Exception):  # its outcome is that of the pairing
                await self._wormhole.close().addTimeout(FAREWELL_S, reactor)

    async def _pair(self) -> Peer:
        order, hole = self._order, self._wormhole
        await self._soon(hole.get_welcome(), f"the mailbox {order.mailbox} does not answer")
        if order.code:
            hole.set_code(order.code)
            late = f"nobody waits with the code {order.code}: it was used, or it has expired; ask for a new one"
            await self._soon(hole.get_unverified_key(), late)
        else:
            hole.allocate_code()
            self._code = await self._soon(hole.get_code(), f"the mailbox {order.mailbox} gave no code")
            self._tell("code", self._code)
            late = f"nobody joined within {order.lifetime_s / 60:g} min; invite again for a new code"
            await self._in_time(hole.get_unverified_key(), order.lifetime_s, late)
        self._tell("note", "the other host is there; comparing codes")
        await self._soon(hole.get_verifier(), "the other host stopped answering")
        try:
            return await self._introduce(hole.derive_key(PURPOSE, KEY_BYTES))
        except RefusedThereError:
            raise
        except (PairingError, CancelledError) as error:
            hole.send_message(key_confirmation.message(REFUSED, str(error) or "the pairing was ended there"))
            raise

    async def _introduce(self, secret: bytes) -> Peer:
        order, send = self._order, self._wormhole.send_message
        other = "slave" if order.side == "master" else "master"
        nonce, is_master = os.urandom(NONCE_BYTES), order.side == "master"
        send(key_confirmation.hello(order.side, order.name, key_confirmation.commitment(nonce) if is_master else ""))
        hello = await self._next(HELLO)
        name = key_confirmation.name_in(hello, order.side)
        label = order.label or name.replace("/", "-").lstrip(".") or other  # it names a file
        names = Names(order.name, name) if order.side == "master" else Names(name, order.name)
        self._refuse_known(label, name, other)
        if not is_master:  # only now: the commitment of the master has arrived
            send(key_confirmation.message(NONCE, nonce.hex()))
        theirs = key_confirmation.nonce_in(await self._next(NONCE), None if is_master else str(hello.get("commitment")))
        if is_master:
            send(key_confirmation.message(NONCE, nonce.hex()))
        nonces = (nonce, theirs) if is_master else (theirs, nonce)
        even, odd = key_confirmation.words_to_compare(secret, names, *nonces)
        self._tell("words", f"{byte_to_even_word[bytes([even])]} {byte_to_odd_word[bytes([odd])]}".lower())
        if not is_master and not order.accept:
            self._tell("asks", name)
            late = f"nobody compared the words within {order.consent_s:g} s"
            if not await self._in_time(self._consent(), order.consent_s, late):
                raise PairingError("the person at the robot did not confirm the words")
        send(key_confirmation.message(CONFIRM, key_confirmation.confirmation(secret, names, order.side)))
        if not key_confirmation.is_confirmed(await self._next(CONFIRM, order.consent_s), secret, names, other):
            raise PairingError("the other host confirmed other names than these two")
        key = key_confirmation.pair_key(secret, names)
        right = Right.DRIVE if is_master else Right(order.right)  # what the master knows of it does not count
        peer = Peer(label, name, order.name, other, key, order.mailbox, time.time(), right)  # type: ignore[arg-type]
        try:
            self._store.add(peer)
        except PeerError as error:
            raise PairingError(str(error)) from None
        try:
            send(key_confirmation.message(KEPT, True))
            await self._next(KEPT)
        except BaseException:
            self._store.remove(peer.label)
            raise
        return peer

    def _refuse_known(self, label: str, name: str, role: str) -> None:
        """A name stands for one key, so that a new pairing replaces nothing unseen."""
        try:
            known = next((p for p in self._store if p.label == label or (p.name, p.role) == (name, role)), None)
        except PeerError as error:
            raise PairingError(str(error)) from None
        if known is not None:
            line = shlex.join(["weberlink", "peer", known.label, "--remove"])
            if self._store.folder != default_folder():
                line += f" --store {self._store.folder}"
            raise PairingError(f"{self._order.name} knows {name} already; remove it on that host first: {line}")

    async def _next(self, kind: str, more_s: float = 0.0) -> Any:
        late = f"the other host stopped answering before its {kind!r}"
        if kind == KEPT:
            late += "; if it says that it paired, remove this host there (weberlink peer) before you pair again"
        limit_s = self._order.patience_s + more_s
        return key_confirmation.read(await self._in_time(self._wormhole.get_message(), limit_s, late), kind)

    async def _soon(self, result: Any, late: str) -> Any:
        return await self._in_time(result, self._order.patience_s, late)

    async def _in_time(self, result: Any, limit_s: float, late: str) -> Any:
        """What magic-wormhole gives; all its errors arrive here."""
        try:
            return await result.addTimeout(limit_s, reactor)
        except DeferredTimeoutError:
            raise PairingError(late) from None
        except CancelledError:
            raise
        except Exception as error:
            raise PairingError(self._wording(error)) from error

    def _check_words(self) -> None:
        """A word that no code has costs no guess."""
        words = sorted(even_words_lowercase | odd_words_lowercase)
        for word in self._order.code.split("-")[1:]:
            if word not in words:
                meant = get_close_matches(word, words, n=1)
                hint = f"; did you mean {meant[0]}?" if meant else ""
                raise PairingError(f"{word!r} is no word of a code{hint}")

    def _on_status(self, status: Any) -> None:
        """Say when the mailbox is lost; the client of magic-wormhole calls again by itself."""
        state = type(status.mailbox_connection).__name__
        if self._is_connected and state == "Connecting":
            self._tell("note", f"the mailbox {self._order.mailbox} is lost; trying again")
        self._is_connected = state == "Connected"

    def _wording(self, error: Exception) -> str:
        """What magic-wormhole ended with, in one line of ours."""
        mailbox, new = self._order.mailbox, "ask for" if self._order.code else "invite again for"
        match error:
            case errors.WrongPasswordError():
                return f"a wrong code, or a message changed on the way: {self._code} is void; {new} a new one"
            case errors.ServerConnectionError():
                return f"the mailbox {mailbox} cannot be reached: {_one_line(error)}"
            case errors.ServerError() if _one_line(error) in ("crowded", "reclaimed"):
                return f"the code {self._code} was used already; {new} a new one"
            case errors.ServerError() | errors.WelcomeError():
                return f"the mailbox {mailbox} refused: {_one_line(error)}"
        return f"the mailbox {mailbox} sent what is no message of a pairing ({type(error).__name__})"


def _one_line(error: Exception) -> str:
    return one_line(str(error)).rstrip(".")


class _Input:
    """Standard input: an answer, and the end of the work (`twisted.internet.interfaces.IReadDescriptor`)."""

    def __init__(self, work: "Deferred[None]", answer: "Deferred[bool]") -> None:
        self._work, self._answer, self._text = work, answer, b""

    def fileno(self) -> int:
        return 0

    def logPrefix(self) -> str:  # noqa: N802 - of the interface
        return "stdin"

    def doRead(self) -> Exception | None:  # noqa: N802 - of the interface
        piece = os.read(0, 64)
        self._text += piece
        if b"\n" in self._text and not self._answer.called:
            self._answer.callback(self._text == b"yes\n")
        return None if piece else CONNECTION_DONE

    def connectionLost(self, reason: object) -> None:  # noqa: N802, ARG002 - of the interface
        self._work.cancel()


def run(work: Callable[["Deferred[bool]"], Coroutine[Any, Any, None]]) -> None:
    """Do the work in the reactor, which is given the first answer on standard input; end it early when that ends."""

    def begin() -> None:
        answer: Deferred[bool] = Deferred()
        done: Any = Deferred.fromCoroutine(work(answer))
        reactor.addReader(_Input(done, answer))
        done.addErrback(lambda failure: failure.printTraceback(sys.stderr))  # a fault of ours
        done.addBoth(lambda _: reactor.stop())

    reactor.callWhenRunning(begin)
    reactor.run()


def events_out() -> TextIO:
    """Standard output for our lines alone; what a library prints goes nowhere."""
    kept = os.fdopen(os.dup(1), "w", encoding="utf-8")
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.close(nowhere)
    globalLogBeginner.beginLoggingTo([], redirectStandardIO=False, discardBuffer=True)
    return kept


def main() -> None:
    conceal_memory()
    order, out = PairingOrder.from_json(sys.stdin.readline()), events_out()
    # Python reads ahead: what follows the order is read from the descriptor, and a parent writes it later, when asked.

    def tell(key: str, text: str) -> None:
        with suppress(BrokenPipeError):  # the command is gone; the end of standard input says so
            out.write(json.dumps({key: text}) + "\n")
            out.flush()

    async def pair(answer: "Deferred[bool]") -> None:
        try:
            peer = await PairingSession(order, tell, lambda: answer).run()
        except (PairingError, CancelledError) as error:
            tell("refused", f"{str(error) or 'ended'}; nothing is kept")
        else:
            tell("paired", peer.label)

    run(pair)


if __name__ == "__main__":
    main()
