"""The emergency stop of sessions on this host: told to every side, again and again, until it has acknowledged it.

Nothing here needs a loop, a thread, or the runtime directory.
"""

import json
import socket
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from weberlink.bounded_json import parse
from weberlink.child_process import process_columns
from weberlink.session.control_socket import IS_NEWER, LONGEST_ANSWER, connect, control_sockets, session_of

REPEAT_S = 0.02
FIND_S = 0.1  # time between two searches for sides that are being started
NO_SESSION = "there is no running session on this host"


@dataclass(frozen=True)
class Scope:
    """The sessions that a stop may concern."""

    folder: str | None = None  # only those with their files in it; None for any folder
    session: str | None = None  # only the one of this name; None for all
    parent: int | None = None  # only those whose launcher is a child of this process; None for all

    def holds(self, path: Path) -> bool:
        """Whether it holds the session of a control socket."""
        name = str(session_of(path))
        if self.parent is not None and (process_columns(name) or ["", ""])[1] != str(self.parent):
            return False
        return self.folder in (None, str(path.parent)) and self.session in (None, name)


class EmergencyStop:
    """One stop: force to zero, and no motion, at both ends of the sessions of this user that were ordered before it.

    Args:
        name: the only one of these that it concerns, if that one runs; a page may name a session that is over.
        at: the moment of the command, on `time.monotonic` [s].

    Attributes:
        stopped: names of sessions of which a side has acknowledged.
    """

    def __init__(self, scope: Scope, name: str | None, at: float) -> None:
        self.at = at
        self.stopped: set[str] = set()
        self._scope, self._name = scope, name
        self._request = json.dumps({"emergency": at}).encode()
        self._sides: dict[Path, _Side] = {}
        self._find_at = self._tell_at = at

    def advance(self, now: float) -> bool:
        """Find sides, tell them, and read what they answer, without waiting; call it again until it returns True: no
        side is left that has not acknowledged."""
        if now >= self._find_at:
            self._find_at = now + FIND_S
            found = [path for path in control_sockets() if self._scope.holds(path)]
            named = [path for path in found if session_of(path) == self._name]
            for path in named or ([] if self._name in self.stopped else found):
                if path not in self._sides:
                    self._sides[path] = _Side(path)
        is_due = now >= self._tell_at
        if is_due:
            self._tell_at = now + REPEAT_S
        for path, side in self._sides.items():
            if not side.is_done and side.advance(self._request if is_due else None):
                self.stopped.add(str(session_of(path)))
        return all(side.is_done for side in self._sides.values())

    def answer(self) -> dict[str, Any]:
        """How it stands: `accepted`, and `sessions` that are stopped, or `why` not."""
        waiting = [
            f"{path.stem.removeprefix('weberlink-')}: {side.why}"
            for path, side in self._sides.items()
            if not side.is_done
        ]
        if waiting or not self.stopped:
            return {"accepted": False, "why": "; ".join(waiting) or NO_SESSION}
        return {"accepted": True, "sessions": sorted(self.stopped)}

    def close(self) -> None:
        """Give up on what has not acknowledged."""
        for side in self._sides.values():
            side.close()


class _Side:
    """One side, which is asked over a socket of its own."""

    def __init__(self, path: Path) -> None:
        self.why = "does not answer"
        self._asker = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK)
        self.is_done = False
        try:
            self._asker.bind("")  # an address of the kernel's choice, so that we can be answered
            connect(self._asker, path)
        except OSError:  # it has ended, or is another user's
            self.close()

    def advance(self, request: bytes | None) -> bool:
        """Ask, if there is a request, and look for an answer; whether it has stopped."""
        try:
            if request is not None:
                self._asker.send(request)
            answer = parse(self._asker.recv(LONGEST_ANSWER + 1), LONGEST_ANSWER)
        except BlockingIOError:
            return False
        except ConnectionError:  # it has ended
            self.close()
            return True
        except ValueError as error:
            self.why = f"its answer cannot be read: {error}"
            return False
        if isinstance(answer, dict) and (answer.get("accepted") is True or answer.get("why") == IS_NEWER):
            self.close()
            return answer.get("accepted") is True
        self.why = str(answer.get("why") if isinstance(answer, dict) else answer)
        return False

    def close(self) -> None:
        self.is_done = True
        self._asker.close()
