"""The session that the page starts: `weberlink loopback` in a child process, one at a time.

A scene is a set of overrides of one file. Another scene is another session: the settings that a visitor made (Weber
factor, predictor, delay, loss) are applied to it again once it runs.
"""

import asyncio
import json
import os
from collections.abc import Awaitable, Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from signal import SIGINT, Signals
from time import monotonic
from typing import Any

from weberlink.child_process import python
from weberlink.system.order import COMPLETED, FAILED, NOTE
from weberlink.system.scenes import SceneChoice
from weberlink.watching.control import Answer, refusal

STOP_LIMIT_S = 20.0
"""Time from the request to stop to a kill; the launcher gives its daemons 15 s."""
SETTLE_S = 10.0
"""How long a new session may take to accept the settings of the one before."""
SHORTEST_S = 1.0
"""Length of a session that starts when the time of the visit is almost over [s]."""
# The program, which ends with this process however this process ends.
_PROGRAM = (
    "import sys; from signal import SIGTERM; from weberlink.realtime.process import die_with_parent; "
    "die_with_parent(SIGTERM, int(sys.argv.pop(1))); from weberlink.cli import main; main()"
)


@dataclass(frozen=True)
class VisitOrder:
    """What sessions to run.

    Args:
        file: configuration.
        overrides: of every session, as of `--set`.
        scenes: by name; empty if the file has one scene only.
        scene: the first one.
        duration_s: how long sessions may run in all; None until it is interrupted.
    """

    file: str
    overrides: tuple[str, ...] = ()
    scenes: Mapping[str, SceneChoice] = field(default_factory=dict)
    scene: str | None = None
    duration_s: float | None = None


@dataclass(frozen=True)
class SessionResult:
    """How a session ended.

    Args:
        status: exit status.
        report: as of `weberlink loopback --json -`; None if it did not begin.
        notes: lines on standard error, without advice.
        complaint: the last of them if it failed.
    """

    status: int
    report: dict[str, Any] | None
    notes: tuple[str, ...]
    complaint: str


class _Child:
    """A launcher in a process group of its own."""

    def __init__(self, process: asyncio.subprocess.Process, scene: str | None) -> None:
        self.process = process
        self.scene = scene
        self.is_asked_to_end = False
        self.is_replaced = False

    @property
    def name(self) -> str:
        """Of its session."""
        return str(self.process.pid)

    def send(self, number: Signals) -> None:
        self.is_asked_to_end = True
        with suppress(ProcessLookupError):
            self.process.send_signal(number)

    async def finish(self, advise: Callable[[str], None]) -> SessionResult:
        """Wait for the end; `advise` receives each line of advice as it comes, and the result has the others."""
        assert self.process.stdout is not None
        output, notes, _ = await asyncio.gather(self.process.stdout.read(), self._notes(advise), self.process.wait())
        report = None
        with suppress(ValueError):
            report = json.loads(output)
        ended = self.process.returncode
        status = FAILED if ended is None or ended < 0 else ended
        complaint = notes.pop() if notes and status != COMPLETED else f"the session ended with status {ended}"
        return SessionResult(status, report, tuple(notes), complaint)

    async def _notes(self, advise: Callable[[str], None]) -> list[str]:
        assert self.process.stderr is not None
        notes = []
        async for line in self.process.stderr:
            note = line.decode(errors="replace").rstrip("\n").removeprefix("weberlink: ")
            if note.startswith(NOTE):
                advise(note)
            else:
                notes.append(note)
        return notes


class SessionKeeper:
    """Starts, stops and restarts the session of a visit.

    Args:
        order: what to run.
        tell: called with lines for the user.
        announce: called with a `keeper` message at every change.
        inherit: called with the names of the former session and of the new one, to apply the settings of the former.
        program: command that runs `weberlink`.
    """

    def __init__(
        self,
        order: VisitOrder,
        tell: Callable[[str], None],
        announce: Callable[[dict[str, Any]], None],
        inherit: Callable[[str, str], Awaitable[None]],
        program: Sequence[str] = (*python("-c", _PROGRAM, str(os.getpid())),),
    ) -> None:
        self._order = order
        self._tell = tell
        self._announce = announce
        self._inherit = inherit
        self._program = program
        self._turn = asyncio.Lock()
        self._child: _Child | None = None
        self.started: list[str] = []
        """Names of all its sessions."""
        self._watching: asyncio.Task[None] | None = None
        self._tasks: set[asyncio.Task[Any]] = set()
        self._deadline: float | None = None
        self._is_closing = False
        self._advised: set[str] = set()
        self.last: SessionResult | None = None
        """Of the last session that ended."""
        self._over = asyncio.Event()
        self._state: dict[str, Any] = {"state": "idle", "scene": order.scene, "why": None}

    @property
    def rooms(self) -> dict[str, Any]:
        """What a page may start."""
        scenes = [{"name": name, "title": scene.title} for name, scene in self._order.scenes.items()]
        return {"start": True, "scenes": scenes, "scene": self._state["scene"]}

    @property
    def message(self) -> dict[str, Any]:
        """The `keeper` message."""
        return {"type": "keeper"} | self._state

    @property
    def is_starting(self) -> bool:
        """Whether a session was started that was not found yet."""
        return self._state["state"] == "starting" and self._child is not None

    def request_stop(self) -> Answer:
        """End the session that is starting."""
        if self._child is not None and not self._child.is_asked_to_end:
            self._child.send(SIGINT)
        return {"accepted": True}

    def request_start(self, scene: object) -> Answer:
        """Begin to start a session, in place of the present one; the result comes as `keeper` messages."""
        chosen = scene if scene is not None else self._state["scene"]
        if not (chosen is None or (isinstance(chosen, str) and chosen in self._order.scenes)):
            return refusal(f"no such scene; there are {', '.join(self._order.scenes) or 'none to choose'}")
        if self._is_closing:
            return refusal("the program ends")
        if self._turn.locked():
            return refusal("another start is under way")
        self._task(self.start(chosen))
        return {"accepted": True}

    async def start(self, scene: str | None) -> None:
        """Start a session, after the present one has ended."""
        async with self._turn:
            former = self.started[-1] if self.started else None
            if self._child is not None:
                self._child.is_replaced = True
            self._become("starting", scene)
            await self._end()
            if self._is_closing:
                return
            child = self._child = await self._launch(scene)
            self.started.append(child.name)
            self._watching = self._task(self._watch(child))
            if former is not None:
                self._task(self._inherit(former, child.name))

    def note_running(self, name: str) -> None:
        """Note that a session was found."""
        if self._child is not None and name == self._child.name and self._state["state"] == "starting":
            self._become("running", self._child.scene)

    def expect_end(self, name: str | None) -> None:
        """Note that a session, or every one if there is no name, was asked to end; its end does not end the visit."""
        if self._child is not None and name in (None, self._child.name):
            self._child.is_asked_to_end = True

    async def run(self, interrupted: asyncio.Event) -> None:
        """Start the first session; end the last one when the visit is over or interrupted, and wait for its report.

        A visit is over by itself if its first session does not begin, when a session of limited length has ended, and
        when its time has passed without one.
        """
        await self.start(self._order.scene)
        waits = [asyncio.ensure_future(event.wait()) for event in (interrupted, self._over)]
        await asyncio.wait(waits, timeout=self._order.duration_s, return_when=asyncio.FIRST_COMPLETED)
        while not (interrupted.is_set() or self._over.is_set()) and self._child is not None:
            await asyncio.wait(waits, timeout=SHORTEST_S, return_when=asyncio.FIRST_COMPLETED)
        for wait in waits:
            wait.cancel()
        await self._close()

    def signal(self, number: Signals) -> None:
        """Pass a signal on to the session; the first one ends it in order, and nothing is started any more."""
        self._is_closing = True
        if self._child is not None:
            self._child.send(number)

    async def _close(self) -> None:
        """End the session and wait for its report."""
        self._is_closing = True
        async with self._turn:  # a start may be under way
            await self._end()
        for task in self._tasks:
            task.cancel()

    async def _end(self) -> None:
        child, watching = self._child, self._watching
        if child is None or watching is None:
            return
        if not child.is_asked_to_end:  # a second signal would not wait for an orderly end
            child.send(SIGINT)
        done, _ = await asyncio.wait([watching], timeout=STOP_LIMIT_S)
        if not done:
            child.send(Signals.SIGKILL)
            await asyncio.wait([watching])

    async def _launch(self, scene: str | None) -> _Child:
        order = self._order
        overrides = (*order.overrides, *(() if scene is None else order.scenes[scene].overrides))
        arguments = [order.file, "--json", "-", *(part for each in overrides for part in ("--set", each))]
        left = self._time_left()
        if left is not None:
            arguments += ["--duration", f"{max(SHORTEST_S, left):.3f}"]
        process = await asyncio.create_subprocess_exec(
            *self._program, "loopback", *arguments,
            stdin=asyncio.subprocess.DEVNULL, stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.PIPE,
            start_new_session=True,  # Ctrl-C reaches this process only, which ends the session in order
        )  # fmt: skip
        return _Child(process, scene)

    def _time_left(self) -> float | None:
        """Until the visit is over [s]; its time runs from the first start."""
        if self._order.duration_s is None:
            return None
        if self._deadline is None:
            self._deadline = monotonic() + self._order.duration_s
            return self._order.duration_s
        return self._deadline - monotonic()

    async def _watch(self, child: _Child) -> None:
        """Until a session ends."""
        result = await child.finish(self._advise)
        is_first, self.last, self._child = self.last is None, result, None
        for note in result.notes:
            self._tell(note)
        if child.is_replaced:
            return
        outcome = None if result.report is None else str(result.report.get("outcome"))
        if result.status == COMPLETED or child.is_asked_to_end:
            self._become("idle", child.scene, outcome)
        else:
            self._become("failed", child.scene, outcome or result.complaint)
        has_not_begun = is_first and result.report is None
        if not child.is_asked_to_end and (has_not_begun or self._order.duration_s is not None):
            self._over.set()
        elif self._state["state"] == "failed":
            self._tell(f"the session failed: {self._state['why']}; start another one from the page")

    def _advise(self, note: str) -> None:
        """Tell a line of advice, which every session of a visit may give, once."""
        if note not in self._advised:
            self._advised.add(note)
            self._tell(note)

    def _become(self, state: str, scene: str | None, why: str | None = None) -> None:
        self._state = {"state": state, "scene": scene, "why": why}
        self._announce(self.message)

    def _task(self, work: Any) -> "asyncio.Task[Any]":
        task = asyncio.get_running_loop().create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return task
