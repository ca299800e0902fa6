"""The emergency stop of the page: that it is answered whatever strangers do, and while the monitor is busy."""

import asyncio
import http.client
import json
import os
import resource
import subprocess
import sys
from collections import deque
from contextlib import suppress
from pathlib import Path
from signal import SIGKILL
from socket import AF_UNIX, SOCK_DGRAM, create_connection, socket
from threading import Thread
from time import monotonic, sleep
from urllib.request import urlopen

import aiohttp
import numpy as np

from plugins.figures.tests.sources import daemons
from plugins.page.tests.monitors import Monitor
from plugins.page.tests.test_web import served
from tests.program import child
from tests.wait import PATIENCE, in_loop, soon
from weberlink.telemetry.runtime_directory import directory
from weberlink_page.front import EMERGENCY, MOST_SILENT, PROOF_HEADER

PAGES, IDLE, FRONT = 4, 1200, "weberlink_page.front"
NAME = str(2**22 + os.getpid())  # of a session that nobody else on this host has
FLOOD = f"""
import asyncio, contextlib, resource, socket, sys, aiohttp
host, port, name = sys.argv[1:]
_, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))
def idle(number):
    connection = socket.create_connection((host, int(port)))
    with contextlib.suppress(OSError):  # closed already for a newer one
        connection.send(b"GET / HTTP/1.1\\r\\nHost: localhost" if number % 2 else b"")
    return connection
async def flood(client, kind):
    async with client.ws_connect(f"http://{{host}}:{{port}}/ws?session={{name}}", autoping=False) as page:
        async def read():
            async for _ in page: pass
        reading = asyncio.create_task(read())
        print("open", flush=True)
        while not page.closed:
            for number in range(100):
                await (page.ping(b"x") if kind else page.send_str('{{"type":"subscribe"}}'))
            await asyncio.sleep(0)
async def main():
    async with aiohttp.ClientSession() as client:
        await asyncio.gather(*(flood(client, number % 2) for number in range({PAGES})), return_exceptions=True)
crowd = [idle(number) for number in range({IDLE})]
asyncio.run(main())
"""
"""Connections that ask for nothing, and pages without the key that send pings and requests without a pause."""


def stop(where: str, token: str) -> float:
    client = http.client.HTTPConnection(where, timeout=PATIENCE)
    at = monotonic()
    client.request("POST", EMERGENCY, headers={PROOF_HEADER: token})
    assert json.loads(client.getresponse().read())["accepted"]
    client.close()
    return at


@in_loop
async def test_stop_reaches_the_daemons_while_the_loop_stands_still(tmp_path: Path) -> None:
    with daemons(tmp_path) as sides:
        async with served(tmp_path) as (where, watch):
            watch.look(monotonic())
            asker = Thread(target=stop, args=(where, watch.requests.token))
            asker.start()
            end = monotonic() + PATIENCE
            while any(side.halted_at is None for side in sides):  # computes, and gives the loop no turn
                assert monotonic() < end, "the stop waits for the loop"
            await asyncio.to_thread(asker.join)


@in_loop
async def test_stop_is_answered_after_silent_connections_speak_as_newer_ones_take_their_place(tmp_path: Path) -> None:
    with daemons(tmp_path) as sides:
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


@in_loop
async def test_a_stop_that_is_not_acknowledged_says_so_and_stays_armed(tmp_path: Path) -> None:
    async with served(tmp_path) as (where, watch), aiohttp.ClientSession() as client:
        with socket(AF_UNIX, SOCK_DGRAM) as side:
            side.bind(str(tmp_path / "weberlink-7-slave.ask"))
            headers = {PROOF_HEADER: watch.requests.token}
            async with client.post(f"http://{where}{EMERGENCY}", headers=headers) as response:
                told = await response.json()
            assert (response.status, told["accepted"], told["why"]) == (409, False, "7-slave: does not answer")
            first = json.loads(side.recv(100))
            side.setblocking(False)
            with suppress(BlockingIOError):  # what has come meanwhile
                while side.recv(100):
                    pass
            side.settimeout(PATIENCE)
            assert json.loads(await asyncio.to_thread(side.recv, 100)) == first


@in_loop
async def test_the_front_is_started_again_and_its_arguments_tell_no_token(tmp_path: Path) -> None:
    with daemons(tmp_path) as sides:
        said: list[str] = []
        async with served(tmp_path, said) as (where, watch):
            for _ in range(2):
                front = await soon(lambda: child(os.getpid(), FRONT), "the front")
                assert watch.requests.token not in Path(f"/proc/{front}/cmdline").read_text()
                await asyncio.to_thread(stop, where, watch.requests.token)
                os.kill(front, SIGKILL)
                await soon(lambda front=front: child(os.getpid(), FRONT) not in (None, front), "another front")
            assert ["was killed by SIGKILL" in line for line in said] == [True, True]
        assert all(side.halted_at is not None for side in sides)


@in_loop
async def test_a_request_that_does_not_come_is_given_up_and_the_front_goes_on(tmp_path: Path) -> None:
    with daemons(tmp_path):
        said: list[str] = []
        async with served(tmp_path, said) as (where, watch):
            reader, writer = await asyncio.open_connection(*where.split(":"))
            writer.write(f"POST {EMERGENCY} HTTP/1.1\r\nHost: localhost".encode())
            await asyncio.to_thread(stop, where, watch.requests.token)
            async with asyncio.timeout(PATIENCE):
                assert await reader.read() == b"", "closed"
            await asyncio.to_thread(stop, where, watch.requests.token)
            assert said == []
            writer.close()


def test_requests_that_are_none_are_answered_and_write_nothing() -> None:
    with Monitor("--session", NAME) as monitor:
        host, port = monitor.url.removeprefix("http://").split(":")
        monitor.until_said("waiting for a daemon")
        before = monitor.said
        for head in (
            b"GET / HTTP/1.1\r\nHost: [\xff\r\n: x",
            b"GET //[ HTTP/1.1",
            b"GET / HTTP/1.1\r\nX: " + b"x" * 9000,
        ):
            with create_connection((host, int(port)), PATIENCE) as client:
                client.sendall(head + b"\r\n\r\n")
                assert client.recv(100).startswith(b"HTTP/1.")
        assert monitor.said == before


def test_stop_is_answered_within_100_ms_and_the_page_survives_a_crowd_and_a_flood() -> None:
    """The median, which a busy machine does not decide: a stop that waits for its turn takes longer each time."""
    taken = []
    with daemons(directory(), NAME) as sides, Monitor("--session", NAME) as monitor:
        where, key = monitor.url.removeprefix("http://"), monitor.key
        resource.prlimit(monitor.pid, resource.RLIMIT_NOFILE, (1024, 1024))
        assert os.getpriority(os.PRIO_PROCESS, monitor.pid) >= 5, "daemons go before it"
        monitor.until_said("slave at")
        command = [sys.executable, "-c", FLOOD, *where.split(":"), NAME]
        with subprocess.Popen(command, stdout=subprocess.PIPE) as flood:
            assert flood.stdout is not None
            for _ in range(PAGES):
                assert flood.stdout.readline() == b"open\n"
            for number in range(15):
                sleep(0.02 + 0.001 * (number % 37))  # at every phase of the monitor's period
                asked = stop(where, key)
                taken.append(max(monotonic() - asked, *(side.halted_at - asked for side in sides)))
            assert flood.poll() is None, "the pages have left"
            with urlopen(f"http://{where}/", timeout=PATIENCE) as page:
                assert page.status == 200, "the page is served"
            flood.kill()
    assert np.median(taken) < 0.1
