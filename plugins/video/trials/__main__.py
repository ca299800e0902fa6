"""`python -m plugins.video.trials`: age of a test picture in a real browser, and the force with and without pictures.

Links are emulated, for session and pictures alike; a LAN is two network namespaces, as root; a slow link is one queue
that both share. Needs Chromium with its driver. Prints a line of JSON for each run, with the load of the host.
"""

import argparse
import json
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from math import inf
from pathlib import Path
from random import Random
from select import select
from socket import AF_INET, SOCK_DGRAM, socket
from threading import Event, Thread
from time import monotonic, sleep, time
from typing import Any

import numpy as np

from plugins.anywhere.tests.namespaces import Namespace
from plugins.page.tests.browser import browser
from plugins.video.tests.test_live import Reader
from weberlink.protocol.emulation import EmulatedLink, Emulation
from weberlink.protocol.keys import generate
from weberlink_video.pattern import BITS

LAN = "LAN"
LINKS = {"loopback": "{}", LAN: "{}", "50 ms, 2 % loss": "{delay_ms: 25, loss: 0.02}"}
SAMPLE = """
const done = arguments[arguments.length - 1], until = performance.now() + 1000 * arguments[0], seen = [];
let last = "";
(function look() {
  const canvas = document.querySelector("#frames canvas");
  if (canvas && canvas.dataset.drawn !== last && canvas.width > 300) {
    last = canvas.dataset.drawn;
    const [width, height] = [canvas.width, canvas.height >> 1];
    const { data } = canvas.getContext("2d").getImageData(0, 0, width, height);
    let word = 0n;
    for (let cell = 0; cell < 32; cell++) {
      const x = Math.floor(((cell % 8) + 0.5) * Math.floor(width / 8));
      const y = Math.floor(((cell >> 3) + 0.5) * (height >> 2));
      word = word * 2n + (data[4 * (y * width + x)] > 127 ? 1n : 0n);
    }
    seen.push([Number(word >> 4n), performance.timeOrigin + performance.now()]);
  }
  performance.now() < until ? requestAnimationFrame(look) : done(seen);
})();
"""
"""Time that each new picture shows, and the wall clock as it was drawn [ms]."""
PORT = 47_200
SLOW = Emulation(delay_s=0.01, rate_bit_s=2e6)


@contextmanager
def program(*arguments: object, prefix: Sequence[str] = ()) -> Iterator["subprocess.Popen[str]"]:
    command = [*prefix, sys.executable, "-m", "weberlink", *map(str, arguments)]
    started = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    try:
        yield started
    finally:
        started.send_signal(signal.SIGINT)
        started.communicate(timeout=30)


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
def lan() -> Iterator[tuple[Sequence[str], str]]:
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
    """From the drawing of the test picture to the canvas of the page."""
    with ExitStack() as stack:
        prefix, host = stack.enter_context(lan()) if name == LAN else ((), "127.0.0.1")
        return _glass_to_glass(folder, session(folder, LINKS[name], host=host), prefix, seconds)


def _glass_to_glass(folder: Path, file: Path, prefix: Sequence[str], seconds: float) -> dict[str, Any]:
    with program("slave", file, prefix=prefix), program("master", file), program("monitor", "--port", 0) as monitor:
        assert monitor.stdout is not None
        lines = iter(monitor.stdout.readline, "")
        address = next(word for line in lines for word in line.split() if word.startswith("http://"))
        with browser(folder / "profile") as page:
            page.driver.set_script_timeout(seconds + 60)
            page.open(address)
            page.driver.execute_async_script(SAMPLE, 4.0)
            seen = np.array(page.driver.execute_async_script(SAMPLE, seconds))
    ages = (seen[:, 1] - 1e3 * (time() - monotonic()) - seen[:, 0] + (half := 2 ** (BITS - 1))) % (2 * half) - half
    p50, p99 = np.percentile(ages, (50, 99)).round(1).tolist()
    return {"pictures_per_s": round(len(ages) / seconds, 1), "p50_ms": p50, "p99_ms": p99}


def force(folder: Path, seconds: float, *, shows: bool, is_slow: bool) -> dict[str, Any]:
    """One way of an update to the operator, lateness of his end's ticks, and how often and how old pictures come."""
    front, ages = PORT + 10 if is_slow else PORT, list[float]()
    files = [session(folder, port=port, shows=shows) for port in (PORT, front)]
    with ExitStack() as stack:
        if is_slow:
            stack.enter_context(bottleneck(SLOW, {front: PORT, front + 1: PORT + 1}))
        stack.enter_context(program("slave", files[0]))
        sleep(2.0)
        master = stack.enter_context(
            program("master", files[1], "--duration", seconds, "--json", folder / "report.json")
        )
        with Reader(master.pid, "master") if shows else nullcontext() as reader:
            while master.poll() is None:
                ages += [1e3 * (monotonic() - each.at) for each in reader.read() if each.jpeg] if reader else []
                sleep(2e-3)
    report = json.loads((folder / "report.json").read_text())
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
