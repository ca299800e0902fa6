"""How the suite runs, alone or shared among workers (`pytest -n`).

A test marked `realtime` runs live sessions, in which a slow machine looks like a fault. Such tests come last, and each
alone, unless this user may use SCHED_FIFO: daemons then go before all other work, so live tests run beside others, at
most one per processor. Since they mostly wait, there are half as many workers again. No test is run again: one that
fails once is wrong, or has found something. Tests marked `hunt` explore; they run with `--hunt` only.
"""

import fcntl
import gc
import os
from collections import Counter, defaultdict
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from itertools import cycle
from pathlib import Path
from time import sleep
from typing import IO, Any

import pytest

from tests import examples

# Libraries of linear algebra would put every processor to work on matrices of three rows; before numpy is imported.
for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(name, "1")

TOOK = "weberlink/took"  # seconds that the parts of each file took in their last run, in the cache of pytest
took: dict[str, float] = defaultdict(float)  # the same of this run
LIVE = " live"  # keyword of a live test, as `realtime` is the name of a folder too
PROCESSORS = len(os.sched_getaffinity(0))


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--hunt", type=int, default=0, metavar="TIMES", help="explore: random examples, TIMES as many as usual"
    )
    parser.addoption("--share", type=float, default=1.0, help="share of the usual examples of every property")


def pytest_configure(config: pytest.Config) -> None:
    examples.hunt(config.option.hunt, config.option.share)


def is_realtime(item: pytest.Item) -> bool:
    return item.get_closest_marker("realtime") is not None


def part_of(test: pytest.Item | pytest.TestReport) -> str:
    """The tests of a file that are live, or those that are not."""
    return test.nodeid.partition("::")[0] + (LIVE if LIVE in test.keywords else "")


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
    for item in filter(is_realtime, items):
        item.keywords[LIVE] = True
    place = dict[str, float]()
    for live in (False, True):
        # Long parts first, so that no worker ends long after the others, and both kinds at any time.
        seconds = {name: before.get(name, 1.0) for name in map(part_of, items) if name.endswith(LIVE) is live}
        done = 0.0
        for name in sorted(seconds, key=lambda name: (-seconds[name], name)):
            place[name] = done / sum(seconds.values())
            done += seconds[name]
    items.sort(key=lambda item: (is_realtime(item) and not may_use_fifo(), place[part_of(item)], part_of(item)))


def pytest_collection_finish() -> None:
    """Exclude what collection has created from garbage collection."""
    gc.collect()
    gc.freeze()


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    took[part_of(report)] += report.duration


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


def pytest_xdist_auto_num_workers() -> int:
    """Hook of pytest-xdist."""
    return PROCESSORS + PROCESSORS // 2 if may_use_fifo() else PROCESSORS


def place(folder: Path, *, live: bool) -> IO[str]:
    """A lock on the machine, which is files in the folder of the run: on all of it, shared or alone, or a processor."""
    if not may_use_fifo():
        machine = (folder / "machine").open("a")
        fcntl.flock(machine, fcntl.LOCK_EX if live else fcntl.LOCK_SH)
        return machine
    for number in cycle(range(PROCESSORS)):
        processor = (folder / f"processor{number}").open("a")
        with suppress(BlockingIOError):
            fcntl.flock(processor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return processor
        processor.close()
        sleep(0.02)
    raise AssertionError


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    live = is_realtime(item)
    if not hasattr(item.config, "workerinput") or (may_use_fifo() and not live):
        return (yield)
    with place(Path(item.config.option.basetemp).parent, live=live) as lock:
        try:
            return (yield)
        finally:
            fcntl.flock(lock, fcntl.LOCK_UN)  # a process that a test left behind may hold a copy of the descriptor


@pytest.fixture
def refrozen() -> Iterator[None]:
    """For a test whose code thaws what is frozen, which would make every later collection slow."""
    yield
    gc.freeze()
