"""The frame of a study: its cases in processes or on a Dask cluster, and their rows as table, JSON, CSV and figures.

A study defines its cases, the rows of a case (plain dictionaries), and how a data frame of the rows becomes tables and
figures. The frame does the rest: it spreads the cases, reports progress, keeps the finished rows when Ctrl-C or SIGTERM
ends the work, and states machine, versions, commit and seed in every result.
"""

import logging
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any, Generic, TypeVar, cast

from rich.console import RenderableType

from weberlink.config import ConfigurationError
from weberlink.config.errors import require_package
from weberlink_figures.environment import environment, footer
from weberlink_studies.parallel import Progress, gather, parallel_map
from weberlink_studies.result import StudyResult, how_much

if TYPE_CHECKING:
    from pandas import DataFrame

WORTH_PROCESSES_S = 1.0  # estimated run time of all cases above which starting other processes saves time
PATIENCE_S = 5.0  # timeout for the scheduler of a cluster
CASES_PER_THREAD = 2  # cases on their way to each thread of a cluster: enough that none waits, and few in memory


class StudyError(RuntimeError):
    """A worker or the cluster was lost before the end. The message is one line."""


Options = TypeVar("Options")
Case = TypeVar("Case")
Row = dict[str, Any]
"""One result of a case: figures by name; a figure may be a dictionary of numbers. Figures that do not apply are left
out."""


@dataclass(frozen=True)
class FrameResult(StudyResult):
    """The rows of all cases, or of those that were done when the work ended."""

    rows: list[Row]

    def write_csv(self, path: Path) -> None:
        """Write every row as CSV; a cell is empty where a figure does not apply."""
        data_frame(self.rows).to_csv(path, index=False)


@dataclass(frozen=True)
class Study(Generic[Options, Case]):
    """What makes one study; options are an object of its own, already checked."""

    name: str  # of the command
    cases: Callable[[Options], Sequence[Case]]  # of some options, in the order of their rows; cases are picklable
    run: Callable[[Case], Sequence[Row]]  # the rows of a case; a function of a module, because other processes call it
    # of at least one row, in 80 columns; takes options, rows, run time [s] and the line on the environment
    tables: Callable[[Options, "DataFrame", float, str], RenderableType]
    # draws into an existing folder; takes options, rows, folder and the line on the environment
    plots: Callable[[Options, "DataFrame", Path, str], None]
    cost: Callable[[Case], float]  # estimated run time of a case [s]; the longest start first
    # what the JSON document has beside `rows`, `seed`, `run_time_s` and `environment`
    summary: Callable[[Options, "DataFrame"], dict[str, Any]] = lambda *_: {}
    seed: int | None = None  # of everything that is random; None where nothing is

    def result(
        self,
        options: Options,
        *,
        workers: int | None = None,
        dask: str | None = None,
        progress: Progress = lambda *_: None,
    ) -> FrameResult:
        """Run all cases, or those that are done when Ctrl-C or SIGTERM comes. The rows do not depend on the workers.

        Args:
            options: of the study.
            workers: processes; 1 for this process alone, None for one per processor if that saves time.
            dask: address of the scheduler of a cluster that does the work instead.
            progress: called with the number of finished and of all cases after each of them.

        Raises:
            ConfigurationError: for a cluster that cannot be used; nothing was computed then.
            StudyError: a worker or the cluster was lost.
        """
        began = perf_counter()
        cases = self.cases(options)
        done = self._compute(cases, workers, dask, progress)
        rows = [row for case in done.values() for row in case]
        interrupted = how_much(len(done), len(cases), "cases")
        run_time, facts = perf_counter() - began, environment()
        caption = footer(facts, self.seed)
        frame = data_frame(rows)
        document = {
            **(self.summary(options, frame) if rows else {}),
            "rows": rows,
            **({} if self.seed is None else {"seed": self.seed}),
            "run_time_s": run_time,
            "environment": facts,
        }

        def draw(folder: Path) -> None:
            self.plots(options, frame, folder, caption)

        table = self.tables(options, frame, run_time, caption) if rows else caption
        # A figure compares cases, and needs all of them.
        return FrameResult(document, table, None if interrupted else draw, rows, interrupted=interrupted)

    def _compute(
        self, cases: Sequence[Case], workers: int | None, dask: str | None, progress: Progress
    ) -> dict[int, Sequence[Row]]:
        """Rows by the index of their case."""
        if dask is not None:
            return gather(_on_cluster(self.run, cases, dask), len(cases), progress)
        if workers is None and sum(map(self.cost, cases)) < WORTH_PROCESSES_S:
            workers = 1
        try:
            return parallel_map(self.run, cases, workers, self.cost, progress)
        except BrokenProcessPool:
            raise StudyError(
                "a worker process died before the end, perhaps for lack of memory; try fewer of them with --workers"
            ) from None


def data_frame(rows: Sequence[Row]) -> "DataFrame":
    """Rows with a column for every figure; the keys of a dictionary become parts of column names."""
    from pandas import json_normalize  # noqa: PLC0415 - heavy, an extra

    return json_normalize(list(rows), sep="_")


def records(frame: "DataFrame") -> list[Row]:
    """The rows of a frame for JSON, with None for what is missing."""
    return cast("list[Row]", frame.astype(object).where(frame.notna(), None).to_dict("records"))


def check_resources(workers: int | None, dask: str | None) -> None:
    """Refuse what cannot work before anything is read or computed; arguments as of `Study.result`."""
    if dask is not None:
        require_package("distributed", "studies[dask]", "--dask")
        if workers is not None:
            raise ConfigurationError("--workers: is for this machine; with --dask it is the cluster that has workers")


def _on_cluster(
    work: Callable[[Case], Sequence[Row]], cases: Sequence[Case], address: str
) -> Iterator[tuple[int, Sequence[Row]]]:
    """Rows by the index of their case, as a cluster finishes them. A lost worker's cases run on another."""
    from distributed import CancelledError, KilledWorker, as_completed  # noqa: PLC0415 - heavy, an extra

    with _connected(address) as client:
        threads = sum(client.nthreads().values())
        if not threads:
            raise ConfigurationError(
                f"--dask: {address}: the scheduler has no workers; start some with: dask worker {address}"
            )
        indices: dict[Any, int] = {}
        waiting = iter(enumerate(cases))

        def submit(count: int) -> list[Any]:
            futures = []
            for index, case in islice(waiting, count):
                future = client.submit(work, case, pure=False)
                indices[future.key] = index
                futures.append(future)
            return futures

        under_way = cast("Any", as_completed)(submit(CASES_PER_THREAD * threads), loop=client.loop)
        for future in under_way:
            try:
                rows = future.result()
            except (KilledWorker, CancelledError, OSError) as error:
                raise StudyError(f"--dask: {address}: {_reason(error)}; the rest of the work is not done") from None
            yield indices[future.key], rows
            under_way.update(submit(1))


@contextmanager
def _connected(address: str) -> Iterator[Any]:
    """A client of the scheduler; what the library would log of lost connections is raised as an error anyway."""
    from distributed import Client  # noqa: PLC0415
    from distributed.comm.addressing import resolve_address  # noqa: PLC0415

    before = logging.root.manager.disable
    logging.disable(logging.CRITICAL)
    try:
        resolve_address(address)  # checked here, because a half-made client logs an error when it is deleted
        client = cast("Any", Client)(address, timeout=PATIENCE_S, set_as_default=False, name="weberlink")
    except (OSError, ValueError) as error:
        logging.disable(before)
        raise ConfigurationError(
            f"--dask: {address}: no scheduler answers there ({_reason(error)}); "
            "expected an address such as tcp://host:8786"
        ) from None
    try:
        yield client
    finally:
        with suppress(OSError):  # the cluster may be gone
            client.close(timeout=PATIENCE_S)  # releases the futures, so the scheduler cancels the work
        logging.disable(before)


def _reason(error: BaseException) -> str:
    return " ".join(str(error).split()) or type(error).__name__
