"""`python -m plugins.video.trials`: age of a picture on the screen of a real browser, and the force beside pictures.

Links are emulated, for session and pictures alike; a LAN is two network namespaces, as root; a slow link is one queue
that both share. Needs Chromium with its driver. Prints a line of JSON for each run, with the load of the host.
"""

import argparse
import asyncio
import json
import os
import tempfile
from base64 import b64decode
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from io import BytesIO
from math import inf
from pathlib import Path
from random import Random
from select import select
from socket import AF_INET, SOCK_DGRAM, socket
from threading import Event, Thread
from time import monotonic, sleep, time
from typing import Any

import numpy as np
from aiohttp import ClientSession
from PIL import Image

from plugins.anywhere.tests.namespaces import Namespace
from plugins.page.tests.browser import browser
from plugins.page.tests.monitors import Monitor
from plugins.video.tests.test_live import Reader
from trials.rig import Side
from weberlink.config import MASTER, SLAVE
from weberlink.protocol.emulation import EmulatedLink, Emulation
from weberlink.protocol.keys import generate
from weberlink_video.pattern import time_in

LAN = "LAN"
LINKS = {"loopback": "{}", LAN: "{}", "50 ms, 2 % loss": "{delay_ms: 25, loss: 0.02}"}
WHERE = """
const box = document.querySelector("#frames canvas").getBoundingClientRect();
const scale = Math.min(box.width / 640, box.height / 480);
const [x, y] = [box.left + box.width / 2 - 320 * scale, box.top + box.height / 2 - 240 * scale];
return [x, y, x + 640 * scale, y + 480 * scale];
"""
"""Of the test picture on the page [px]."""
PORT = 47_200
SLOW = Emulation(delay_s=0.01, rate_bit_s=2e6)


def session(
    folder: Path, emulate: str = "{}", *, host: str = "127.0.0.1", port: int = PORT, shows: bool = True
) -> Path:
    """A file of both ends, whose robot is called at this port, and for pictures at the next one."""
    if not (folder / "key").exists():
        generate(folder / "key")
    address = f"{host}:{port}"
    text = f"link: {{listen: '{address}', slave: '{address}', key_file: key, silence_ms: 500, emulate: {emulate}}}\n"
    text += "slave:\n  robot: {driver: point}\n  scene: [{shape: plane, stiffness_n_m: 500}]\n"
    if shows:
        text += f"  cameras: {{driver: video, port: {port + 1}, sources: [{{name: test, kind: pattern}}]}}\n"
    (file := folder / f"{port}.yaml").write_text(text)
    return file


@contextmanager
def lan() -> Iterator[tuple[tuple[str, ...], str]]:
    """What runs a command on the robot's host, and its address, while this thread is on the operator's."""
    robot, desk = Namespace("robot"), Namespace("desk")
    try:
        robot.ip(f"link add lan type veth peer name lan netns {desk.name}")
        for number, end in enumerate((robot, desk), 1):
            end.ip(f"address add 10.99.0.{number}/24 dev lan", "link set lan up")
        with desk.entered():
            yield robot.prefix, "10.99.0.1"
    finally:
        for end in (robot, desk):
            end.delete()


@contextmanager
def bottleneck(emulation: Emulation, ports: Mapping[int, int]) -> Iterator[None]:
    """Pass datagrams that come to ports on to others, and the answers back: each way is one queue for all of them."""
    ways = [EmulatedLink[tuple[socket, Any]](emulation, Random(seed).random) for seed in (1, 2)]
    callers: dict[socket, Any] = {}
    over = Event()
    with ExitStack() as stack:
        fronts = [stack.enter_context(socket(AF_INET, SOCK_DGRAM)) for _ in ports]
        backs = [stack.enter_context(socket(AF_INET, SOCK_DGRAM)) for _ in ports]
        for front, back, port, target in zip(fronts, backs, ports, ports.values(), strict=True):
            front.bind(("127.0.0.1", port))
            back.connect(("127.0.0.1", target))

        def run() -> None:
            with suppress(PermissionError):
                os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(40))
            while not over.is_set():
                due = min(way.next_due() or inf for way in ways)
                for ready in select([*fronts, *backs], [], [], max(0.0, min(0.05, due - monotonic())))[0]:
                    with suppress(ConnectionError):
                        data, caller = ready.recvfrom(2048)
                        if ready in fronts:
                            callers[ready] = caller
                            ways[0].send(data, (backs[fronts.index(ready)], None), monotonic())
                        elif (front := fronts[backs.index(ready)]) in callers:
                            ways[1].send(data, (front, callers[front]), monotonic())
                for data, (by, to) in (each for way in ways for each in way.receive(monotonic())):
                    with suppress(ConnectionError):
                        by.send(data) if to is None else by.sendto(data, to)

        thread = Thread(target=run)
        thread.start()
        yield
        over.set()
        thread.join()


def glass_to_glass(folder: Path, name: str, seconds: float) -> dict[str, Any]:
    with ExitStack() as stack:
        prefix, host = stack.enter_context(lan()) if name == LAN else ((), "127.0.0.1")
        file = session(folder, LINKS[name], host=host)
        stack.enter_context(Side(SLAVE, file, prefix=prefix))
        operator = stack.enter_context(Side(MASTER, file))
        monitor = stack.enter_context(Monitor("--session", operator.pid))
        page = stack.enter_context(browser(folder / "profile"))
        page.size(1280, 800)
        page.open(monitor.address)
        page.wait(lambda: page.number("frame-age") > 0.0, "a picture")
        sleep(4.0)
        seen = asyncio.run(screen(page.driver.capabilities["goog:chromeOptions"]["debuggerAddress"], seconds))
        where = page.run(WHERE)
    shown = [
        (at, time_in(np.asarray(Image.open(BytesIO(jpeg)).convert("L").resize((640, 480), box=where))))
        for at, jpeg in seen
    ]
    begun = time() - monotonic()
    first = {picture: 1e3 * (at - begun - picture) for at, picture in reversed(shown) if picture is not None}
    p50, p99 = np.percentile(list(first.values()), (50, 99)).round(1).tolist()
    return {"pictures_per_s": round(len(first) / seconds, 1), "p50_ms": p50, "p99_ms": p99}


async def screen(debugger: str, seconds: float) -> list[tuple[float, bytes]]:
    """Wall clock [s] and JPEG of what Chromium puts on its screen, each time that it does (DevTools protocol)."""
    seen, until = [], monotonic() + seconds
    async with ClientSession(f"http://{debugger}") as client:
        targets = await (await client.get("/json")).json()
        page = next(each["webSocketDebuggerUrl"] for each in targets if each["type"] == "page")
        async with client.ws_connect(page, max_msg_size=0) as socket:
            await socket.send_json({"id": 0, "method": "Page.startScreencast", "params": {"format": "jpeg"}})
            while (left := until - monotonic()) > 0.0:
                with suppress(TimeoutError):
                    said = await socket.receive_json(timeout=left)
                    if said.get("method") == "Page.screencastFrame":
                        told, taken = said["params"], {"sessionId": said["params"]["sessionId"]}
                        await socket.send_json({"id": 1, "method": "Page.screencastFrameAck", "params": taken})
                        seen.append((told["metadata"]["timestamp"], b64decode(told["data"])))
    return seen


def force(folder: Path, seconds: float, *, shows: bool, is_slow: bool) -> dict[str, Any]:
    """One way of an update to the operator, lateness of his end's ticks, and how often and how old pictures come."""
    front, ages = PORT + 10 if is_slow else PORT, list[float]()
    files = [session(folder, port=port, shows=shows) for port in (PORT, front)]
    with ExitStack() as stack:
        if is_slow:
            stack.enter_context(bottleneck(SLOW, {front: PORT, front + 1: PORT + 1}))
        stack.enter_context(Side(SLAVE, files[0]))
        sleep(2.0)
        master = stack.enter_context(Side(MASTER, files[1], "--duration", seconds))
        with Reader(master.pid, "master") if shows else nullcontext() as reader:
            while master.status is None:
                ages += [1e3 * (monotonic() - each.at) for each in reader.read() if each.jpeg] if reader else []
                sleep(2e-3)
        report = master.report
    ticks = report["ticks"]["master"]
    told = {"one_way_us": report["link"]["one_way_us"], "late_us": ticks["lateness_us"], "missed": ticks["missed"]}
    told |= {"faults": report["faults"]["master"]}
    if shows:
        p50, p99 = np.percentile(ages, (50, 99)).round(1).tolist()
        told |= {"pictures_per_s": round(len(ages) / seconds, 1), "p50_ms": p50, "p99_ms": p99}
    return told


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--pairs", type=int, default=3, help="of the force with and without pictures, in turn")
    parser.add_argument("--links", nargs="*", choices=LINKS, default=list(LINKS))
    parser.add_argument("--slow", action="store_true", help="of the force on a link of 2 Mbit/s")
    arguments = parser.parse_args()
    for name in arguments.links:
        with tempfile.TemporaryDirectory() as folder:
            found = glass_to_glass(Path(folder), name, arguments.seconds)
        print(json.dumps({"link": name, **found, "load": os.getloadavg()[0]}), flush=True)
    for pair in range(2 * arguments.pairs):
        shows = bool(pair % 2)
        with tempfile.TemporaryDirectory() as folder:
            found = force(Path(folder), arguments.seconds, shows=shows, is_slow=arguments.slow)
        print(json.dumps({"pictures": shows, **found, "load": os.getloadavg()[0]}), flush=True)


if __name__ == "__main__":
    main()
