"""A long visit in a browser, for growth of memory and for the latency of the handle.

`python -m tests.apps.monitor.long_visit --minutes 20 [--json OUT]`
"""

import argparse
import json
import os
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from time import monotonic, sleep
from typing import Any

import numpy as np

from tests.apps.monitor.browser import browser
from tests.apps.monitor.visits import Visit, visit

STEPS, STEP_PX, REST_S = 40, 14.0, 0.3
PAGE_KB = os.sysconf("SC_PAGE_SIZE") / 1024


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=20.0)
    parser.add_argument("--json", type=Path)
    wanted = parser.parse_args()
    with TemporaryDirectory() as folder, browser(Path(folder) / "profile") as page:
        page.size(1400, 900)
        with visit(page, Path(folder)) as visitor:
            latencies = steps(visitor)
            samples = [sample(visitor)]
            end = monotonic() + 60.0 * wanted.minutes
            while monotonic() < end:
                visitor.grab()
                visitor.rub(50.0, pause=0.03)
                visitor.release()
                sleep(3.0)
                samples.append(sample(visitor))
            console = page.console()
    document = {
        "minutes": wanted.minutes,
        "latency_ms": {f"p{share}": float(np.percentile(latencies, share)) for share in (50, 99)},
        "latencies": len(latencies),
        "console": console,
        "growth": growth(samples),
        "samples": samples,
    }
    text = json.dumps(document, indent=2)
    sys.stdout.write(text + "\n")
    if wanted.json is not None:
        wanted.json.write_text(text + "\n", encoding="utf-8")


def steps(visitor: Visit) -> list[float]:
    """Latencies of single steps of a target at rest, as the page measures them [ms]."""
    visitor.grab()
    for number in range(STEPS):
        visitor.move(STEP_PX if number % 2 else -STEP_PX, -20.0)
        sleep(REST_S)
    visitor.release()
    return [float(each) for each in visitor.page.run("return document.body.dataset.latencies").split()]


def sample(visitor: Visit) -> dict[str, Any]:
    """Memory of the page after a collection, of the monitor and of the session."""
    driver = visitor.page.driver
    driver.execute_cdp_cmd("HeapProfiler.collectGarbage", {})
    heap = driver.execute_cdp_cmd("Runtime.getHeapUsage", {})["usedSize"]
    nodes = visitor.page.run("return document.getElementsByTagName('*').length")
    launcher = int(visitor.session)
    found = {"monitor": visitor.monitor.pid, "launcher": launcher}
    found |= {f"daemon{number}": pid for number, pid in enumerate(children(launcher))}
    return {"heap_kb": heap / 1024, "nodes": nodes, **{f"{name}_kb": resident(pid) for name, pid in found.items()}}


def children(pid: int) -> list[int]:
    return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def resident(pid: int) -> float:
    """Resident memory [KiB]."""
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * PAGE_KB


def growth(samples: list[dict[str, Any]]) -> dict[str, list[float]]:
    """Medians of the second quarter and of the last one: the first fills windows and caches."""
    quarter = max(1, len(samples) // 4)
    early, late = samples[quarter : 2 * quarter] or samples[-1:], samples[-quarter:]
    return {key: [float(np.median([each[key] for each in part])) for part in (early, late)] for key in samples[0]}


if __name__ == "__main__":
    main()
