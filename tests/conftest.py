"""How the whole suite runs: on its own or shared among workers (`pytest -n`), and what of it has the machine to itself.

A test marked `realtime` runs live sessions, whose daemons take the silence of a peer for a fault. Such tests come last,
and while one of them runs, no other worker runs anything.
"""

import fcntl
import gc
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from tests import examples

# Libraries of linear algebra would put every processor to work on matrices of three rows; before numpy is imported.
for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(name, "1")

LONG_FIRST = ("weberlink", "evaluation", "protocol", "telemetry", "control")
"""Folders whose files take long: they are begun first, so that no worker is left alone with one of them at the end."""


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--hunt", type=int, default=0, metavar="TIMES", help="so many times the examples of hypothesis, by chance"
    )


def pytest_configure(config: pytest.Config) -> None:
    examples.hunt(config.option.hunt)


def is_realtime(item: pytest.Item) -> bool:
    return item.get_closest_marker("realtime") is not None


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    here = Path(__file__).parent

    def place(item: pytest.Item) -> tuple[bool, int]:
        folder = item.path.relative_to(here).parts[0]
        return is_realtime(item), LONG_FIRST.index(folder) if folder in LONG_FIRST else len(LONG_FIRST)

    items.sort(key=place)


@pytest.hookimpl(optionalhook=True)
def pytest_collection_finish() -> None:
    """What has been imported and collected stays: the collector need not look at it again and again."""
    gc.collect()
    gc.freeze()


def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Hook of pytest-xdist, in the process that hands out the tests."""
    from tests.scheduling import FileByFile  # noqa: PLC0415 - pytest-xdist is there if this is called

    return FileByFile(config, log)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    if not hasattr(item.config, "workerinput"):
        return (yield)
    # The temporary folder of a worker is in that of the run.
    with held(Path(item.config.option.basetemp).parent / "machine", alone=is_realtime(item)):
        return (yield)


@contextmanager
def held(path: Path, *, alone: bool) -> Iterator[None]:
    """The machine, shared with the other workers of this run or for this test alone; the kernel keeps the account.

    It is given back by word, so a process that a test left behind with a copy of the descriptor holds up nobody.
    """
    descriptor = os.open(path, os.O_RDONLY | os.O_CREAT | os.O_CLOEXEC, 0o600)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX if alone else fcntl.LOCK_SH)
        yield
    finally:
        fcntl.flock(descriptor, fcntl.LOCK_UN)
        os.close(descriptor)
