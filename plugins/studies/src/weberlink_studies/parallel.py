"""Run a function on many tasks in processes of this machine."""

import os
import signal
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from multiprocessing import active_children, get_context
from typing import TypeVar

from weberlink.realtime.process import die_with_parent
from weberlink_studies.interruption import Interruption

Task = TypeVar("Task")
Result = TypeVar("Result")
SAFE_PATH = "PYTHONSAFEPATH"
Progress = Callable[[int, int], None]  # receives the number of tasks done and of all tasks


def parallel_map(
    work: Callable[[Task], Result],
    tasks: Sequence[Task],
    workers: int | None,
    cost: Callable[[Task], float] = lambda _: 1.0,
    progress: Progress = lambda *_: None,
) -> dict[int, Result]:
    """The results by the index of the task, in the order of the tasks: of all, or of those done when Ctrl-C came.

    Args:
        work: a function of a module, called with each task in some process.
        tasks: must be picklable.
        workers: processes; None for one per processor, 1 for this process alone.
        cost: relative run time of a task. The longest tasks start first.
        progress: called after every task.

    Raises:
        BrokenProcessPool: a worker process died.
    """
    return gather(_as_completed(work, tasks, workers, cost), len(tasks), progress)


def gather(pairs: Iterable[tuple[int, Result]], count: int, progress: Progress) -> dict[int, Result]:
    """Collect pairs of index and result, `count` in all or fewer if Ctrl-C comes, and sort them by index."""
    results: dict[int, Result] = {}
    for index, result in Interruption().pieces(pairs):
        results[index] = result
        progress(len(results), count)
    return dict(sorted(results.items()))


def _as_completed(
    work: Callable[[Task], Result], tasks: Sequence[Task], workers: int | None, cost: Callable[[Task], float]
) -> Generator[tuple[int, Result]]:
    count = min(workers or len(os.sched_getaffinity(0)), len(tasks))
    if count <= 1:
        yield from ((index, work(task)) for index, task in enumerate(tasks))
        return
    # Spawned, because the calling program may have threads. Workers end with their parent: each holds its own end of
    # the pipe open and would otherwise wait for work for ever.
    others = set(active_children())
    with _safe_path():  # it starts a process that tracks resources
        pool = ProcessPoolExecutor(
            count, mp_context=get_context("spawn"), initializer=die_with_parent, initargs=(signal.SIGTERM, os.getpid())
        )
    try:
        with _sigint_blocked(), _safe_path():  # submitting starts the processes
            longest_first = sorted(range(len(tasks)), key=lambda index: -cost(tasks[index]))
            futures = {pool.submit(work, tasks[index]): index for index in longest_first}
        for future in as_completed(futures):
            yield futures[future], future.result()
    except (KeyboardInterrupt, GeneratorExit):  # what is under way is not wanted any more
        for worker in set(active_children()) - others:
            worker.terminate()
        raise
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


@contextmanager
def _sigint_blocked() -> Iterator[None]:
    """Ctrl-C reaches the whole process group, but only this process must handle it.

    Processes started meanwhile inherit the mask and never see SIGINT; here the signal is only delayed.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _safe_path() -> Iterator[None]:
    """Within this, processes that `multiprocessing` starts import nothing from the current folder."""
    before = os.environ.get(SAFE_PATH)
    os.environ[SAFE_PATH] = "1"
    try:
        yield
    finally:
        if before is None:
            del os.environ[SAFE_PATH]
        else:
            os.environ[SAFE_PATH] = before
