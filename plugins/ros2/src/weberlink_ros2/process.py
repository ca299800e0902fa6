"""The parent's side of the listener, a process that takes the poses from Zenoh.

The two share a socket pair of small datagrams: the targets of `target_link`, and texts about what is wrong. The kernel
closes it however either of them ends, so each notices the end of the other.
"""

import json
import select
import socket
from contextlib import suppress
from time import monotonic

from weberlink.child_process import Child, python
from weberlink.master.devices.contract import DeviceFault
from weberlink_pointer.target_link import MARK, PointerTarget, unpack
from weberlink_ros2.admission import Subscription

READY, TROUBLE, FAILED = b"WLR1", b"WLT1", b"WLF1"
"""What a datagram other than a target begins with; a text follows, which is empty for no trouble."""
LEAD, LEAVE = b"WLL1", b"WLN1"  # what the daemon sends: one publisher may lead, or none any more
ORDER_BYTES = 4
LONGEST_TEXT = 400  # bytes of a text
SEND_BUFFER = 16_384  # of the listener [bytes]; the kernel counts about 750 for a target
MOST_A_TICK = 64
"""Datagrams that one call of `newest` reads: more than that buffer holds, so nothing old is left after a stall."""
START_S = 30.0  # longest time for the listener to start [s]; Python and Zenoh take less than one on an idle machine
END_S = 3.0  # longest time for the listener to end [s]


class ListenerProcess:
    """A `weberlink_pointer.target_link.TargetSource` that starts a listener.

    Attributes:
        trouble: why no pose leads, or why some do not; None if all is well.
        failure: why the listener has ended; None while it runs.
    """

    def __init__(self, subscription: Subscription) -> None:
        self._subscription = subscription
        self._child: Child | None = None
        self._socket: socket.socket | None = None
        self._is_led = False
        self.trouble: str | None = None
        self.failure: str | None = None

    def lead(self, *, allowed: bool) -> None:
        """Let one publisher of the topic lead from now on, or none; without it, none does."""
        self._is_led = allowed
        if self._socket is not None:
            with suppress(OSError):  # it has ended, which `newest` notices; its buffer takes more orders than are sent
                self._socket.send(LEAD if allowed else LEAVE)

    @property
    def pid(self) -> int | None:
        """Process id of the listener; None while there is none."""
        return None if self._child is None else self._child.pid

    def open(self) -> None:
        """Start it, and wait until it is subscribed; raises DeviceFault with the reason if it cannot listen, OSError if
        the process cannot be started.
        """
        self.close()
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._socket, self._is_led, self.trouble, self.failure = ours, False, None, None
        ours.setblocking(False)
        theirs.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)
        waiting = select.poll()
        waiting.register(ours.fileno(), select.POLLIN)
        self._waiting = waiting.poll
        try:
            with theirs:
                module, order = f"{__package__}.listener", json.dumps(self._subscription)
                self._child = Child(
                    python("-m", module, str(theirs.fileno()), order), stdout=2, pass_fds=(theirs.fileno(),)
                )
            self._await_ready(monotonic() + START_S)
        except BaseException:  # a signal may end the wait
            self.close()
            raise

    def newest(self, most: int = MOST_A_TICK) -> PointerTarget | None:
        """As of `TargetSource`, of at most so many datagrams."""
        newest = None
        for _ in range(most):
            if self._socket is None or self.failure is not None or not self._waiting(0):
                break
            data = self._receive(self._socket)
            if data[:4] == MARK:
                newest = unpack(data) if self._is_led else None
            elif data[:4] == TROUBLE:
                self.trouble = data[4:].decode(errors="replace") or None
        return newest

    def close(self) -> None:
        if self._socket is not None:
            self._socket.close()
            self._socket = None
        child, self._child = self._child, None
        if child is not None:
            child.end(END_S)

    def _await_ready(self, until: float) -> None:
        assert self._socket is not None
        while not self._waiting(max(0.0, until - monotonic()) * 1e3) or not (data := self._receive(self._socket)):
            if self.failure is not None:
                raise DeviceFault(f"ros2: {self.failure}")
            if monotonic() > until:
                raise DeviceFault(f"ros2: its listener does not start within {START_S:g} s; is the machine busy?")
        if data[:4] == FAILED:
            raise DeviceFault(f"ros2: {data[4:].decode(errors='replace')}")

    def _receive(self, wire: socket.socket) -> bytes:
        """A datagram that has arrived; empty at the end, with `failure` set."""
        try:
            data = wire.recv(LONGEST_TEXT + 4)
        except BlockingIOError:
            return b""
        except OSError:
            data = b""
        if not data:
            assert self._child is not None
            self._child.end(0.02)  # its descriptors are closed a little before it has ended
            self.failure = self.trouble = f"its listener {self._child.how_it_ended}; start the session again"
        return data
