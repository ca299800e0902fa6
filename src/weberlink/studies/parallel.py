"""Work spread over the processors of this machine. Knows nothing of what the work is."""

import os
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from multiprocessing import get_context
from typing import TypeVar

from weberlink.realtime.process import die_with_parent

Task = TypeVar("Task")
Result = TypeVar("Result")


def spread(
    work: Callable[[Task], Result],
    tasks: Sequence[Task],
    workers: int | None,
    length: Callable[[Task], float] = lambda _: 1.0,
) -> Iterator[tuple[int, Result]]:
    """Each task's place and result, as they come.

    Args:
        work: a function of a module, called with each task in some process.
        tasks: what can be pickled.
        workers: processes; None for as many as there are processors, 1 for none but this one.
        length: a measure of what a task costs. The longest go first, so that none is left alone at last.
    """
    count = min(workers or len(os.sched_getaffinity(0)), len(tasks))
    if count <= 1:
        yield from ((index, work(task)) for index, task in enumerate(tasks))
        return
    # Spawned, since the program that asks may run threads. However that ends, its processes end with it: by themselves
    # they would wait for work for ever, each at a pipe that it holds open itself.
    pool = ProcessPoolExecutor(
        count,
        mp_context=get_context("spawn"),
        initializer=die_with_parent,
        initargs=(signal.SIGTERM, os.getpid()),
    )
    try:
        order = sorted(range(len(tasks)), key=lambda index: -length(tasks[index]))
        with _uninterrupted():  # submitting starts the processes
            futures = {pool.submit(work, tasks[index]): index for index in order}
        for future in as_completed(futures):
            yield futures[future], future.result()
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


@contextmanager
def _uninterrupted() -> Iterator[None]:
    """Ctrl-C reaches every process of the group; the one that was asked ends the others.

    Processes that start meanwhile are deaf to it for good, from their first instruction on: they inherit the mask. Here
    it is only late.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
