"""How the suite runs, alone or shared among workers (`pytest -n`).

A test marked `realtime` runs live sessions, in which a slow machine looks like a fault. Such tests come last, and each
alone unless this user may use SCHED_FIFO: daemons then go before all other work. No test is run again: one that fails
once is wrong, or has found something. Tests marked `hunt` explore; they run with `--hunt` only.
"""

import fcntl
import gc
import os
import subprocess
from collections import Counter, defaultdict
from collections.abc import Iterator
from functools import cache
from math import inf
from pathlib import Path
from typing import Any

import pytest

from tests import examples

# Libraries of linear algebra would put every processor to work on matrices of three rows; before numpy is imported.
for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(name, "1")

TOOK = "weberlink/took"  # seconds that each file took in its last run, in the cache of pytest
took: dict[str, float] = defaultdict(float)  # the same of this run


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--hunt", type=int, default=0, metavar="TIMES", help="explore: random examples, TIMES as many as usual"
    )
    parser.addoption("--share", type=float, default=1.0, help="share of the usual examples of every property")


def pytest_configure(config: pytest.Config) -> None:
    examples.hunt(config.option.hunt, config.option.share)


def is_realtime(item: pytest.Item) -> bool:
    return item.get_closest_marker("realtime") is not None


@cache
def may_use_fifo() -> bool:
    policy, parameters = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
    except PermissionError:
        return False
    os.sched_setscheduler(0, policy, parameters)
    return True


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if not config.option.hunt:
        explores = [item for item in items if item.get_closest_marker("hunt") is not None]
        config.hook.pytest_deselected(items=explores)
        items[:] = [item for item in items if item not in explores]
    before: dict[str, float] = config.cache.get(TOOK, {}) if hasattr(config, "cache") else {}
    items.sort(key=lambda item: (is_realtime(item), -before.get(item.location[0], inf), item.location[0]))


def pytest_collection_finish() -> None:
    """Exclude what collection has created from garbage collection."""
    gc.collect()
    gc.freeze()


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    took[report.location[0]] += report.duration


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    """Say what did not run and why, and keep what each file took."""
    skips = Counter(report.longrepr[2] for report in terminalreporter.stats.get("skipped", []))
    if skips:
        terminalreporter.section("skipped")
        for reason, count in skips.most_common():
            terminalreporter.line(f"{count:5} {reason.removeprefix('Skipped: ')}")
    if hasattr(config, "cache"):
        config.cache.set(TOOK, config.cache.get(TOOK, {}) | took)


def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Hook of pytest-xdist, in the process that distributes the tests."""
    from tests.scheduling import FileByFile  # noqa: PLC0415 - pytest-xdist is there if this is called

    return FileByFile(config, log)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    if not hasattr(item.config, "workerinput"):
        return (yield)
    # The machine is a file in the temporary folder of the run, which has those of the workers: shared, or held alone.
    with (Path(item.config.option.basetemp).parent / "machine").open("a") as machine:
        fcntl.flock(machine, fcntl.LOCK_EX if is_realtime(item) and not may_use_fifo() else fcntl.LOCK_SH)
        try:
            return (yield)
        finally:
            fcntl.flock(machine, fcntl.LOCK_UN)  # a process that a test left behind may hold a copy of the descriptor


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of its own that is soon full."""
    path = tmp_path / "disk"
    path.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", "size=256k", "tmpfs", str(path)]
    try:
        mounted = subprocess.run(command, capture_output=True, check=False).returncode == 0
    except FileNotFoundError:
        mounted = False
    if not mounted:
        pytest.skip("mounting a small file system is not permitted here")
    yield path
    subprocess.run(["umount", "-l", str(path)], check=True, timeout=60)
