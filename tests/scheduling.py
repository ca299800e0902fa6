"""Distribute tests to the workers of pytest-xdist file by file, in the order of the collection."""

from itertools import groupby

from xdist.scheduler import LoadScheduling
from xdist.workermanage import WorkerController


class FileByFile(LoadScheduling):
    """Sends whole files, since each worker makes the fixtures of a module once.

    A worker starts a test only when it knows the next one or that there is none, so it gets more when one is left.
    """

    def schedule(self) -> None:
        if self.collection is None:
            if not self._check_nodes_have_same_collection():
                return
            self.collection = next(iter(self.node2collection.values()))
            self.pending[:] = range(len(self.collection))
        for node in self.nodes:
            self.check_schedule(node)

    def check_schedule(self, node: WorkerController, duration: float = 0.0) -> None:
        if node.shutting_down:
            return
        while self.pending and len(self.node2pending[node]) < 2:
            self._send_tests(node, self._next_file())
        if not self.pending:
            node.shutdown()

    def _next_file(self) -> int:
        """Number of pending tests that belong to the next file."""
        assert self.collection is not None
        collection = self.collection
        _, tests = next(groupby(self.pending, key=lambda index: collection[index].partition("::")[0]))
        return len(list(tests))
