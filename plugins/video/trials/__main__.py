"""`python -m plugins.video.trials`: age of a test picture in a real browser, and the force with and without pictures.

Each link is emulated, for session and pictures alike. Needs Chromium with its driver. Prints a line of JSON for each.
"""

import argparse
import json
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from time import monotonic, sleep, time
from typing import Any

import numpy as np

from plugins.page.tests.browser import browser
from weberlink.protocol.keys import generate
from weberlink_video.pattern import BITS

LINKS = {"loopback": "{}", "LAN": "{delay_ms: 0.2}", "50 ms, 2 % loss": "{delay_ms: 25, loss: 0.02}"}
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


@contextmanager
def program(*arguments: object) -> Iterator["subprocess.Popen[str]"]:
    command = [sys.executable, "-m", "weberlink", *map(str, arguments)]
    started = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    try:
        yield started
    finally:
        started.send_signal(signal.SIGINT)
        started.communicate(timeout=30)


def session(folder: Path, emulate: str, *, has_pictures: bool) -> Path:
    """The file of both ends."""
    generate(folder / "key")
    address = f"127.0.0.1:{PORT}"
    text = f"link: {{listen: '{address}', slave: '{address}', key_file: key, silence_ms: 500, emulate: {emulate}}}\n"
    text += "slave:\n  robot: {driver: point}\n  scene: [{shape: plane, stiffness_n_m: 500}]\n"
    if has_pictures:
        text += f"  cameras: {{driver: video, port: {PORT + 1}, sources: [{{name: test, kind: pattern}}]}}\n"
    (folder / "session.yaml").write_text(text)
    return folder / "session.yaml"


def glass_to_glass(folder: Path, emulate: str, seconds: float) -> dict[str, Any]:
    """From the drawing of the test picture to the canvas of the page."""
    file = session(folder, emulate, has_pictures=True)
    with program("slave", file), program("master", file), program("monitor", "--port", 0) as monitor:
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


def force(folder: Path, emulate: str, seconds: float, *, has_pictures: bool) -> dict[str, Any]:
    """One way of an update to the operator, and lateness of his end's ticks."""
    file = session(folder, emulate, has_pictures=has_pictures)
    with program("slave", file):
        sleep(2.0)
        with program("master", file, "--duration", seconds, "--json", folder / "report.json") as master:
            master.communicate(timeout=seconds + 60)
    report = json.loads((folder / "report.json").read_text())
    ticks = report["ticks"]["master"]
    return {"one_way_us": report["link"]["one_way_us"], "late_us": ticks["lateness_us"], "missed": ticks["missed"]}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--pairs", type=int, default=3, help="of the force with and without pictures, in turn")
    parser.add_argument("--links", nargs="*", choices=LINKS, default=list(LINKS))
    arguments = parser.parse_args()
    for name in arguments.links:
        with tempfile.TemporaryDirectory() as folder:
            found = glass_to_glass(Path(folder), LINKS[name], arguments.seconds)
        print(json.dumps({"link": name, **found}), flush=True)
    for pair in range(2 * arguments.pairs):
        with tempfile.TemporaryDirectory() as folder:
            found = force(Path(folder), "{}", arguments.seconds, has_pictures=bool(pair % 2))
        print(json.dumps({"pictures": bool(pair % 2), **found}), flush=True)


if __name__ == "__main__":
    main()
