"""Bounded queue of the messages to one page.

Of a state only the newest message waits; rows and events wait in their order, and a slow page loses the oldest ones.
It loses neither the newest greeting nor an answer. Answers overtake all else.
"""

import asyncio
import json
from collections import deque
from collections.abc import AsyncIterator, Mapping
from typing import Any, Literal

Topic = Literal["hello", "again", "rows", "events", "figures", "final", "handle", "launcher", "recording"]
"""What a message is about.

`again` greets once more with the same session, `final` are its last figures, `launcher` tells of the started session.
"""
MOST_WAITING: dict[Topic, int] = {"rows": 60, "events": 16}
"""Most messages that wait, of a topic of which every one counts: 60 of rows are about a second of a session."""
OUTLIVING: tuple[Topic, ...] = ("final", "launcher")  # what still counts once another session is shown
ANSWERS_WAITING = 16


def to_json(document: Mapping[str, Any]) -> str:
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
        self.watching: str | None = None  # the session of its last greeting
        self.lost_rows = 0
        self._waiting: deque[tuple[Topic, str]] = deque()
        self._answers: deque[str] = deque(maxlen=ANSWERS_WAITING)
        self._came = asyncio.Event()

    def greet(self, document: Mapping[str, Any]) -> None:
        """Queue the greeting of another session; what waits of the one before is dropped, but for its last figures."""
        self._waiting = deque(message for message in self._waiting if message[0] in OUTLIVING)
        self.put("hello", document)

    def put(self, topic: Topic, document: Mapping[str, Any]) -> None:
        """Queue a message, see `put_all`."""
        put_all([self], topic, document)

    def put_text(self, topic: Topic, text: str) -> None:
        """Queue a message in place of the earlier ones of its topic, or of the oldest of them if each counts."""
        same = [message for message in self._waiting if message[0] == topic]
        for outdated in same[: max(0, len(same) + 1 - MOST_WAITING.get(topic, 1))]:
            self._waiting.remove(outdated)
            self.lost_rows += topic == "rows"
        self._waiting.append((topic, text))
        self._came.set()

    def answer(self, document: Mapping[str, Any]) -> None:
        """Queue an answer before all else; the state of the handle, of which the newest counts, among the others."""
        if document["type"] == "handle":
            self.put("handle", document)
        else:
            self._answers.append(to_json(document))
            self._came.set()

    def take(self) -> str | None:
        """The next message, if there is one."""
        if self._answers:
            return self._answers.popleft()
        if self._waiting:
            return self._waiting.popleft()[1]
        self._came.clear()
        return None

    async def messages(self) -> AsyncIterator[str]:
        """All messages, without end."""
        while True:
            while (text := self.take()) is not None:
                yield text
            await self._came.wait()

    def __len__(self) -> int:
        return len(self._waiting) + len(self._answers)


def put_all(viewers: list[Viewer], topic: Topic, document: Mapping[str, Any]) -> None:
    """Queue a message for pages, encoded once."""
    text = to_json(document) if viewers else ""
    for viewer in viewers:
        viewer.put_text(topic, text)
