"""One page: what waits to be sent to it. Knows no socket.

The queue is bounded. A page that is slow to read loses rows, the oldest first; of figures it gets the newest, and
greetings and answers are never lost.
"""

import asyncio
from collections import deque
from collections.abc import AsyncIterator
from enum import Enum, auto

ROWS_WAITING = 60
"""Messages of rows that wait for a slow page: about a second of a session."""
ANSWERS_WAITING = 16
GREETINGS_WAITING = 4


class Kind(Enum):
    """What a message is to the queue."""

    HELLO = auto()
    """The greeting of another session."""
    AGAIN = auto()
    """A greeting that replaces that of the same session, which goes on."""
    ROWS = auto()
    FIGURES = auto()
    FINAL = auto()
    """The last figures of a session."""
    ANSWER = auto()


class Viewer:
    """The messages of one page.

    Args:
        session: the one that it asked for; until that is there, and for None, it is shown the newest.
        may_change: whether it may ask for live changes.
    """

    def __init__(self, session: str | None, *, may_change: bool) -> None:
        self.pinned = session
        self.may_change = may_change
        self.watching: str | None = None
        """The session that it was greeted with."""
        self.lost_rows = 0
        self._waiting: deque[tuple[Kind, str]] = deque()
        self._counts = dict.fromkeys(Kind, 0)
        self._came = asyncio.Event()

    def put(self, kind: Kind, text: str) -> None:
        """Queue a message; drops what the rules of the queue say."""
        if kind is Kind.HELLO:
            self._drop(Kind.ROWS, 0)
            self._drop(Kind.FIGURES, 0)
            self._drop(Kind.HELLO, GREETINGS_WAITING - 1)
            self._drop(Kind.FINAL, GREETINGS_WAITING - 1)
        elif kind is Kind.AGAIN:
            self._drop(Kind.AGAIN, 0)
        elif kind in (Kind.FIGURES, Kind.FINAL):
            self._drop(Kind.FIGURES, 0)
        elif kind is Kind.ROWS:
            self.lost_rows += self._drop(Kind.ROWS, ROWS_WAITING - 1)
        else:
            self._drop(Kind.ANSWER, ANSWERS_WAITING - 1)
        self._waiting.append((kind, text))
        self._counts[kind] += 1
        self._came.set()

    def take(self) -> str | None:
        """The next message, if there is one."""
        if not self._waiting:
            self._came.clear()
            return None
        kind, text = self._waiting.popleft()
        self._counts[kind] -= 1
        return text

    async def messages(self) -> AsyncIterator[str]:
        """Every message as its turn comes, without end."""
        while True:
            while (text := self.take()) is not None:
                yield text
            await self._came.wait()

    def __len__(self) -> int:
        return len(self._waiting)

    def _drop(self, kind: Kind, most: int) -> int:
        """Let go of the oldest of a kind until there are at most so many."""
        dropped = 0
        while self._counts[kind] > most:
            self._waiting.remove(next(message for message in self._waiting if message[0] is kind))
            self._counts[kind] -= 1
            dropped += 1
        return dropped
