"""The picture beside the scene: the robot's scene, and what cannot be shown."""

import asyncio
import struct
from collections.abc import Awaitable, Callable
from pathlib import Path
from time import monotonic
from typing import Any

import aiohttp
import numpy as np
import pytest
from aiohttp import web
from aiohttp.test_utils import TestServer

from plugins.page.tests.test_watch import told
from tests.watching.sources import HandSource, description
from weberlink.cli.shipped import find
from weberlink.telemetry.pose import PoseWriter, path_of
from weberlink.watching.session import WatchedSession
from weberlink_page.camera import CameraService, View, parse_view, robot_of
from weberlink_page.viewer import Viewer
from weberlink_page.watch import SessionWatcher

cv2 = pytest.importorskip("cv2")
PID = 2**22 + 7
"""Of no process."""

Look = Callable[[aiohttp.ClientSession, str, SessionWatcher], Awaitable[None]]


def look_at(view: View, look: Look) -> list[str]:
    """Let a page look at a view; returns what the user was told."""
    said: list[str] = []

    async def run() -> None:
        watch = SessionWatcher(None, "7", said.append)
        desk, application = CameraService(watch, view, said.append), web.Application()
        application.router.add_get("/view", desk.serve)
        async with asyncio.timeout(60), TestServer(application) as server, aiohttp.ClientSession() as client:
            await look(client, str(server.make_url("/view")), watch)
            await desk.close()

    asyncio.run(run())
    return said


def picture(message: aiohttp.WSMessage) -> tuple[float, Any]:
    assert message.type is aiohttp.WSMsgType.BINARY, message
    (age,) = struct.unpack("<d", message.data[:8])
    return age, cv2.imdecode(np.frombuffer(message.data[8:], np.uint8), cv2.IMREAD_COLOR)


def test_camera_that_cannot_be_opened_is_told(tmp_path: Path) -> None:
    path = tmp_path / "video0"
    path.write_text("nonsense")

    async def look(client: aiohttp.ClientSession, url: str, watch: SessionWatcher) -> None:
        async with client.ws_connect(url) as socket:
            assert (await socket.receive()).type is aiohttp.WSMsgType.CLOSE

    (line,) = look_at(parse_view(f"camera:{path}"), look)
    assert line.startswith(f"view: camera {path}: cannot be opened")


def test_scene_of_the_robot_is_drawn_in_its_pose(tmp_path: Path) -> None:
    pytest.importorskip("weberlink_mujoco")
    mujoco, shipped = pytest.importorskip("mujoco"), find("mujoco-arm")
    source = HandSource("slave", ring=tmp_path / "weberlink-7-slave.ring")
    file = {"file": str(shipped), "changes": [], "pid": PID}
    source.description = description("slave", shipped) | file
    session = WatchedSession("7", source)
    model = mujoco.MjModel.from_xml_path(str((robot_of(session) or [""])[0]))
    pose = PoseWriter(path_of(PID), model.nq)
    try:
        pose.write(monotonic(), np.zeros(model.nq))

        async def look(client: aiohttp.ClientSession, url: str, watch: SessionWatcher) -> None:
            watch.put(session)
            viewer = Viewer(None, may_change=False)
            watch.join(viewer)
            assert told(viewer)[0]["view"] == "robot"
            where = f"{url}?session=7"
            async with client.ws_connect(where) as socket, client.ws_connect(where) as other:
                first = await socket.receive()
                if first.type is not aiohttp.WSMsgType.BINARY:
                    pytest.skip("MuJoCo cannot draw here; make system installs what it needs")
                pose.write(monotonic(), np.full(model.nq, 0.4))
                second = await socket.receive()
                assert picture(await other.receive())[1].shape == (360, 480, 3)
            (age, before), (_, after) = picture(first), picture(second)
            assert 0.0 <= age < 30.0
            assert before.shape == after.shape == (360, 480, 3)
            moved = np.abs(before.astype(int) - after).max(axis=2) > 40
            assert 0.001 < moved.mean() < 0.5

        look_at(View("robot"), look)
    finally:
        pose.close()
