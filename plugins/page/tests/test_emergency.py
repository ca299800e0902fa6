"""The emergency stop: which sessions it ends, and how soon while the event loop of the monitor is busy."""

import asyncio
import http.client
import json
import os
import subprocess
import sys
from collections import deque
from contextlib import suppress
from pathlib import Path
from socket import create_connection, socket
from threading import Thread
from time import monotonic, sleep

import numpy as np
import pytest

from plugins.page.tests.monitors import Monitor
from plugins.page.tests.test_web import served
from tests.wait import PATIENCE
from tests.watching.sources import Daemon, daemons
from weberlink.telemetry.runtime_directory import directory
from weberlink_page.listener import EMERGENCY, MOST_SILENT, PROOF_HEADER
from weberlink_page.watch import SessionWatcher

ENDED, FIRST, SECOND = "6", "7", "8"
PAGES = 4
FLOOD = f"""
import asyncio, json, sys, aiohttp
url, token = sys.argv[1:]
valid = json.dumps(dict(type="drive", target=[0, 0, 0.01], held=True, token=token))
async def flood(client):
    async with client.ws_connect(url) as page:
        async def read():
            async for _ in page: pass
        print("open", flush=True)
        reading = asyncio.create_task(read())
        while not page.closed:
            for number in range(100):
                await page.send_str(valid if number % 4 else "{{}}")
            await asyncio.sleep(0)
async def main():
    async with aiohttp.ClientSession() as client:
        await asyncio.gather(*(flood(client) for _ in range({PAGES})), return_exceptions=True)
asyncio.run(main())
"""
"""Pages that send requests without a pause, some of which are none."""


def stop(where: str, token: str) -> float:
    """Ask for an emergency stop; returns when [s]."""
    client = http.client.HTTPConnection(where, timeout=PATIENCE)
    at = monotonic()
    client.request("POST", EMERGENCY, headers={PROOF_HEADER: token})
    assert json.loads(client.getresponse().read())["accepted"]
    client.close()
    return at


@pytest.mark.parametrize(
    ("name", "halted"),
    [
        (FIRST, {FIRST}),
        (None, {FIRST, SECOND}),
        ("1234", {FIRST, SECOND}),
        (ENDED, {FIRST, SECOND}),
    ],
)
def test_an_emergency_stop_ends_the_named_session_or_all_if_it_does_not_run(
    tmp_path: Path, name: str | None, halted: set[str]
) -> None:
    async def run() -> None:
        loop = asyncio.get_running_loop()
        watch = SessionWatcher(tmp_path, None, lambda _: None)
        over = Daemon(tmp_path, ENDED, "slave", loop)
        watch.look(0.0)
        over.close()
        sides = {
            (session, side): Daemon(tmp_path, session, side, loop)
            for session in (FIRST, SECOND)
            for side in ("master", "slave")
        }
        watch.look(10.0)
        assert watch.sessions[ENDED].ended
        answer = await asyncio.to_thread(watch.emergency, name)
        for (session, _), daemon in sides.items():
            assert (daemon.halted_at is not None) is (session in halted), "at both ends"
        assert answer["accepted"]
        for daemon in sides.values():
            daemon.close()
        for each in watch.sessions.values():
            each.close()

    asyncio.run(run())


def test_stop_reaches_the_daemons_while_the_loop_stands_still(tmp_path: Path) -> None:
    async def run(sides: list[Daemon]) -> None:
        async with served(tmp_path) as (where, watch):
            watch.look(monotonic())
            asker = Thread(target=stop, args=(where, watch.requests.token))
            asker.start()
            end = monotonic() + PATIENCE
            while any(side.halted_at is None for side in sides):  # computes, and gives the loop no turn
                assert monotonic() < end, "the stop waits for the loop"
            await asyncio.to_thread(asker.join)

    with daemons(tmp_path) as sides:
        asyncio.run(run(sides))


def test_stop_is_answered_after_silent_connections_speak_as_newer_ones_take_their_place(tmp_path: Path) -> None:
    async def run(sides: list[Daemon]) -> None:
        async with served(tmp_path) as (where, watch):
            watch.look(monotonic())

            def crowd() -> None:
                address = ("127.0.0.1", int(where.partition(":")[2]))
                silent = deque(create_connection(address) for _ in range(MOST_SILENT))
                for _ in range(300):
                    newest, oldest = socket(), silent.popleft()
                    with oldest, suppress(OSError):  # closed already for another one
                        oldest.send(b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n")
                        newest.connect(address)
                    silent.append(newest)
                stop(where, watch.requests.token)
                for each in silent:
                    each.close()

            await asyncio.to_thread(crowd)
        assert all(side.halted_at is not None for side in sides)

    with daemons(tmp_path) as sides:
        asyncio.run(run(sides))


def test_stop_comes_within_100_ms_while_four_pages_flood_the_monitor(tmp_path: Path) -> None:
    """The median, which a busy machine does not decide: a stop that waits for its turn takes longer each time."""
    taken = []
    with (
        daemons(directory(), str(2**22 + os.getpid())) as sides,
        Monitor(tmp_path, "--session", 2**22 + os.getpid()) as monitor,
    ):
        url, key = monitor.url, monitor.key
        assert os.getpriority(os.PRIO_PROCESS, monitor.pid) >= 5, "daemons go before it"
        monitor.until_said("slave at")
        command = [sys.executable, "-c", FLOOD, f"{url}/ws?key={key}", key]
        with subprocess.Popen(command, stdout=subprocess.PIPE) as flood:
            assert flood.stdout is not None
            for _ in range(PAGES):
                assert flood.stdout.readline() == b"open\n"
            for number in range(15):
                sleep(0.02 + 0.001 * (number % 37))  # at every phase of the monitor's period
                asked = stop(url.removeprefix("http://"), key)
                taken.append(max(side.halted_at - asked for side in sides if side.halted_at is not None))
            assert flood.poll() is None, "the pages have left"
            flood.kill()
    assert np.median(taken) < 0.1
