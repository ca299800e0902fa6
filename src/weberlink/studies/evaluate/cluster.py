"""Work spread over the workers of a Dask cluster, as `weberlink.studies.parallel` spreads it over processors.

Knows nothing of what the work is. Needs distributed (extra: dask), which nothing else imports.
"""

import logging
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError
from contextlib import contextmanager, suppress
from importlib.metadata import version
from queue import Empty, SimpleQueue
from typing import Any, TypeVar, cast

from distributed import Client
from distributed.comm.addressing import resolve_address
from distributed.scheduler import KilledWorker

Shared = TypeVar("Shared")
Own = TypeVar("Own")
Result = TypeVar("Result")

PATIENCE_S = 5.0
"""How long a scheduler, its first worker or an answer is waited for."""
GLANCE_S = 1.0
"""After so long without a result, the cluster is asked whether it is still there."""
ALIKE = ("weberlink", "numpy")
"""Packages whose versions make the results."""


class UnavailableClusterError(Exception):
    """The cluster cannot do this work; nothing was computed. One line says why, and what to do."""


class LostClusterError(Exception):
    """The cluster went away, and what it had not given back with it. One line says how."""


def spread_on_cluster(
    address: str,
    work: Callable[[tuple[Shared, Own]], Result],
    tasks: Sequence[tuple[Shared, Own]],
    length: Callable[[tuple[Shared, Own]], float] = lambda _: 1.0,
) -> Iterator[tuple[int, Result]]:
    """Each task's place and result, as they come.

    What several tasks share is sent to every worker once, not with every task; then any worker can be spared, and
    what it had begun is begun again on another.

    Args:
        address: of the scheduler, such as tcp://host:8786.
        work: a function of a module that the workers can import, called with each task on some worker.
        tasks: pairs of a large part, the same object in several tasks, and a small one; both can be pickled.
        length: a measure of what a task costs. The longest go first.

    Raises:
        UnavailableClusterError: if the scheduler does not answer, or its workers are none or other than this program.
        LostClusterError: if no worker is left, or the scheduler, before the end.
    """
    with _quiet(), _connected(address) as client:
        _check_workers(client, address)
        done: SimpleQueue[Any] = SimpleQueue()
        try:
            shared = {id(part): part for part, _ in tasks}
            sent = dict(zip(shared, client.scatter(list(shared.values()), broadcast=True, hash=False), strict=True))
            order = sorted(range(len(tasks)), key=lambda index: -length(tasks[index]))
            futures = {
                client.submit(_call, work, sent[id(tasks[i][0])], tasks[i][1], pure=False, priority=-place): i
                for place, i in enumerate(order)
            }
            for future in futures:
                future.add_done_callback(done.put)
            for _ in tasks:
                future = _next(done, client, futures)
                yield futures[future], future.result(timeout=PATIENCE_S)
        except (KilledWorker, CancelledError, OSError) as error:
            raise LostClusterError(f"{address}: {_loss(client, error)}; the rest of the work is not done") from None


def _call(work: Callable[[tuple[Shared, Own]], Result], shared: Shared, own: Own) -> Result:
    return work((shared, own))


def _next(done: "SimpleQueue[Any]", client: Any, futures: Any) -> Any:
    """The next future that is done.

    Raises:
        OSError: if there will be none.
    """
    while True:
        try:
            return done.get(timeout=GLANCE_S)
        except Empty:
            if not _workers_left(client):
                raise ConnectionError from None
            if any(future.status in ("lost", "cancelled") for future in futures):
                raise ConnectionError("what a worker held is gone") from None


def _workers_left(client: Any) -> int:
    """How many.

    Raises:
        OSError: if the scheduler does not answer.
    """
    if client.status != "running":
        raise ConnectionError("the scheduler is gone")
    return len(client.sync(client.scheduler.ncores, callback_timeout=PATIENCE_S))


def _loss(client: Any, error: BaseException) -> str:
    """What went away."""
    try:
        left = _workers_left(client)
    except OSError:
        return "the scheduler went away"
    return f"a worker went away and took with it what it held ({_reason(error)})" if left else "no worker is left"


@contextmanager
def _connected(address: str) -> Iterator[Any]:
    try:
        resolve_address(address)  # a client that cannot is left half made, and complains when it is thrown away
        client = cast("Any", Client)(address, timeout=PATIENCE_S, set_as_default=False, name="weberlink")
    except (OSError, ValueError) as error:
        raise UnavailableClusterError(
            f"{address}: no scheduler answers there ({_reason(error)}); expected an address such as tcp://host:8786"
        ) from None
    try:
        yield client
    finally:
        with suppress(OSError):  # the cluster may be gone
            client.close(timeout=PATIENCE_S)  # forgets the futures, and so the scheduler forgets the work


def _check_workers(client: Any, address: str) -> None:
    try:
        client.wait_for_workers(1, timeout=PATIENCE_S)
    except TimeoutError:
        raise UnavailableClusterError(
            f"{address}: the scheduler has no workers; start some with: dask worker {address}"
        ) from None
    try:
        found = client.run(_versions)
    except Exception as error:  # whatever a worker that lacks this program makes of being called
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
    return {name: version(name) for name in ALIKE}


def _listed(versions: dict[str, str]) -> str:
    return ", ".join(f"{name} {number}" for name, number in versions.items())


def _reason(error: BaseException) -> str:
    """In one line."""
    return " ".join(str(error).split()) or type(error).__name__


@contextmanager
def _quiet() -> Iterator[None]:
    """Without the library's own log on standard error: what matters of it is raised."""
    before = logging.root.manager.disable
    logging.disable(logging.CRITICAL)
    try:
        yield
    finally:
        logging.disable(before)
