"""How the suite runs, alone or shared among workers (`pytest -n`).

A test marked `realtime` runs live sessions, in which a slow machine looks like a fault. Such tests come last. They run
alone, unless this user may use SCHED_FIFO: daemons then go before all other work, and only those marked
`realtime(alone=True)`, which measure time, run alone. A live test that fails while the host itself stood still is run
again, which the summary counts as a rerun. Tests marked `hunt` explore; they run with `--hunt` only.
"""

import fcntl
import gc
import os
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache, partial
from pathlib import Path
from typing import Any

import pytest

from tests import examples
from tests.host_stalls import HostStalls, now

# Libraries of linear algebra would put every processor to work on matrices of three rows; before numpy is imported.
for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(name, "1")

RERUNS = 2
"""How often a live test is run again at most; each time only after a stall of the host."""
BEGAN = pytest.StashKey[float]()
"""When the present attempt of a test began, on the clock of the stalls."""
LONG_FIRST = ("system", "studies", "apps", "cli", "protocol", "telemetry", "control")
"""Folders with slow files start first, so that no worker is left alone with one of them at the end."""


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--hunt", type=int, default=0, metavar="TIMES", help="explore: random examples, TIMES as many as usual"
    )


def pytest_configure(config: pytest.Config) -> None:
    examples.hunt(config.option.hunt)


def is_realtime(item: pytest.Item) -> bool:
    return item.get_closest_marker("realtime") is not None


def is_alone(item: pytest.Item) -> bool:
    return any(mark.kwargs.get("alone", not may_use_fifo()) for mark in item.iter_markers("realtime"))


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
    here = Path(__file__).parent
    if not config.option.hunt:
        explores = [item for item in items if item.get_closest_marker("hunt") is not None]
        config.hook.pytest_deselected(items=explores)
        items[:] = [item for item in items if item not in explores]

    def place(item: pytest.Item) -> tuple[bool, bool, int]:
        folder = item.path.relative_to(here).parts[0]
        return is_alone(item), is_realtime(item), LONG_FIRST.index(folder) if folder in LONG_FIRST else len(LONG_FIRST)

    items.sort(key=place)


def pytest_collection_finish(session: pytest.Session) -> None:
    """Exclude what collection has created from garbage collection, and watch the host if there are live tests."""
    live = [] if session.config.option.usepdb else list(filter(is_realtime, session.items))
    if live:
        watcher = HostStalls()
        session.config.add_cleanup(watcher.end)
        for item in live:
            item.add_marker(pytest.mark.flaky(reruns=RERUNS, condition=partial(stood_still, item, watcher)))
    gc.collect()
    gc.freeze()


def stood_still(item: pytest.Item, watcher: HostStalls) -> bool:
    """Whether the host stalled during the present attempt of a live test."""
    began, item.stash[BEGAN] = item.stash[BEGAN], now()
    return watcher.has_stalled(began)


def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Hook of pytest-xdist, in the process that distributes the tests."""
    from tests.scheduling import FileByFile  # noqa: PLC0415 - pytest-xdist is there if this is called

    return FileByFile(config, log)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    if not hasattr(item.config, "workerinput"):
        item.stash[BEGAN] = now()
        return (yield)
    # The temporary folder of a worker is in that of the run.
    with held(Path(item.config.option.basetemp).parent / "machine", alone=is_alone(item)):
        item.stash[BEGAN] = now()
        return (yield)


@contextmanager
def held(path: Path, *, alone: bool) -> Iterator[None]:
    """Hold the machine, shared with other workers or `alone`, by a lock on a file.

    It is unlocked explicitly: a process that a test left behind may hold a copy of the descriptor.
    """
    descriptor = os.open(path, os.O_RDONLY | os.O_CREAT | os.O_CLOEXEC, 0o600)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX if alone else fcntl.LOCK_SH)
        yield
    finally:
        fcntl.flock(descriptor, fcntl.LOCK_UN)
        os.close(descriptor)


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
