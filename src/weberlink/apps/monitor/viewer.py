"""Bounded queue of the messages to one page.

A slow page loses the oldest rows and outdated figures; it loses no greeting and no answer. Answers overtake all
else.
"""

import asyncio
import json
from collections import deque
from collections.abc import AsyncIterator
from enum import Enum, auto
from typing import Any

ROWS_WAITING = 60
"""Most messages of rows in the queue: about a second of a session."""
ANSWERS_WAITING = 16
GREETINGS_WAITING = 4
EVENTS_WAITING = 16


class MessageKind(Enum):
    """Kinds of messages, by how the queue treats them."""

    HELLO = auto()
    """The greeting of another session."""
    AGAIN = auto()
    """A new greeting of the present session."""
    ROWS = auto()
    FIGURES = auto()
    FINAL = auto()
    """The last figures of a session."""
    ANSWER = auto()
    HANDLE = auto()
    """Who drives."""
    KEEPER = auto()
    """The state of the session that the page starts."""
    EVENTS = auto()
    HISTORY = auto()
    RECORDING = auto()
    """State of the recording; only the newest counts."""


MOST_BEFORE = {
    MessageKind.HELLO: {
        MessageKind.ROWS: 0,
        MessageKind.FIGURES: 0,
        MessageKind.EVENTS: 0,
        MessageKind.HISTORY: 0,
        MessageKind.HELLO: GREETINGS_WAITING - 1,
        MessageKind.FINAL: GREETINGS_WAITING - 1,
    },
    MessageKind.AGAIN: {MessageKind.AGAIN: 0},
    MessageKind.ROWS: {MessageKind.ROWS: ROWS_WAITING - 1},
    MessageKind.FIGURES: {MessageKind.FIGURES: 0},
    MessageKind.FINAL: {MessageKind.FIGURES: 0},
    MessageKind.ANSWER: {MessageKind.ANSWER: ANSWERS_WAITING - 1},
    MessageKind.HANDLE: {MessageKind.HANDLE: 0},
    MessageKind.KEEPER: {MessageKind.KEEPER: 0},
    MessageKind.EVENTS: {MessageKind.EVENTS: EVENTS_WAITING - 1},
    MessageKind.HISTORY: {MessageKind.HISTORY: 0},
    MessageKind.RECORDING: {MessageKind.RECORDING: 0},
}
"""For a new message of a kind: how many waiting messages of which kinds may stay; the oldest are dropped."""


def to_json(document: dict[str, Any]) -> str:
    return json.dumps(document, allow_nan=False, separators=(",", ":"))


class Viewer:
    """The messages of one page.

    Args:
        session: the one it asked for; until that exists, and for None, it is shown the newest.
        may_change: whether it may drive, and ask for changes.
    """

    def __init__(self, session: str | None, *, may_change: bool) -> None:
        self.pinned = session
        self.may_change = may_change
        self.watching: str | None = None
        """The session of its last greeting."""
        self.wants_history = False
        self.lost_rows = 0
        self._waiting: deque[tuple[MessageKind, str]] = deque()
        self._answers: deque[tuple[MessageKind, str]] = deque()
        self._counts = dict.fromkeys(MessageKind, 0)
        self._came = asyncio.Event()

    def put(self, kind: MessageKind, text: str) -> None:
        """Queue a message and drop outdated ones."""
        queue = self._answers if kind is MessageKind.ANSWER else self._waiting
        for outdated, most in MOST_BEFORE[kind].items():
            while self._counts[outdated] > most:
                queue.remove(next(message for message in queue if message[0] is outdated))
                self._counts[outdated] -= 1
                self.lost_rows += outdated is kind is MessageKind.ROWS
        queue.append((kind, text))
        self._counts[kind] += 1
        self._came.set()

    def take(self) -> str | None:
        """The next message, if there is one."""
        queue = self._answers or self._waiting
        if not queue:
            self._came.clear()
            return None
        kind, text = queue.popleft()
        self._counts[kind] -= 1
        return text

    async def messages(self) -> AsyncIterator[str]:
        """All messages, without end."""
        while True:
            while (text := self.take()) is not None:
                yield text
            await self._came.wait()

    def __len__(self) -> int:
        return len(self._waiting) + len(self._answers)
