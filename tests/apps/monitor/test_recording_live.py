"""A running session that a page records with a mark, and what `info` says of that file."""

import asyncio
import signal
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import aiohttp
import pytest
from typer.testing import CliRunner

from tests.apps.monitor.monitors import Monitor
from tests.apps.monitor.test_monitor import there
from tests.system.processes import PATIENCE, PATIENT, Program, document
from weberlink.cli import app
from weberlink.telemetry.recording.reader import read_recording

Message = dict[str, Any]


class Page:
    """A page that keeps what it is sent."""

    def __init__(self, socket: aiohttp.ClientWebSocketResponse) -> None:
        self._socket = socket
        self.messages: list[Message] = []

    async def ask(self, **request: Any) -> None:
        hello = await self.until("hello")
        await self._socket.send_json(request | {"token": hello.get("token")})

    async def until(self, kind: str, **values: Any) -> Message:
        """The first message, told already or to come, of a kind with these values."""
        seen = 0
        while True:
            for message in self.messages[seen:]:
                if message["type"] == kind and all(message.get(name) == value for name, value in values.items()):
                    return message
            seen = len(self.messages)
            received = await self._socket.receive(PATIENCE)
            assert received.type is aiohttp.WSMsgType.TEXT, received
            self.messages.append(document(received.data))


@asynccontextmanager
async def page(url: str, key: str, session: str) -> AsyncIterator[Page]:
    async with asyncio.timeout(PATIENCE), aiohttp.ClientSession() as client:
        await there(client, url, session)
        async with client.ws_connect(f"{url}/ws?session={session}&key={key}") as socket:
            yield Page(socket)


async def record(url: str, key: str, session: str) -> Message:
    """Record about two seconds with a mark; returns the last state of the recording."""
    async with page(url, key, session) as shown:
        assert (await shown.until("hello"))["records"]
        await shown.until("figures", engaged={"master": True, "slave": True})
        await shown.ask(type="record", do="start", name="../touch")
        await shown.until("recording", state="on")
        await asyncio.sleep(1.0)
        await shown.ask(type="record", do="mark", text="first touch")
        assert (await shown.until("recording", marks=1))["state"] == "on"
        await asyncio.sleep(1.0)
        await shown.ask(type="record", do="stop")
        return await shown.until("recording", state="done")


@pytest.mark.realtime
@pytest.mark.hunt
def test_recorded_part_of_a_session_has_its_figures_and_its_mark(tmp_path: Path) -> None:
    folder = tmp_path / "recordings"
    with Monitor(tmp_path, "--recordings", folder) as monitor, Program("loopback", "--json", "-", *PATIENT) as program:
        done = asyncio.run(record(monitor.url, monitor.key, str(program.pid)))
        program.send(signal.SIGTERM)
        status, output, errors = program.finish()
        assert status == 0, errors
    path = folder / "touch.mcap"
    assert done["path"] == str(path) and done["bytes"] == path.stat().st_size and done["marks"] == 1
    recording = read_recording(path)
    assert recording.complete and [mark.text for mark in recording.marks] == ["first touch"]
    whole = document(output)
    for side, records in recording.records.items():
        assert 1000 < len(records) < whole["ticks"][side]["count"]
    told = CliRunner().invoke(app, ["record", "info", str(path)])
    assert told.exit_code == 0 and "s: first touch" in told.output and "during the session" in told.output
    report = document(CliRunner().invoke(app, ["record", "info", str(path), "--json", "-"]).stdout)
    (mark,) = report["marks"]
    assert mark["text"] == "first touch" and 0.0 < mark["at_s"] < report["duration_s"]
