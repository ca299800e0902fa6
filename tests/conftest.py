"""How the suite runs, alone or shared among workers (`pytest -n`).

A test marked `realtime` runs live sessions, in which a slow machine looks like a fault. Such tests come last. They run
alone, unless this user may use SCHED_FIFO: daemons then go before all other work, and only those marked
`realtime(alone=True)`, which measure time, run alone. A live test that fails is run again, alone, if other tests ran
beside it or if the host itself stood still; the summary counts that as a rerun. Tests marked `hunt` explore; they run
with `--hunt` only.
"""

import fcntl
import gc
import os
import subprocess
from collections.abc import Iterator
from functools import cache, partial
from pathlib import Path
from typing import Any

import pytest

from tests import examples
from tests.host_stalls import HostStalls, now

# Libraries of linear algebra would put every processor to work on matrices of three rows; before numpy is imported.
for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(name, "1")

RERUNS = 3
"""How often a live test is run again at most; but for the first time only after a stall of the host."""
BEGAN = pytest.StashKey[float]()
"""When the present attempt of a test began, on the clock of the stalls."""
MACHINE = pytest.StashKey["Machine"]()
"""The hold of a test on the machine, where it is shared with other workers."""
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
            item.add_marker(pytest.mark.flaky(reruns=RERUNS, condition=partial(was_disturbed, item, watcher)))
    gc.collect()
    gc.freeze()


def was_disturbed(item: pytest.Item, watcher: HostStalls) -> bool:
    """Whether other tests ran, or the host stalled, during the present attempt of a live test."""
    machine = item.stash.get(MACHINE, None)
    return (machine is not None and not machine.is_alone) or watcher.has_stalled(item.stash[BEGAN])


def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Hook of pytest-xdist, in the process that distributes the tests."""
    from tests.scheduling import FileByFile  # noqa: PLC0415 - pytest-xdist is there if this is called

    return FileByFile(config, log)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    if not hasattr(item.config, "workerinput"):
        return (yield)
    # The temporary folder of a worker is in that of the run.
    item.stash[MACHINE] = machine = Machine(Path(item.config.option.basetemp).parent / "machine")
    try:
        machine.hold(alone=is_alone(item))
        return (yield)
    finally:
        machine.let_go()


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Begin an attempt; every one but the first is alone, and with fixtures of its own."""
    if isinstance(item, pytest.Function) and getattr(item, "execution_count", 1) > 1:
        if MACHINE in item.stash:
            item.stash[MACHINE].hold(alone=True)
        for definitions in item._fixtureinfo.name2fixturedefs.values():
            for definition in definitions:
                if definition.scope == "module":  # what it holds may come from the disturbed attempt
                    definition.finish(item._request)
    item.stash[BEGAN] = now()


class Machine:
    """The machine, shared with other workers or held alone, by a lock on a file."""

    def __init__(self, path: Path) -> None:
        self._descriptor = os.open(path, os.O_RDONLY | os.O_CREAT | os.O_CLOEXEC, 0o600)
        self.is_alone = False

    def hold(self, *, alone: bool) -> None:
        fcntl.flock(self._descriptor, fcntl.LOCK_EX if alone else fcntl.LOCK_SH)
        self.is_alone = alone

    def let_go(self) -> None:
        """Unlock explicitly: a process that a test left behind may hold a copy of the descriptor."""
        fcntl.flock(self._descriptor, fcntl.LOCK_UN)
        os.close(self._descriptor)


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
