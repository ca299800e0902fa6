"""Ask the kernel for what a daemon needs: scheduling, locked memory, a CPU, timers, no core dumps, end with its parent.

A right that is missing is reported, and is no error: the same program runs on a laptop and on a tuned machine.
"""

import ctypes
import errno
import os
import resource
from collections.abc import Callable
from dataclasses import dataclass
from signal import Signals

# <sys/prctl.h>, <sys/mman.h>
_SET_PARENT_DEATH_SIGNAL = 1
_SET_DUMPABLE = 4
_SET_TIMER_SLACK = 29
_LOCK_CURRENT = 1
_LOCK_FUTURE = 2
HIGHEST_PRIORITY = os.sched_get_priority_max(os.SCHED_FIFO)
LATENCY_REQUEST = "/dev/cpu_dma_latency"

LIBC = ctypes.CDLL(None, use_errno=True)
LIBC.prctl.argtypes = (ctypes.c_int, ctypes.c_ulong, ctypes.c_ulong, ctypes.c_ulong, ctypes.c_ulong)
LIBC.mlockall.argtypes = (ctypes.c_int,)


def checked(result: int) -> int:
    """The result of a call of libc. Raises OSError if it is negative, with the error number of the call."""
    if result < 0:
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number))
    return result


@dataclass(frozen=True, slots=True)
class Grant:
    """Whether a request was granted, and a text: what was granted, or why not."""

    granted: bool
    detail: str

    def __bool__(self) -> bool:
        return self.granted


NOT_ASKED = Grant(False, "not asked for")


@dataclass(frozen=True, slots=True)
class Grants:
    """The answers of the kernel to `prepare`."""

    priority: Grant
    memory: Grant
    cpu: Grant
    timer_slack: Grant
    wakeful: Grant


def prepare(priority: int, lock_memory: bool, cpu: int | None, *, wakeful: bool = False) -> Grants:
    """Ask for SCHED_FIFO, locked memory, one CPU, exact timers, and processors that do not sleep deeply.

    Call it early: threads that start later inherit the scheduler and the CPU.

    Args:
        priority: of SCHED_FIFO, 1 to 99; 0 keeps the ordinary scheduler.
        lock_memory: keep all pages, present and future, out of swap, so that no tick waits for a page fault on disk.
        cpu: number of the only CPU to run on; None for any.
        wakeful: while this process lives, no processor of the machine enters an idle state that takes time to leave.
            Costs power.

    Raises:
        ValueError: priority or cpu is a number that no machine has.
    """
    if not 0 <= priority <= HIGHEST_PRIORITY:
        raise ValueError(f"priority must be 0 (ordinary) or 1 to {HIGHEST_PRIORITY} (SCHED_FIFO), got {priority}")
    if cpu is not None and cpu < 0:
        raise ValueError(f"cpu must be 0 or more, got {cpu}")
    return Grants(
        priority=_asked(
            lambda: os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority)),
            f"SCHED_FIFO {priority}",
            f"needs CAP_SYS_NICE or an rtprio limit of {priority} or more",
        )
        if priority
        else NOT_ASKED,
        memory=_asked(_lock_memory, "memory locked") if lock_memory else NOT_ASKED,
        cpu=NOT_ASKED if cpu is None else _pin(cpu),
        # The kernel may delay timers by 50 us to wake up less often; 1 ns is the least, as 0 means the default.
        timer_slack=_asked(lambda: checked(LIBC.prctl(_SET_TIMER_SLACK, 1, 0, 0, 0)), "timer slack 1 ns"),
        wakeful=_stay_awake() if wakeful else NOT_ASKED,
    )


def die_with_parent(signal: Signals, parent: int | None = None) -> None:
    """Have the kernel send this process a signal when its parent dies, however the parent dies.

    The signal comes once for each thread of the parent, so choose one whose repetition has no effect. If the parent is
    already gone, this process sends it to itself. The kernel watches the thread that started this process: start it
    from a thread that lives as long as the parent. `parent` is its process id; None for that of this call.
    """
    expected = os.getppid() if parent is None else parent
    checked(LIBC.prctl(_SET_PARENT_DEATH_SIGNAL, signal, 0, 0, 0))
    if os.getppid() != expected:
        os.kill(os.getpid(), signal)


def forbid_core_dumps() -> None:
    """Forbid core dumps of this process and its children: they may hold a key.

    The limit is one byte: the only one at which the kernel also does not start a program named in `core_pattern`
    (fs/coredump.c). PR_SET_DUMPABLE would give this process's files in /proc to root, and where /proc hides processes
    (ProtectProc= of systemd), the monitor of the same user could not see that a daemon lives."""
    _, hard = resource.getrlimit(resource.RLIMIT_CORE)
    limit = min(hard, 1) if hard != resource.RLIM_INFINITY else 1
    resource.setrlimit(resource.RLIMIT_CORE, (limit, limit))


def conceal_memory() -> None:
    """Forbid core dumps, and that another process of this user reads this one's memory: for one that nobody watches."""
    forbid_core_dumps()
    checked(LIBC.prctl(_SET_DUMPABLE, 0, 0, 0, 0))


def _lock_memory() -> None:
    try:
        checked(LIBC.mlockall(_LOCK_CURRENT | _LOCK_FUTURE))
    except OSError as error:
        if error.errno in (errno.EPERM, errno.ENOMEM, errno.EAGAIN):
            raise PermissionError(errno.EPERM, "needs CAP_IPC_LOCK or a larger memlock limit") from error
        raise


def _pin(cpu: int) -> Grant:
    allowed = os.sched_getaffinity(0)
    if cpu not in allowed:
        return Grant(False, f"not possible: this process may run on CPU {', '.join(map(str, sorted(allowed)))}")
    return _asked(lambda: os.sched_setaffinity(0, {cpu}), f"CPU {cpu}")


def _stay_awake() -> Grant:
    """Hold the kernel's request for the least wake-up latency (its PM QoS interface) until this process ends."""
    try:
        fd = os.open(LATENCY_REQUEST, os.O_WRONLY | os.O_CLOEXEC)
    except FileNotFoundError:
        return Grant(False, f"not possible: this kernel has no {LATENCY_REQUEST}")
    except OSError as error:
        return Grant(False, f"not permitted: needs write access to {LATENCY_REQUEST} ({error.strerror})")
    os.write(fd, (0).to_bytes(4, "little"))  # in force until the kernel closes the descriptor of the ended process
    return Grant(True, "processors awake")


def _asked(ask: Callable[[], object], detail: str, needs: str = "") -> Grant:
    try:
        ask()
    except PermissionError as error:
        return Grant(False, f"not permitted: {needs or error.strerror}")
    except OSError as error:
        return Grant(False, f"not possible: {error.strerror}")
    return Grant(True, detail)
