"""Run a function on many tasks on the workers of a Dask cluster, as `parallel` does in processes. Extra: dask."""

import logging
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import CancelledError
from contextlib import contextmanager, suppress
from importlib.metadata import version
from queue import Empty, SimpleQueue
from typing import Any, TypeVar, cast

from distributed import Client
from distributed.comm.addressing import resolve_address
from distributed.scheduler import KilledWorker

from weberlink.studies.parallel import Progress, gather, longest_first
from weberlink.system.interruption import Interruption

Shared = TypeVar("Shared")
Own = TypeVar("Own")
Result = TypeVar("Result")

PATIENCE_S = 5.0
"""Timeout for the scheduler, its first worker and an answer of the scheduler."""
POLL_S = 1.0
"""After this time without a result, check whether the cluster is still alive."""
COMPARED_PACKAGES = ("weberlink", "numpy")
"""Packages whose versions must be the same on every worker."""


class UnavailableClusterError(Exception):
    """The cluster cannot do this work; nothing was computed. The message is one line with a remedy."""


class LostClusterError(Exception):
    """The cluster was lost before the end. The message is one line."""


def cluster_map(
    work: Callable[[tuple[Shared, Own]], Result],
    tasks: Sequence[tuple[Shared, Own]],
    address: str,
    cost: Callable[[tuple[Shared, Own]], float] = lambda _: 1.0,
    progress: Progress = lambda *_: None,
    interruption: Interruption | None = None,
) -> dict[int, Result]:
    """The results by the index of the task; arguments as of `parallel_map`.

    A part that several tasks share is sent to every worker once. So any worker may be lost: its unfinished tasks run
    again on another.

    Args:
        tasks: pairs of a large part, the same object in several tasks, and a small one; both picklable.
        address: of the scheduler, such as tcp://host:8786.

    Raises:
        UnavailableClusterError: the scheduler does not answer, has no workers, or a worker has another version.
        LostClusterError: the scheduler or the last worker was lost before the end.
    """
    return gather(_as_completed(work, tasks, address, cost), len(tasks), progress, interruption)


def _as_completed(
    work: Callable[[tuple[Shared, Own]], Result],
    tasks: Sequence[tuple[Shared, Own]],
    address: str,
    cost: Callable[[tuple[Shared, Own]], float],
) -> Iterator[tuple[int, Result]]:
    with _quiet(), _connected(address) as client:
        _check_workers(client, address)
        done: SimpleQueue[Any] = SimpleQueue()
        try:
            shared = {id(part): part for part, _ in tasks}
            sent = dict(zip(shared, client.scatter(list(shared.values()), broadcast=True, hash=False), strict=True))
            futures = {
                client.submit(_call, work, sent[id(tasks[i][0])], tasks[i][1], pure=False, priority=-place): i
                for place, i in enumerate(longest_first(tasks, cost))
            }
            for future in futures:
                future.add_done_callback(done.put)
            for _ in tasks:
                future = _next(done, client, futures)
                yield futures[future], _result(future, client)
        except (KilledWorker, CancelledError, OSError) as error:
            raise LostClusterError(f"{address}: {_loss(client, error)}; the rest of the work is not done") from None


def _call(work: Callable[[tuple[Shared, Own]], Result], shared: Shared, own: Own) -> Result:
    return work((shared, own))


def _next(done: "SimpleQueue[Any]", client: Any, futures: Any) -> Any:
    """The next completed future; raises OSError if the cluster or a worker's data is lost."""
    while True:
        try:
            return done.get(timeout=POLL_S)
        except Empty:
            _check_alive(client, futures)


def _result(future: Any, client: Any) -> Any:
    """The result of a completed future; computed again if the worker that held it was lost. Raises as `_next`."""
    timeout = POLL_S
    while True:
        try:
            return future.result(timeout=timeout)
        except TimeoutError:
            if future.status == "error":  # raised by the task
                raise
            _check_alive(client, [future])
            timeout *= 2.0  # the transfer of a large result begins anew


def _check_alive(client: Any, futures: Iterable[Any]) -> None:
    """Raise OSError if no worker is left or a future can never be completed."""
    if not _workers_left(client):
        raise ConnectionError from None
    if any(future.status in ("lost", "cancelled") for future in futures):
        raise ConnectionError("data held by a worker is lost") from None


def _workers_left(client: Any) -> int:
    """Number of workers; raises OSError if the scheduler does not answer."""
    if client.status != "running":
        raise ConnectionError("the scheduler is lost")
    return len(client.sync(client.scheduler.ncores, callback_timeout=PATIENCE_S))


def _loss(client: Any, error: BaseException) -> str:
    try:
        left = _workers_left(client)
    except OSError:
        return "the scheduler was lost"
    return f"a worker was lost with the data that it held ({_reason(error)})" if left else "no worker is left"


@contextmanager
def _connected(address: str) -> Iterator[Any]:
    try:
        resolve_address(address)  # checked here, because a half-made client logs an error when it is deleted
        client = cast("Any", Client)(address, timeout=PATIENCE_S, set_as_default=False, name="weberlink")
    except (OSError, ValueError) as error:
        raise UnavailableClusterError(
            f"{address}: no scheduler answers there ({_reason(error)}); expected an address such as tcp://host:8786"
        ) from None
    try:
        yield client
    finally:
        with suppress(OSError):  # the cluster may be gone
            client.close(timeout=PATIENCE_S)  # releases the futures, so the scheduler cancels the work


def _check_workers(client: Any, address: str) -> None:
    try:
        client.wait_for_workers(1, timeout=PATIENCE_S)
    except TimeoutError:
        raise UnavailableClusterError(
            f"{address}: the scheduler has no workers; start some with: dask worker {address}"
        ) from None
    try:
        found = client.run(_versions)
    except Exception as error:  # a worker without this program may raise anything
        raise UnavailableClusterError(
            f"{address}: a worker cannot run this program ({_reason(error)}); install weberlink there"
        ) from None
    here = _versions()
    for worker, there in found.items():
        if there != here:
            raise UnavailableClusterError(
                f"{address}: worker {worker} has {_listed(there)}, expected {_listed(here)} as here"
            )


def _versions() -> dict[str, str]:
    return {name: version(name) for name in COMPARED_PACKAGES}


def _listed(versions: dict[str, str]) -> str:
    return ", ".join(f"{name} {number}" for name, number in versions.items())


def _reason(error: BaseException) -> str:
    return " ".join(str(error).split()) or type(error).__name__


@contextmanager
def _quiet() -> Iterator[None]:
    """Disable logging: the library logs errors that are raised here anyway."""
    before = logging.root.manager.disable
    logging.disable(logging.CRITICAL)
    try:
        yield
    finally:
        logging.disable(before)
