"""The parent's side of a guardian: a process that takes the force off a device when this process stops.

For devices whose board keeps the last force without a host; see `weberlink.hardware.guardian_process`.
"""

import os
from contextlib import suppress
from mmap import mmap
from pathlib import Path
from select import select
from socket import socketpair
from subprocess import DEVNULL
from time import monotonic

from weberlink.child_process import Child, isolated_python, shared_memory
from weberlink.hardware import guardian_process
from weberlink.hardware.fault import BadReply, HardwareFault
from weberlink.hardware.guardian_process import BEATS, LEASE, MEMORY_SIZE, WRITES, put_message

LEASE_S = 0.05
"""Longest time that a force may stand after its command [s]."""
START_S = 5.0
"""Longest time for the guardian to start [s]."""
END_S = 0.5
"""Longest time for the guardian to end [s]."""
SILENT_S = 0.25
"""Longest time without a sign of life while there is force [s]; the guardian gives one every 20 ms."""
DEAD_S = 0.04
"""Time without a sign of life before its process state is checked [s]."""
DIED = "its guardian process died, and its board has no watchdog; start the session again"


class Guardian:
    """Takes the force off a device within `LEASE_S` and a few milliseconds of the last command of the loop.

    The port calls it around each message (see `SerialPort`), and the worker sets the time of each command (see
    `Worker`). No force is written without a running guardian, nor one whose command is older than the worker allows. So
    the first message after this process was stopped carries no force.

    Args:
        zero: message that takes the force off; must be understood as such whatever came before it, half a message
            included.
        rests: what other messages without force begin with.
    """

    def __init__(self, zero: bytes, rests: tuple[bytes, ...] = ()) -> None:
        self.zero = zero
        """May be changed before `watch`, like `rests`."""
        self.rests = rests
        self._all_rests = (zero, *rests)
        self._child: Child | None = None
        self._socket = -1
        self._memory: mmap | None = None
        self._use(bytearray(MEMORY_SIZE))
        self._given_at = 0.0
        self._stale = 0.0
        self._writes = 0
        self._beats = (0, 0.0)
        self._looked_at = 0.0

    def _use(self, memory: mmap | bytearray) -> None:
        self._shared = memoryview(memory)
        self._words = self._shared.cast("q")

    @property
    def pid(self) -> int | None:
        """Process id of the guardian; None while there is none."""
        return None if self._child is None else self._child.pid

    def watch(self, descriptor: int) -> None:
        """Start the process, which gets a copy of the device's descriptor, open for writing.

        Raises:
            HardwareFault: it does not start.
        """
        self.stop()
        self._all_rests = (self.zero, *self.rests)
        ours, theirs = socketpair()
        try:
            with theirs, shared_memory("weberlink-guardian", MEMORY_SIZE) as (self._memory, memory):
                self._use(self._memory)
                put_message(self._shared, self.zero)
                inherited = (theirs.fileno(), descriptor, memory)
                command = isolated_python(guardian_process.__file__, *map(str, inherited))
                self._child = Child(command, pass_fds=inherited, stderr=DEVNULL, cwd=Path("/"))
        except OSError as error:
            ours.close()
            raise HardwareFault(f"its guardian process cannot be started: {error.strerror}") from None
        self._socket = ours.detach()
        self._writes = 0
        until = monotonic() + START_S
        while self._words[BEATS] == 0:
            # Readable once the other end is closed, so when it has died.
            dead, _, _ = select((self._socket,), (), (), 0.001)
            if dead or monotonic() > until:
                self.stop()
                raise HardwareFault("its guardian process does not start")
        self._beats = (self._words[BEATS], monotonic())

    def given(self, at: float, stale: float) -> None:
        """Set the time of the next command, and its largest age when it is written [s]."""
        self._given_at, self._stale = at, stale

    def before(self, data: bytes) -> None:
        """Call immediately before a message is written.

        Raises:
            BadReply: it carries force, and its command is too old: this process was held up.
            HardwareFault: it carries force, and the guardian is dead or silent.
        """
        if data.startswith(self._all_rests):
            return
        self._check_heard()
        self._words[LEASE] = int((self._given_at + max(LEASE_S, 2.0 * self._stale)) * 1e9)
        if (late := monotonic() - self._given_at) > self._stale:
            raise BadReply(f"was held up for {late * 1e3:.0f} ms; the force comes up again from zero")

    def after(self, data: bytes) -> None:
        """Call after a whole message was written.

        Raises:
            HardwareFault: the guardian is dead.
        """
        if data.startswith(self._all_rests):
            self._words[LEASE] = 0
            if self._child is not None:
                self._silent(monotonic())

    def new_writes(self) -> int:
        """Number of messages that the guardian has written since the last call; the device may answer each."""
        known, self._writes = self._writes, self._words[WRITES]
        return self._writes - known

    def stop(self) -> None:
        """End the process, which first takes off any force left; may be called again."""
        child, self._child = self._child, None
        if child is None:
            return
        with suppress(OSError):
            os.write(self._socket, b"x")
        child.end(END_S)
        os.close(self._socket)
        self._words.release()
        self._shared.release()
        self._use(bytearray(MEMORY_SIZE))
        assert self._memory is not None
        self._memory.close()

    def _check_heard(self) -> None:
        """Raise HardwareFault if the guardian is dead or silent."""
        if (silent := self._silent(monotonic())) > SILENT_S:
            raise HardwareFault(
                f"its guardian process {self.pid} has not run for {silent * 1e3:.0f} ms, and its board has no watchdog"
            )

    def _silent(self, now: float) -> float:
        """Time without a sign of life while this process ran [s]; raises HardwareFault if the guardian is dead."""
        beats, since = self._words[BEATS], self._beats[1]
        if self._child is None:
            raise HardwareFault(DIED)
        # If this process was held up, the guardian may have been too.
        if beats != self._beats[0] or now - self._looked_at > max(LEASE_S, self._stale):
            self._beats = (beats, now)
            since = now
        elif now - since > DEAD_S and not self._child.running:  # a system call, unlike the word
            raise HardwareFault(DIED)
        self._looked_at = now
        return now - since


class HoldingGuardian(Guardian):
    """Lets an arm whose motors keep their last goals push no more when this process stops, and keep its place.

    Without torque the arm would drop, so there is no message that takes the torque off. Each cycle the exchange says
    what leaves the arm where it is.

    Args:
        lease: longest time between two cycles [s].
    """

    def __init__(self, lease: float) -> None:
        super().__init__(b"")
        self._lease = self._stale = lease

    def hold(self, message: bytes) -> None:
        """Set what leaves the arm safe from now on, and that this process is at work.

        Raises:
            HardwareFault: the guardian is dead or silent.
        """
        put_message(self._shared, message)
        self._words[LEASE] = int((monotonic() + self._lease) * 1e9)
        self._check_heard()

    def end(self) -> None:
        """The arm is safe as it is."""
        put_message(self._shared, b"")
        self._words[LEASE] = 0

    def before(self, data: bytes) -> None:
        """A message of the exchange is written in any case: the last ones leave the arm safe."""

    def after(self, data: bytes) -> None:
        """See `before`."""
