"""The order in which tests go to the workers of pytest-xdist: file by file, whoever is free takes the next.

Knows nothing of what a test needs; the order of the files is that of the collection.
"""

from itertools import groupby

from xdist.scheduler import LoadScheduling
from xdist.workermanage import WorkerController


class FileByFile(LoadScheduling):
    """Whole files, as fixtures of a module are made once for each worker that has a test of it.

    A worker begins a test only when it knows the next one or that there is none: it is given more when one is left.
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
        """How many of the tests to be given away are of one file."""
        assert self.collection is not None
        collection = self.collection
        _, tests = next(groupby(self.pending, key=lambda index: collection[index].partition("::")[0]))
        return len(list(tests))
