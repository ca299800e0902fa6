"""A call between two known peers as messages, without I/O: nothing old, foreign or changed passes for a new one.

    master                          slave
    call (attempt)             ->
                               <-   ready (attempt, nonce, serves)
    offer (attempt, nonce, …)  ->
                               <-   answer or busy (attempt, nonce, …)

`attempt` and `nonce` are random, of the master's and the slave's choice. The slave takes an offer that holds a nonce
that it gave within `OFFER_LIMIT_S`, once; the master takes what holds its own attempt and that nonce. The server that
carries the messages can lose them, and delay an offer by that time, and no more.
"""

from collections import OrderedDict
from collections.abc import Callable, Sequence
from typing import Any, Final, NamedTuple

from weberlink.text import one_line
from weberlink_anywhere.sealing import Sealing
from weberlink_anywhere.signalling import Answer, Busy, Description, Offer, usable

NONCE_BYTES: Final = 16
OFFER_LIMIT_S: Final = 10.0
"""From the slave's `ready` to the offer: three ways through the mailbox server, of seconds each on the worst links."""
LARGEST_MEMORY: Final = 256
"""Calls that a slave remembers."""
LONGEST_SECRET: Final = 512
"""Characters of user name and password of ICE, each of at most 256 (RFC 8839 section 5.4)."""
Entropy = Callable[[int], bytes]


class Message(NamedTuple):
    """What the mailbox server carries: the kind, which it sees, and a sealed body."""

    phase: str
    body: str


class Ready(NamedTuple):
    """The slave waits; `serves` names the master that it serves now, None for nobody."""

    serves: str | None


class Called(NamedTuple):
    """A new offer, and the slave's nonce that it holds."""

    offer: Offer
    nonce: bytes


class OutgoingCall:
    """One call, of a master."""

    def __init__(self, sealing: Sealing, entropy: Entropy) -> None:
        self._sealing = sealing
        self.attempt = entropy(NONCE_BYTES)
        self._nonce: bytes | None = None

    def first(self) -> Message:
        """What begins the call."""
        return _sealed(self._sealing, "call", [self.attempt])

    def offer(self, paths: Sequence[Description], take_over: bool) -> Message:
        """What follows on `Ready`."""
        return _sealed(self._sealing, "offer", [self.attempt, self._nonce, take_over, _content(paths)])

    def receive(self, message: Message) -> Ready | Answer | Busy | None:
        """What a message tells of this call; None for nothing."""
        match message.phase, self._sealing.open(message.phase, message.body):
            case "ready", [self.attempt, bytes(nonce), None | str() as serves] if self._nonce is None:
                self._nonce = nonce
                return Ready(None if serves is None else one_line(serves))
            case "answer", [self.attempt, bytes(nonce), list(content)] if nonce == self._nonce:
                paths = _paths(content)
                return None if paths is None else Answer(paths)
            case "busy", [self.attempt, bytes(nonce), str(serves)] if nonce == self._nonce:
                return Busy(one_line(serves))
        return None


class IncomingCalls:
    """All calls of one master to a slave."""

    def __init__(self, sealing: Sealing, entropy: Entropy) -> None:
        self._sealing, self._entropy = sealing, entropy
        self._given: OrderedDict[bytes, tuple[bytes | None, float]] = OrderedDict()
        """By attempt: the nonce given, None once its offer came, and when."""

    def receive(self, message: Message, now: float, serves: str | None) -> Message | Called | None:
        """What to send on a call, which tells whom this slave serves, or an offer that is new; None for all else."""
        match message.phase, self._sealing.open(message.phase, message.body):
            case "call", [bytes(attempt)] if attempt not in self._given:
                return self._ready(attempt, now, serves)
            case "offer", [bytes(attempt), bytes(nonce), bool(take_over), list(content)]:
                given, at = self._given.get(attempt, (None, now))
                paths = _paths(content)
                if given is None or nonce != given or now - at > OFFER_LIMIT_S or paths is None:
                    return None
                self._given[attempt] = (None, at)
                return Called(Offer(attempt, paths, take_over), nonce)
        return None

    def reply(self, called: Called, told: Answer | Busy) -> Message:
        """What ends a call."""
        phase, content = ("busy", told.serves) if isinstance(told, Busy) else ("answer", _content(told.paths))
        return _sealed(self._sealing, phase, [called.offer.attempt, called.nonce, content])

    def _ready(self, attempt: bytes, now: float, serves: str | None) -> Message:
        nonce = self._entropy(NONCE_BYTES)
        self._given[attempt] = (nonce, now)
        if len(self._given) > LARGEST_MEMORY:
            self._given.popitem(last=False)
        return _sealed(self._sealing, "ready", [attempt, nonce, serves])


def _sealed(sealing: Sealing, phase: str, content: list[Any]) -> Message:
    return Message(phase, sealing.seal(phase, content))


def _content(paths: Sequence[Description]) -> list[Any]:
    return [[path.username, path.password, list(path.candidates)] for path in paths]


def _paths(content: list[Any]) -> tuple[Description, ...] | None:
    """None if it is not `_content`; of its candidates, those that this end may use."""
    paths = []
    for path in content:
        match path:
            case [str(username), str(password), list(candidates)] if len(username) + len(password) <= LONGEST_SECRET:
                paths.append(Description(username, password, usable(candidates)))
            case _:
                return None
    return tuple(paths)
