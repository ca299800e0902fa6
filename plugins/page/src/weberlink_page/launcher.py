"""The session that the page starts: `weberlink loopback` in a child process, one at a time.

A scene is a set of overrides of one file. Another scene is another session: the settings that a visitor made (Weber
factor, predictor, delay, loss) are applied to it again once it runs.
"""

import asyncio
import json
import os
from asyncio.subprocess import DEVNULL, PIPE, Process
from collections.abc import Awaitable, Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from math import inf
from signal import SIGINT, SIGKILL, Signals
from time import monotonic
from typing import Any, NamedTuple

from weberlink.child_process import python
from weberlink.order import COMPLETED, EMERGENCY, FAILED, NOTE
from weberlink.session.report import CHOSEN_BY
from weberlink_figures.watching.control import Answer, refusal
from weberlink_page.messages import Rooms

STOP_LIMIT_S = 20.0  # time from the request to stop to a kill; the launcher gives its daemons 15 s
SAME_PRESS_S = 1.0  # within this time, stops are the two ways of one press
SHORTEST_S = 1.0  # length of a session that starts when the time is almost over [s]
# The program, which ends with this process however this process ends.
_PROGRAM = (
    "import sys; from signal import SIGTERM; from weberlink.realtime.process import die_with_parent; "
    "die_with_parent(SIGTERM, int(sys.argv.pop(1))); from weberlink.cli import main; main()"
)


class SceneChoice(NamedTuple):
    """A scene to choose."""

    title: str  # in plain words
    overrides: tuple[str, ...]  # of try.yaml, as of `--set`; none for the scene of the file itself


def _scene(*shapes: str) -> tuple[str, ...]:
    return (f"slave.scene=[{', '.join(f'{{{shape}, stiffness_n_m: 1500}}' for shape in shapes)}]",)


SCENES: Mapping[str, SceneChoice] = {
    "dome": SceneChoice("A dome on a table", ()),
    "plane": SceneChoice(
        "A rough table: it sticks, then slides", _scene("shape: plane, friction: {static: 0.3, dynamic: 0.2}")
    ),
    "box": SceneChoice(
        "A box with sharp edges on a table",
        _scene(
            "shape: box, center_m: [0, 0, 0], size_m: [0.05, 0.05, 0.03], rotation_deg: [0, 0, 30]",
            "shape: plane, point_m: [0, 0, -0.015]",
        ),
    ),
    "bumps": SceneChoice(
        "A field of round bumps", _scene("shape: height_field, bumps: {amplitude_m: 0.003, wavelength_m: 0.03}")
    ),
    "cavity": SceneChoice(
        "A hollow ball, touched from inside",
        _scene("shape: sphere, side: inside, center_m: [0, 0, 0.045], radius_m: 0.05"),
    ),
    "moving": SceneChoice(
        "A plate that rises and falls",
        _scene(
            "shape: box, center_m: [-0.1, 0, -0.05], size_m: [0.2, 0.4, 0.1],"
            " motion: {direction: [0, 0, 1], amplitude_m: 0.01, frequency_hz: 0.4}",
            "shape: plane, point_m: [0, 0, -0.005]",
        ),
    ),
}
"""By name, in the order in which they are shown; the first is that of the file."""


@dataclass(frozen=True)
class TryOrder:
    """What sessions to run."""

    file: str
    overrides: tuple[str, ...] = ()  # of every session, as of `--set`
    scenes: Mapping[str, SceneChoice] = field(default_factory=dict)  # empty if the file has one scene only
    scene: str | None = None  # the first one
    duration_s: float | None = None  # how long sessions may run in all; None until it is interrupted


@dataclass(frozen=True)
class SessionResult:
    """How a session ended."""

    status: int
    report: dict[str, Any] | None  # as of `weberlink loopback --json -`; None if it did not begin
    complaint: str  # the last line on standard error if it failed


@dataclass(eq=False)
class _Child:
    """A session in a process group of its own."""

    process: Process
    scene: str | None
    asked_at: float  # when it was asked for, on `time.monotonic` [s]
    is_asked_to_end: bool = False
    is_replaced: bool = False

    @property
    def name(self) -> str:
        """Of its session."""
        return str(self.process.pid)

    def send(self, number: Signals) -> None:
        self.is_asked_to_end = True
        with suppress(ProcessLookupError):
            self.process.send_signal(number)

    async def finish(self, advise: Callable[[str], None]) -> tuple[SessionResult, list[str]]:
        """Wait for the end; `advise` receives each line of advice as it comes. Returns the other lines, too."""
        assert self.process.stdout is not None
        output, notes, ended = await asyncio.gather(
            self.process.stdout.read(), self._notes(advise), self.process.wait()
        )
        report = None
        with suppress(ValueError):
            report = json.loads(output)
        status = FAILED if ended < 0 else ended
        complaint = notes.pop() if notes and status != COMPLETED else f"the session ended with status {ended}"
        return SessionResult(status, report, complaint), notes

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


class SessionLauncher:
    """Starts, stops and restarts the session of `weberlink try`.

    Args:
        announce: called with a `launcher` message at every change.
        inherit: called with the names of the former session and of the new one, to apply the settings of the former.
        program: command that runs `weberlink`.

    Attributes:
        started: names of all its sessions.
        last: how the last session that ended did.
        stops: number of emergency stops so far. A start that a page asked for before it knew of the last one is void.
        message: the newest `launcher` message.
    """

    def __init__(
        self,
        order: TryOrder,
        tell: Callable[[str], None],
        announce: Callable[[dict[str, Any]], None],
        inherit: Callable[[str, str], Awaitable[None]],
        program: Sequence[str] = (*python("-c", _PROGRAM, str(os.getpid())),),
    ) -> None:
        self._order, self._tell, self._announce, self._inherit = order, tell, announce, inherit
        self._program = program
        self._turn = asyncio.Lock()
        self._child: _Child | None = None
        self._watching: asyncio.Task[None] | None = None
        self._tasks: set[asyncio.Task[Any]] = set()
        self._deadline: float | None = None
        self._is_closing = False
        self._advised: set[str] = set()
        self._over = asyncio.Event()
        self._stopped_at = -inf
        self.started: list[str] = []
        self.last: SessionResult | None = None
        self.stops = 0
        self.message: dict[str, Any] = self._told("idle", order.scene, None)

    @property
    def rooms(self) -> Rooms:
        """What a page may start."""
        scenes = [{"name": name, "title": scene.title} for name, scene in self._order.scenes.items()]
        return {"start": True, "scenes": scenes, "scene": self.message["scene"]}  # type: ignore[typeddict-item]

    @property
    def is_starting(self) -> bool:
        """Whether a session was started that was not found yet."""
        return self.message["state"] == "starting" and self._child is not None

    def request_stop(self) -> Answer:
        """End the session that is starting."""
        if self._child is not None and not self._child.is_asked_to_end:
            self._child.send(SIGINT)
        return {"accepted": True}

    def on_emergency(self, at: float) -> None:
        """Void what was asked for before an emergency stop of this moment, on `time.monotonic` [s]."""
        self.stops += at > self._stopped_at + SAME_PRESS_S
        self._stopped_at = max(at, self._stopped_at)
        if self._child is not None and self._child.asked_at < at and self.is_starting:
            self.request_stop()
        self._become(*(self.message[key] for key in ("state", "scene", "why")))

    def request_start(self, scene: str | None, stops: int | None) -> Answer:
        """Begin to start a session, in place of the present one; the result comes as `launcher` messages.

        `scene`: None for the present one; `stops`: that the page knew of.
        """
        if stops != self.stops:
            return refusal("an emergency stop came first; press Start again")
        chosen = scene if scene is not None else self.message["scene"]
        if chosen is not None and chosen not in self._order.scenes:
            return refusal(f"no such scene; there are {', '.join(self._order.scenes) or 'none to choose'}")
        if self._is_closing:
            return refusal("the program ends")
        if self._turn.locked():
            return refusal("another start is under way")
        self._task(self.start(chosen))
        return {"accepted": True}

    async def start(self, scene: str | None) -> None:
        """Start a session, after the present one has ended, and unless an emergency stop comes meanwhile."""
        asked_at = monotonic()
        async with self._turn:
            former = self.started[-1] if self.started else None
            if self._child is not None:
                self._child.is_replaced = True
            self._become("starting", scene)
            await self._end()
            if self._is_closing:
                return
            if asked_at < self._stopped_at:
                self._become("idle", scene, EMERGENCY)
                return
            child = self._child = await self._launch(scene, asked_at)
            if asked_at < self._stopped_at:  # while the process was made
                self.request_stop()
            self.started.append(child.name)
            self._watching = self._task(self._watch(child))
            if former is not None:
                self._task(self._inherit(former, child.name))

    def note_running(self, name: str) -> None:
        """Note that a session was found."""
        if self._child is not None and name == self._child.name and self.message["state"] == "starting":
            self._become("running", self._child.scene)

    def expect_end(self, name: str | None) -> None:
        """Note that a session was asked to end; its end does not end the program."""
        if self._child is not None and name == self._child.name:
            self._child.is_asked_to_end = True

    async def run(self, interrupted: asyncio.Event) -> None:
        """Start the first session; end the last one when it is over or interrupted, and wait for its report.

        It is over by itself if its first session does not begin, when a session of limited length has ended, and
        when its time has passed without one.
        """
        await self.start(self._order.scene)
        waits = [asyncio.ensure_future(event.wait()) for event in (interrupted, self._over)]
        await asyncio.wait(waits, timeout=self._order.duration_s, return_when=asyncio.FIRST_COMPLETED)
        while not (interrupted.is_set() or self._over.is_set()) and self._child is not None:
            await asyncio.wait(waits, timeout=SHORTEST_S, return_when=asyncio.FIRST_COMPLETED)
        for wait in waits:
            wait.cancel()
        self._is_closing = True
        async with self._turn:  # a start may be under way
            await self._end()
        for task in self._tasks:
            task.cancel()

    def signal(self, number: Signals) -> None:
        """Pass a signal on to the session; the first one ends it in order, and nothing is started any more."""
        self._is_closing = True
        if self._child is not None:
            self._child.send(number)

    async def _end(self) -> None:
        child, watching = self._child, self._watching
        if child is None or watching is None:
            return
        if not child.is_asked_to_end:  # a second signal would not wait for an orderly end
            child.send(SIGINT)
        done, _ = await asyncio.wait([watching], timeout=STOP_LIMIT_S)
        if not done:
            child.send(SIGKILL)
            await asyncio.wait([watching])

    async def _launch(self, scene: str | None, asked_at: float) -> _Child:
        order = self._order
        overrides = (*order.overrides, *(() if scene is None else order.scenes[scene].overrides))
        arguments = [order.file, "--json", "-", *(part for each in overrides for part in ("--set", each))]
        if order.duration_s is not None:  # from the first start on
            self._deadline = self._deadline or monotonic() + order.duration_s
            arguments += ["--duration", f"{max(SHORTEST_S, self._deadline - monotonic()):.3f}"]
        process = await asyncio.create_subprocess_exec(
            *self._program, "loopback", *arguments, stdin=DEVNULL, stdout=PIPE, stderr=PIPE,
            env=os.environ | {CHOSEN_BY: "figures"},  # whose document is read here
            start_new_session=True,  # Ctrl-C reaches this process only, which ends the session in order
        )  # fmt: skip
        return _Child(process, scene, asked_at)

    async def _watch(self, child: _Child) -> None:
        """Until a session ends."""
        result, notes = await child.finish(self._advise)
        is_first, self.last, self._child = self.last is None, result, None
        for note in notes:
            self._tell(note)
        if child.is_replaced:
            return
        outcome = None if result.report is None else str(result.report.get("outcome"))
        child.is_asked_to_end |= EMERGENCY in str(outcome)  # which leaves another one to be started
        has_failed = result.status != COMPLETED and not child.is_asked_to_end
        why = outcome or result.complaint if has_failed else outcome
        self._become("failed" if has_failed else "idle", child.scene, why)
        has_not_begun = is_first and result.report is None
        if not child.is_asked_to_end and (has_not_begun or self._order.duration_s is not None):
            self._over.set()
        elif has_failed:
            self._tell(f"the session failed: {why}; start another one from the page")

    def _advise(self, note: str) -> None:  # once, since every session may give it
        if note not in self._advised:
            self._advised.add(note)
            self._tell(note)

    def _become(self, state: str, scene: str | None, why: str | None = None) -> None:
        self.message = self._told(state, scene, why)
        self._announce(self.message)

    def _told(self, state: str, scene: str | None, why: str | None) -> dict[str, Any]:
        return {"type": "launcher", "state": state, "scene": scene, "why": why, "stops": self.stops}

    def _task(self, work: Any) -> "asyncio.Task[Any]":
        task = asyncio.get_running_loop().create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return task
