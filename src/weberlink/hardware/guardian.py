"""The client's side of a guardian: a process that takes the force off a device when this process stops.

For devices whose board keeps the last force without a host; see `weberlink.hardware.guardian_process`.
"""

import os
import sys
from contextlib import suppress
from mmap import mmap
from pathlib import Path
from signal import SIGKILL
from socket import AF_UNIX, MSG_PEEK, recv_fds, send_fds, socket, socketpair
from subprocess import DEVNULL
from time import monotonic, monotonic_ns

from weberlink.child_process import Child, isolated_python
from weberlink.hardware import guardian_process
from weberlink.hardware.fault import BadReply, HardwareFault
from weberlink.hardware.guardian_process import APART, BEATS, HELLO, LEASE, MEMORY_SIZE, PID, WRITES, put_message

# Of the service; `$WEBERLINK_GUARDIAN` names another one, which must answer, or none where it is empty.
SOCKET = "/run/weberlink-guardian/socket"
# Numbers of the namespaces that no container has made (<linux/proc_ns.h>).
OF_THE_HOST = {"pid": 0xEFFFFFFC, "cgroup": 0xEFFFFFFB}
LEASE_S = 0.05  # longest time that a force may stand after its command [s]
START_S = 5.0  # longest time for the guardian to start [s]
END_S = 0.5  # longest time for the guardian to end [s]
SILENT_S = 0.25  # longest time without a sign of life while there is force [s]; the guardian gives one every 20 ms
DEAD_S = 0.04  # time without a sign of life before its process state is checked [s]
SHARED = (
    "the guardian of the device could not leave the cgroup of this session: what kills all of it at once leaves the "
    "force on. `weberlink guardian` as a service does not (docs/operation/services.md)\n"
)
IN_A_CONTAINER = (
    "a guardian in this container would end with it, and its board has no watchdog: run the service of "
    f"`weberlink guardian` on the host, and mount {SOCKET} here (docs/operation/services.md)"
)
DIED = "its guardian process died, and its board has no watchdog; start the session again"


class Guardian:
    """Takes the force off a device within `LEASE_S` and a few milliseconds of the last command of the loop.

    The port calls it around each message (see `SerialPort`), and the worker sets the time of each command (see
    `Worker`). No force is written without a running guardian, nor one whose command is older than the worker allows. So
    the first message after this process was stopped carries no force.

    Args:
        zero: message that takes the force off; must be understood as such whatever came before it, half of one too.
        rests: what other messages without force begin with.
    """

    def __init__(self, zero: bytes, rests: tuple[bytes, ...] = ()) -> None:
        self.zero = zero  # may be changed before `watch`, like `rests`
        self.rests = rests
        self._all_rests = (zero, *rests)
        self._connection: socket | None = None
        self._is_ours = self._is_told = False
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
        """Process id of the guardian, where that process runs; None while there is none."""
        return None if self._connection is None else self._words[PID]

    def watch(self, descriptor: int) -> None:
        """Have a process guard the device, whose descriptor it gets, open for writing; raises HardwareFault if there is
        no guardian, or none that outlives this process."""
        self.stop()
        self._all_rests = (self.zero, *self.rests)
        self._connection, self._is_ours = _connected()
        self._connection.settimeout(START_S)
        refusal, memory = b"", list[int]()
        with suppress(OSError):  # it has ended
            send_fds(self._connection, [HELLO.pack(monotonic_ns())], [descriptor])
            refusal, memory, _, _ = recv_fds(self._connection, 200, 1)
        if not memory:
            self.stop()
            raise HardwareFault(f"its guardian process {refusal.decode() or 'does not start'}")
        self._memory = mmap(memory[0], MEMORY_SIZE)
        os.close(memory[0])
        self._use(self._memory)
        self.keep(self.zero)
        self._connection.setblocking(False)
        self._writes = 0
        self._beats = (self._words[BEATS], monotonic())
        if not self._words[APART] and not self._is_told:
            sys.stderr.write(SHARED)
            self._is_told = True

    def keep(self, message: bytes) -> None:
        """Have the guardian write this message from now on; ValueError if it is too long."""
        put_message(self._shared, message)

    def lease(self, until: float) -> None:
        """Let what is written stand until a time [s], 0 for ever."""
        self._words[LEASE] = int(until * 1e9)

    def given(self, at: float, stale: float) -> None:
        """Set the time of the next command, and its largest age when it is written [s]."""
        self._given_at, self._stale = at, stale

    def before(self, data: bytes) -> None:
        """Call immediately before a message is written. Raises BadReply if it carries force, and its command is too
        old: this process was held up; HardwareFault if it carries force, and the guardian is dead or silent."""
        if data.startswith(self._all_rests):
            return
        self.check_heard()
        self.lease(self._given_at + max(LEASE_S, 2.0 * self._stale))
        if (late := monotonic() - self._given_at) > self._stale:
            raise BadReply(f"was held up for {late * 1e3:.0f} ms; the force comes up again from zero")

    def after(self, data: bytes) -> None:
        """Call after a whole message was written; raises HardwareFault if the guardian is dead."""
        if data.startswith(self._all_rests):
            self.lease(0.0)
            if self._connection is not None:
                self._silent(monotonic())

    def new_writes(self) -> int:
        """Number of messages that the guardian has written since the last call; the device may answer each."""
        known, self._writes = self._writes, self._words[WRITES]
        return self._writes - known

    def stop(self) -> None:
        """End the process, which first takes off any force left; may be called again."""
        if self._connection is None:
            return
        self._connection.settimeout(END_S)
        with suppress(OSError):  # the process has ended already
            self._connection.send(b"x")
            try:
                self._connection.recv(1)  # nothing, once it has
            except TimeoutError:
                if self._is_ours:
                    os.kill(self._words[PID], SIGKILL)
                    self._connection.recv(1)
        self._connection.close()
        self._connection = None
        if self._memory is not None:
            self._words.release()
            self._shared.release()
            self._use(bytearray(MEMORY_SIZE))
            self._memory.close()
            self._memory = None

    def check_heard(self) -> None:
        """Raise HardwareFault if the guardian is dead or silent."""
        if (silent := self._silent(monotonic())) > SILENT_S:
            raise HardwareFault(
                f"its guardian process {self.pid} has not run for {silent * 1e3:.0f} ms, and its board has no watchdog"
            )

    def _silent(self, now: float) -> float:
        """Time without a sign of life while this process ran [s]; raises HardwareFault if the guardian is dead."""
        beats, since = self._words[BEATS], self._beats[1]
        if self._connection is None:
            raise HardwareFault(DIED)
        # If this process was held up, the guardian may have been too.
        if beats != self._beats[0] or now - self._looked_at > max(LEASE_S, self._stale):
            self._beats = (beats, now)
            since = now
        elif now - since > DEAD_S and _is_closed(self._connection):  # a system call, unlike the word
            raise HardwareFault(DIED)
        self._looked_at = now
        return now - since


def _connected() -> tuple[socket, bool]:
    """A connection to a guardian that begins, and whether it is of this process alone; raises HardwareFault."""
    if path := os.environ.get("WEBERLINK_GUARDIAN", SOCKET if Path(SOCKET).exists() else ""):
        connection = socket(AF_UNIX)
        try:
            connection.connect(path)
        except OSError as error:
            connection.close()
            raise HardwareFault(
                f"its guardian does not answer at {path}: {error.strerror}; systemctl status weberlink-guardian"
            ) from None
        return connection, False
    if any(Path(f"/proc/self/ns/{name}").stat().st_ino != number for name, number in OF_THE_HOST.items()):
        raise HardwareFault(IN_A_CONTAINER)
    ours, theirs = socketpair()
    with theirs:
        number = theirs.fileno()
        command = isolated_python(guardian_process.__file__, "one", str(number))
        plain = {name: value for name, value in os.environ.items() if name != "LD_PRELOAD"}  # no code of others
        try:
            Child(command, pass_fds=(number,), stderr=DEVNULL, cwd=Path("/"), env=plain).end(START_S)
        except OSError as error:
            ours.close()
            raise HardwareFault(f"its guardian process cannot be started: {error.strerror}") from None
    return ours, True


def _is_closed(connection: socket) -> bool:
    """Whether nobody is at the other end any more."""
    try:
        return not connection.recv(1, MSG_PEEK)
    except BlockingIOError:
        return False
    except OSError:
        return True
