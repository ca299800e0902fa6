"""Daemons that wait for their order: they import what they need while the launcher reads and checks the file.

It imports little itself, because the launcher starts them first.
"""

from contextlib import suppress
from socket import AF_UNIX, SOCK_SEQPACKET, recv_fds, send_fds, socket, socketpair
from subprocess import PIPE
from types import TracebackType
from typing import Self

from weberlink.child_process import Child, python
from weberlink.order import STOP_SIGNALS

LONGEST_ORDER = 1 << 17  # bytes; about what a command line may have


class WaitingDaemon:
    """A daemon of a side without an order; a context manager that ends it if it got none. It also ends with us."""

    def __init__(self, side: str) -> None:
        self._asks, its = socketpair(AF_UNIX, SOCK_SEQPACKET)
        with its:
            command = python("-m", "weberlink.session.daemon", side, str(its.fileno()))
            self.child = Child(command, stdout=PIPE, blocked=STOP_SIGNALS, pass_fds=[its.fileno()])

    def begin(self, order: str, descriptor: int) -> Child:
        """Send the order, with the descriptor of its control socket; what died since is left to its reader."""
        with self._asks, suppress(BrokenPipeError, ConnectionResetError):
            send_fds(self._asks, [order.encode()], [descriptor])
        return self.child

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        if self._asks.fileno() >= 0:
            self._asks.close()
            self.child.kill()
            self.child.end(0.0)


def received(descriptor: int) -> tuple[str, int] | None:
    """In a daemon: wait for the order and the descriptor that came with it; None if the launcher has ended."""
    with socket(fileno=descriptor) as asked:
        order, descriptors, _, _ = recv_fds(asked, LONGEST_ORDER, 1)
    return (order.decode(), descriptors[0]) if descriptors else None
