"""The live settings of the session as parameters: read by every client, changed by the requests of the live page."""

import asyncio
from collections.abc import Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

from foxglove import Parameter

from weberlink.session.control_socket import LiveChangeError, ask
from weberlink_figures.watching.control import Answer, change, refusal
from weberlink_figures.watching.session import WatchedSession

NUMBERS = frozenset({"weber", "delay_ms", "jitter_ms", "loss"})
"""Parameters that are numbers; a client may send them as integers."""
NAMES = NUMBERS | {"predictor"}
"""All parameters. Every page in a browser of this host can connect, so a client must not stop a session."""
LOOK_S = 1.0  # period of asking what is in force, while a client wants to be told of changes
CLOSED = "parameters are read-only; start the bridge with --allow-changes, and every client of its port may change them"

Values = dict[str, Any]


class LiveParameters:
    """What is in force in the followed session, and requests to change it, which may come from any thread."""

    def __init__(self, *, allow: bool) -> None:
        self._allow = allow
        self._session: WatchedSession | None = None
        self._asker = ThreadPoolExecutor(1, "settings")
        self._asked: Future[Values] | None = None
        self._ask_at = 0.0
        self._told: Values = {}
        self.wanted: set[str] = set()  # names of those of whose changes a client wants to be told

    def follow(self, session: WatchedSession) -> None:
        """From now on, parameters are those of this session."""
        self._session = session

    def close(self) -> None:
        self._asker.shutdown(wait=False, cancel_futures=True)

    def in_force(self) -> Values:
        """Settings and emulated link in force, or agreed; empty without an answer. Blocks until a daemon answers."""
        session = self._session
        if session is None or session.ended:
            return {}
        try:
            answer = ask(session.ring, {})
        except LiveChangeError:
            return {}
        return {**(answer.get("settings") or {}), **(answer.get("pending") or {}), **(answer.get("link") or {})}

    def change(self, values: Mapping[str, Any]) -> Answer:
        """Ask the daemons to make a change, as the live page does; blocks until they answer."""
        if not self._allow:
            return refusal(CLOSED)
        if unknown := values.keys() - NAMES:
            return refusal(f"no parameter {', '.join(sorted(unknown))}; there are {', '.join(sorted(NAMES))}")
        request = {name: float(v) if name in NUMBERS and type(v) is int else v for name, v in values.items()}
        return asyncio.run(change(self._session, request))

    def changed(self, now: float) -> Values:
        """What has changed since the last call; never blocks."""
        if self._asked is not None and self._asked.done():
            values, self._asked = self._asked.result(), None
            changed = {name: value for name, value in values.items() if self._told.get(name) != value}
            self._told = values
            return changed
        if self.wanted and self._asked is None and now >= self._ask_at:
            self._ask_at = now + LOOK_S
            self._asked = self._asker.submit(self.in_force)
        return {}


def as_parameters(values: Mapping[str, Any], names: Sequence[str] = ()) -> list[Parameter]:
    """Values as parameters: the named ones, or all; one that is not there has no value."""
    return [Parameter(name, value=values.get(name)) for name in (names or sorted(values))]
