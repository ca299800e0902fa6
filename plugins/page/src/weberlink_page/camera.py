"""A picture beside the scene: frames of a camera or of the robot's simulated scene, over a WebSocket.

A message is the age of the frame when it is sent [s], as a little-endian double, and a JPEG. A slow page skips frames.
"""

import asyncio
import os
from asyncio.subprocess import DEVNULL, PIPE
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from struct import pack
from time import monotonic
from typing import Any, NamedTuple

from aiohttp import WSCloseCode, web

from weberlink.child_process import python
from weberlink.telemetry.pose import path_of
from weberlink.watching.session import WatchedSession
from weberlink_page.frames import BACKENDS, CAMERA, FRAME, PERIOD_S, ROBOT
from weberlink_page.viewer import Viewer
from weberlink_page.watch import SessionWatcher

MOST_VIEWS = 16
LARGEST_FRAME = 4 * 2**20
HEARTBEAT_S = 20.0
PREFIX = f"{CAMERA}:"


class ViewError(ValueError):
    """The view cannot be shown; one line that says what to do."""


class View(NamedTuple):
    """What to show: a kind of `weberlink_page.frames`, and the camera."""

    kind: str
    source: str = ""


def parse_view(text: str) -> View:
    """Read the option: `camera:DEVICE` or `robot`.

    Raises:
        ViewError: it is neither, or there is no such camera.
    """
    if text == ROBOT:
        return View(ROBOT)
    if not text.startswith(PREFIX):
        raise ViewError(f"--view {text}: expected camera:DEVICE or robot")
    device = text.removeprefix(PREFIX)
    path = Path(f"/dev/video{device}" if device.isdecimal() else device)
    if not path.exists():
        there = ", ".join(str(path) for path in sorted(Path("/dev").glob("video*"))) or "none"
        raise ViewError(f"--view {text}: there is no {path}; cameras here: {there}")
    return View(CAMERA, str(path))


class FrameSource:
    """The newest frame of a child process, which runs while somebody looks.

    Args:
        commands: environment and command of processes that make the frames; each is tried after the one before has
            failed without a frame.
        tell: called with lines for the user.

    Attributes:
        failure: why there are no more frames; None while there may be some.
    """

    def __init__(self, commands: list[tuple[dict[str, str], list[str]]], tell: Callable[[str], None]) -> None:
        self.newest: tuple[float, bytes] | None = None
        self.failure: str | None = None
        self._commands, self._tell = commands, tell
        self._came = asyncio.Event()
        self._task = asyncio.get_running_loop().create_task(self._run())

    async def after(self, at: float) -> tuple[float, bytes] | None:
        """The newest frame, once it is newer than a moment [s]; None when there are no more."""
        while self.failure is None and (self.newest is None or self.newest[0] <= at):
            self._came.clear()
            await self._came.wait()
        return self.newest if self.newest is not None and self.newest[0] > at else None

    async def close(self) -> None:
        """End the process."""
        self._task.cancel()
        with suppress(asyncio.CancelledError):
            await self._task

    async def _run(self) -> None:
        why = ""
        for variables, command in self._commands:
            if self.newest is None:
                why = await self._follow(variables, command)
        self.failure = why
        self._tell(f"view: {why}")
        self._came.set()

    async def _follow(self, variables: dict[str, str], command: list[str]) -> str:
        """Take frames of a process until it ends; returns why."""
        process = await asyncio.create_subprocess_exec(
            *command, stdin=DEVNULL, stdout=PIPE, stderr=PIPE, env=os.environ | variables, start_new_session=True
        )
        assert process.stdout is not None and process.stderr is not None
        try:
            with suppress(asyncio.IncompleteReadError):
                while True:
                    at, length = FRAME.unpack(await process.stdout.readexactly(FRAME.size))
                    self.newest = (at, await process.stdout.readexactly(min(length, LARGEST_FRAME)))
                    self._came.set()
            said = (await process.stderr.read()).decode(errors="replace").strip().splitlines()
            return said[-1] if said else "its process has ended"
        finally:
            with suppress(ProcessLookupError):
                process.kill()
            await process.wait()


class CameraService:
    """Serves the view of a session to pages.

    Args:
        watch: sessions.
        view: what to show.
        tell: called with lines for the user.
    """

    def __init__(self, watch: SessionWatcher, view: View, tell: Callable[[str], None]) -> None:
        self._watch, self._view, self._tell = watch, view, tell
        self._sources: dict[str, FrameSource] = {}
        """By name of the session that a robot is of; of a camera, one for all."""
        self._lookers: dict[str, set[web.WebSocketResponse]] = {}
        watch.attach(self)

    def look(self, now: float) -> None:
        """Frames go to the WebSocket of the picture."""

    def hello(self, session: WatchedSession, viewer: Viewer) -> dict[str, Any]:
        """The kind of view of the session; None without one."""
        del viewer
        return {"view": self._view.kind if self._commands(session.name, session)[1] else None}

    def introduced(self, session: WatchedSession, viewer: Viewer) -> None:
        """The page opens the WebSocket itself."""

    async def serve(self, request: web.Request) -> web.StreamResponse:
        """Send frames to a page until it leaves, or until there are no more."""
        if sum(map(len, self._lookers.values())) >= MOST_VIEWS:
            raise web.HTTPServiceUnavailable
        asked = request.query.get("session", "")
        name, commands = self._commands(asked, self._watch.sessions.get(asked))
        if not commands:
            raise web.HTTPNotFound
        socket = web.WebSocketResponse(max_msg_size=1024, heartbeat=HEARTBEAT_S, compress=False)
        await socket.prepare(request)
        if name not in self._sources or self._sources[name].failure is not None:
            self._sources[name] = FrameSource(commands, self._tell)
        lookers = self._lookers.setdefault(name, set())
        lookers.add(socket)
        sender = asyncio.get_running_loop().create_task(_send(self._sources[name], socket))
        try:
            async for _ in socket:
                pass  # a page has nothing to say here
        finally:
            sender.cancel()
            with suppress(asyncio.CancelledError, ConnectionError):
                await sender
            lookers.discard(socket)
            if not lookers and name in self._sources:
                await self._sources.pop(name).close()
        return socket

    async def close(self) -> None:
        """End all views."""
        for socket in [socket for lookers in self._lookers.values() for socket in lookers]:
            with suppress(TimeoutError, ConnectionError):
                async with asyncio.timeout(0.5):
                    await socket.close(code=WSCloseCode.GOING_AWAY, message=b"the monitor ends")
        for source in list(self._sources.values()):
            await source.close()

    def _commands(
        self, name: str, session: WatchedSession | None
    ) -> tuple[str, list[tuple[dict[str, str], list[str]]]]:
        """Name of the source for a session, and the commands that make its frames; none if it has no view."""
        run = python("-m", "weberlink_page.frames", self._view.kind)
        if self._view.kind != ROBOT:
            return "", [({}, [*run, self._view.source])]
        robot = None if session is None else robot_of(session)
        return name, [] if robot is None else [({"MUJOCO_GL": backend}, [*run, *robot]) for backend in BACKENDS]


def robot_of(session: WatchedSession) -> list[str] | None:
    """MJCF model and pose of the simulated robot of a session on this host; None without one."""
    source = session.sources.get("slave")
    described = None if source is None or session.ended else source.description
    robot = (described or {}).get("system", {}).get("slave", {}).get("robot", {})
    if described is None or not str(robot.get("model")).endswith(".xml"):
        return None
    return [str(Path(described.get("file", "")).parent / robot["model"]), str(path_of(int(described["pid"])))]


async def _send(source: FrameSource, socket: web.WebSocketResponse) -> None:
    """Send the newest frame again and again, at most at the rate of frames."""
    at = 0.0
    while True:
        began = monotonic()
        frame = await source.after(at)
        if frame is None:
            await socket.close(message=(source.failure or "").encode()[:120])
            return
        at, jpeg = frame
        await socket.send_bytes(pack("<d", monotonic() - at) + jpeg)
        await asyncio.sleep(max(0.0, began + PERIOD_S - monotonic()))
