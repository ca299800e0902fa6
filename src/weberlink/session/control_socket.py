"""The control socket of a daemon: requests to change settings, and to stop, while a session runs.

The daemon answers between ticks. Only its own user can ask: the socket is a file of mode 0600 beside the ring. The
launcher makes it before the daemon starts, and holds a descriptor of the file, by which it is found when the directory
was emptied, as at a logout.
"""

import json
import os
import re
import socket
import stat
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from fcntl import F_GETFL, F_SETFL, F_SETOWN, fcntl
from math import isfinite
from pathlib import Path
from signal import SIG_IGN, SIGIO, signal
from time import monotonic
from typing import TYPE_CHECKING, Any

from weberlink.bounded_json import parse
from weberlink.order import EMERGENCY
from weberlink.telemetry.runtime_directory import ForeignFileError, check, listening_socket

if TYPE_CHECKING:  # who only asks needs no event loop
    import asyncio

    from weberlink.session.daemon import LiveLink
    from weberlink.session.side import Side

LONGEST_QUESTION, LONGEST_ANSWER = 1024, 4096  # bytes
LOOK_S = 0.01  # time between two checks for the peer's answer [s]
QUESTIONS_A_LOOK = 8
LONGEST_REASON = 100  # characters of an outcome
LINK_SETTINGS = ("delay_ms", "jitter_ms", "loss")  # what may be changed of an emulated link; as of `link.emulate`
AT_ONCE = frozenset({"emergency", "stop", *LINK_SETTINGS})
"""Requests that concern one side alone, and are done when they are answered."""
NO_EMULATION = "this session emulates no link: add emulate: {} under link in its file"
IS_NEWER = "this run was ordered after that stop"
IS_STOPPED = "this run is over by an emergency stop"
NOT_A_MOMENT = "emergency must be the moment of the command [s], as of time.monotonic"
_OPENING = "its device or robot is being opened; ask again"
_NAME = re.compile(r"weberlink-(\d+)-[a-z]+\.ask")


class LiveChangeError(RuntimeError):
    """No daemon answered, or the answer cannot be read; one line."""


def path_beside(ring: str | Path) -> Path:
    return Path(ring).with_suffix(".ask")


def session_of(path: Path) -> str | None:
    """The name of the session, which is the process id of its launcher; None for another file."""
    found = _NAME.fullmatch(path.name)
    return None if found is None else found[1]


def control_sockets() -> set[Path]:
    """Those of all daemons of this user or of root on this host, also where the files were removed.

    The kernel lists what everybody calls so: only a file of this user, or a descriptor in such a process, counts."""
    lines = Path("/proc/self/net/unix").read_text(encoding="utf-8", errors="surrogateescape").splitlines()
    listed = {Path(fields[7]) for line in lines if len(fields := line.split(maxsplit=7)) == 8}
    named = {path: session for path in listed if (session := session_of(path)) is not None}
    there = {path for path in named if _is_ours(path)}
    held = {path for session in {named[path] for path in named.keys() - there} for path in _held(session)}
    return there | (held & listed)


def _is_ours(path: Path) -> bool:
    try:
        check(path, path.lstat(), stat.S_IFSOCK)
    except OSError:
        return False
    return True


@contextmanager
def reserved(ring: str | Path) -> Iterator[tuple[socket.socket, int]]:
    """The control socket of a daemon to be started, and a descriptor by which it is found without its file.

    The socket is closed at the end of the block: the daemon inherits it. The descriptor is for the caller to close.
    Raises OSError if there is no room for the socket's file."""
    with listening_socket(path_beside(ring)) as listener:
        yield listener, os.open(path_beside(ring), os.O_PATH | os.O_NOFOLLOW | os.O_CLOEXEC)


def connect(asker: socket.socket, path: Path) -> None:
    """Connect to a control socket of this user or of root; raises ForeignFileError if it is of somebody else, or
    another OSError if nobody listens there."""
    try:
        status = path.lstat()
    except FileNotFoundError:
        path = _held(session_of(path)).get(path, path)
        status = path.stat()
    check(path, status, stat.S_IFSOCK)
    asker.connect(str(path))  # from here on the kernel takes answers of this daemon alone


def _held(session: str | None) -> dict[Path, Path]:
    """The removed control sockets of a session, each with the descriptor in the launcher by which it is reached."""
    found = {}
    with suppress(OSError):  # no such process, or that of somebody else
        for each in Path(f"/proc/{session}/fd").iterdir():
            with suppress(OSError):  # closed meanwhile
                name, is_removed, _ = str(each.readlink()).partition(" (deleted)")
                if is_removed and session_of(Path(name)) == session:
                    found[Path(name)] = each
    return found


def ask(ring: str | Path, request: Mapping[str, Any], patience_s: float = 2.0) -> dict[str, Any]:
    """Ask something of the daemon that writes a ring; blocks until it answers.

    Args:
        request: one of these, or empty to ask what is in force only:

            - `weber` (0 to less than 1) or `predictor`, or both: of both sides, answered once they agree;
            - any of `delay_ms`, `jitter_ms`, `loss`: of what this side sends from now on, where the file has
              `link.emulate`;
            - `stop`, with the outcome in words: an orderly end;
            - `emergency`, the moment of the command on `time.monotonic` [s]: no force and no motion from the next tick
              on; the run has failed. A run that was ordered later goes on.

    Returns:
        `accepted`, or `why` not. With settings of both sides `tick` of that daemon from which on they hold. Always
        `settings` and `generation`, `pending` settings that are agreed and not yet in force, and `link`: delay, jitter
        and loss in force, None without emulation.

    Raises:
        LiveChangeError: no daemon of this user or of root is there, or it does not answer in time.
    """
    path = path_beside(ring)
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as asker:
        asker.bind("")  # an address of the kernel's choice, so that we can be answered
        asker.settimeout(patience_s)
        try:
            connect(asker, path)
            asker.send(json.dumps(dict(request)).encode())
            answer = parse(asker.recv(LONGEST_ANSWER + 1), LONGEST_ANSWER)
        except TimeoutError:
            raise LiveChangeError(f"the daemon did not answer in {patience_s:g} s") from None
        except ForeignFileError as error:
            raise LiveChangeError(str(error)) from None
        except OSError as error:
            raise LiveChangeError(f"{path}: no daemon answers there: {error.strerror}") from None
        except ValueError as error:
            raise LiveChangeError(f"the daemon's answer cannot be read: {error}") from None
    if not isinstance(answer, dict):
        raise LiveChangeError("the daemon's answer is no object")
    return answer


class ControlSocket:
    """The daemon's end: takes requests between ticks and hands them to its side; `listener` as of `reserved`, and
    `ordered_at` when the run was ordered, on `time.monotonic` [s]."""

    def __init__(
        self, listener: socket.socket, side: "Side", link: "LiveLink | None" = None, ordered_at: float = 0.0
    ) -> None:
        self._socket, self._path = listener, Path(listener.getsockname())
        self._side, self._link = side, link
        self._ordered_at = ordered_at
        self._is_stopped = self._is_opening = False
        self._outcome: str | None = None  # of a run that ends while its device is being opened
        self._loop: asyncio.AbstractEventLoop | None = None
        # Who waits for the answer of the peer: one at most, because there is one change at a time.
        self._waiting: str | bytes | None = None

    @contextmanager
    def opening(self, stopped: type[Exception]) -> Iterator[None]:
        """Take a stop, and nothing else, while the main thread opens the device or the robot, which can take a minute,
        and before that: raises `stopped`.

        The kernel signals each question, since no loop runs yet."""
        descriptor, flags = self._socket.fileno(), fcntl(self._socket, F_GETFL)

        def asked(*_: object) -> None:
            self._on_questions()
            if self._outcome is not None:
                raise stopped(self._outcome)

        self._is_opening = True
        signal(SIGIO, asked)
        try:
            fcntl(descriptor, F_SETOWN, os.getpid())
            fcntl(descriptor, F_SETFL, flags | os.O_ASYNC)
            asked()
            yield
        finally:
            signal(SIGIO, SIG_IGN)  # one may be under way
            fcntl(descriptor, F_SETFL, flags)
            self._is_opening = False

    def open(self, loop: "asyncio.AbstractEventLoop") -> None:
        """Answer in this loop from now on."""
        self._loop = loop
        loop.add_reader(self._socket.fileno(), self._on_questions)

    def close(self) -> None:
        """Stop listening, when no loop runs any more; may be repeated."""
        self._socket.close()
        self._path.unlink(missing_ok=True)

    def _on_questions(self) -> None:
        for _ in range(QUESTIONS_A_LOOK):
            try:
                data, sender = self._socket.recvfrom(LONGEST_QUESTION + 1)
            except OSError:
                return
            try:
                request = parse(data, LONGEST_QUESTION)
            except ValueError:
                request = None
            self._on_question(request, sender)

    def _on_question(self, request: Any, sender: str | bytes | None) -> None:
        self._answer_waiting()  # before another change takes its place
        if not isinstance(request, dict):
            self._answer(sender, {"accepted": False, "why": "a question is a JSON object"})
        elif not request:
            self._answer(sender, {})
        elif (refusal := self._do(request)) is not None:
            self._answer(sender, {"accepted": False, "why": refusal})
        elif not set(request).isdisjoint(AT_ONCE):
            self._answer(sender, {"accepted": True})
        else:
            self._waiting = sender
            self._look()

    def _do(self, request: dict[str, object]) -> str | None:
        """Begin what is asked; why not, or None."""
        now = monotonic()
        if "emergency" in request:  # first, and whatever else is asked for
            return self._emergency(request["emergency"], now)
        if self._is_stopped:
            return IS_STOPPED
        if "stop" in request:
            return self._stop(request, now)
        if set(request).isdisjoint(AT_ONCE):
            return _OPENING if self._is_opening else self._side.propose(request, now)
        return NO_EMULATION if self._link is None else self._link.change(request)

    def _stop(self, request: dict[str, object], now: float) -> str | None:
        reason = request["stop"]
        if len(request) > 1:
            return "ask for stop alone"
        if not (isinstance(reason, str) and 0 < len(reason) <= LONGEST_REASON and reason.isprintable()):
            return f"stop must be the outcome in words, 1 to {LONGEST_REASON} printable characters"
        if self._is_opening:
            self._outcome = self._outcome or reason
        else:
            self._side.stop(now, reason)
        return None

    def _emergency(self, at: object, now: float) -> str | None:
        if isinstance(at, bool) or not isinstance(at, int | float) or not isfinite(at):
            return NOT_A_MOMENT
        if at < self._ordered_at:
            return IS_NEWER
        self._is_stopped = True
        if self._is_opening:
            self._outcome = EMERGENCY
        else:
            self._side.emergency(now)
        return None

    def _look(self) -> None:
        """Answer who waits, now or as soon as the peer has answered."""
        self._answer_waiting()
        if self._waiting is not None and self._loop is not None:
            self._loop.call_later(LOOK_S, self._look)

    def _answer_waiting(self) -> None:
        result = self._side.tuning.result
        if self._waiting is None or result is None:
            return
        accepted = result.refusal is None
        told: dict[str, object] = {"tick": result.tick} if accepted else {"why": result.refusal}
        self._answer(self._waiting, {"accepted": accepted} | told)
        self._waiting = None

    def _answer(self, sender: str | bytes | None, content: dict[str, object]) -> None:
        tuning = self._side.tuning
        in_force = {
            "settings": tuning.settings._asdict(),
            "generation": tuning.generation,
            "pending": None if tuning.pending is None else tuning.pending._asdict(),
            "link": None if self._link is None else self._link.in_force,
        }
        if sender:  # else it has no address
            with suppress(OSError):  # the asker has ended, or does not read
                self._socket.sendto(json.dumps(content | in_force).encode(), sender)
