"""The guardian: takes the force off a device when the process that commands it stops.

A program of the standard library alone, run by its path with an isolated interpreter. As a service (`serve SOCKET`, by
`weberlink guardian`) it forks a process for each device; without a service, `hardware.guardian` starts it for one
device with the descriptor of a connection (`one DESCRIPTOR`). Both say and do the same from then on.

The client sends its time and the device's descriptor, and gets the descriptor of shared memory, where it stores the
message that takes the force off. Every force has a lease: before the client writes one, it stores in the memory until
when that force may stand (`LEASE` [ns, CLOCK_MONOTONIC]; 0 for no force). When the lease expires, the guardian writes
the message repeatedly until the client renews or ends the lease. When the connection closes, which the kernel does
however the client dies, the guardian writes the message and ends.

The memory of a service is a file in `$RUNTIME_DIRECTORY`. Where client and guardian were killed together, `zero`
(`ExecStopPost=` of the unit) writes the messages of the leases that are left there.
"""

import os
import select
import signal
import struct
import sys
import termios
from collections.abc import Iterator
from contextlib import suppress
from mmap import mmap
from pathlib import Path
from socket import AF_UNIX, SHUT_RDWR, SOCK_DGRAM, recv_fds, send_fds, socket
from struct import Struct
from time import monotonic_ns, sleep
from zlib import crc32

LEASE, BEATS, WRITES, SLOT, PID, APART, DEVICE = range(7)
"""Words of 64 bits in the shared memory: the client writes `LEASE` and `SLOT`, the guardian the others.

`BEATS` counts the cycles of the loop, `WRITES` the messages sent, `SLOT` is the number of the message in use; `PID` is
the guardian's, `APART` whether it is in a cgroup of its own, `DEVICE` the number of the device node, 0 for a socket."""
WORDS_SIZE = 8 * 8
# Each of the two messages behind the words, its `HEAD` in front. The client writes the one that is not in use.
SLOT_SIZE = 2048
HEAD = Struct("<HI")  # length and checksum of a message
MEMORY_SIZE = WORDS_SIZE + 2 * SLOT_SIZE
HELLO = Struct("<q")  # what a client begins with: its time [ns, CLOCK_MONOTONIC]. The device's descriptor comes along
HELLO_S = 1.0  # longest time from a connection to that [s]
OLDEST_NS = 5_000_000_000  # greatest age of that time; no greater than a client waits
OTHER_CLOCK = b"runs by another clock than this host (a time namespace), so no lease can be kept"

PAUSE_NS = 20_000_000  # longest time between two checks of the lease; every lease must be longer
REPEATS = 10  # number of messages at that pace
SLOW_NS = 1_000_000_000  # pause between later messages: nobody reads the answers of the device
LAST_WRITES = 2
LAST_PAUSE_S = 0.01
CGROUP = "weberlink-guardian"


def main(kind: str, where: str) -> None:
    if kind == "zero":
        take_off(Path(where))
        return
    if kind == "one" and os.fork():  # so that it is nobody's child, and no end of a tree of processes reaches it
        return
    _go_first()
    if kind == "serve":
        serve(where)
        return
    # Whoever stops the client may send the same to all around it; this one ends with the client, not before.
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT):
        signal.signal(number, signal.SIG_IGN)
    attend(socket(fileno=int(where)), leave_cgroup())


def serve(path: str) -> None:
    """Fork a guardian for each connection, until a signal ends all of them; they take the force off then."""
    folder = os.environ.get("RUNTIME_DIRECTORY")  # so this is a unit, with a control group of its own
    apart = folder is not None or leave_cgroup()
    if not apart:
        sys.stderr.write("in the cgroup of what started it: it ends with that; start it as a service\n")
    with socket(AF_UNIX) as other, suppress(ConnectionRefusedError, FileNotFoundError):
        other.connect(path)
        sys.exit(f"{path}: a guardian serves there already")
    os.umask(0o117)  # for the group too
    try:
        Path(path).unlink(missing_ok=True)
        listener = socket(AF_UNIX)
        listener.bind(path)
    except OSError as error:
        sys.exit(f"{path}: cannot be served: {error.strerror}")
    listener.listen()
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    if address := os.environ.get("NOTIFY_SOCKET"):  # tell systemd that clients may come
        with socket(AF_UNIX, SOCK_DGRAM) as notify:
            notify.sendto(b"READY=1", address.replace("@", "\0", 1))
    while True:
        connection, _ = listener.accept()
        with connection, suppress(OSError):  # no more processes: the client is refused, the others stay guarded
            if os.fork() == 0:
                _attend_alone(connection, listener, apart, folder)


def _attend_alone(connection: socket, listener: socket, apart: bool, folder: str | None) -> None:
    """In a process of the service, which the service's end ends too, with the force off."""
    try:
        listener.close()
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, lambda *_: connection.shutdown(SHUT_RDWR))
        attend(connection, apart, folder)
    finally:
        os._exit(0)


def attend(connection: socket, apart: bool, folder: str | None = None) -> None:
    """Guard the device of the client at the other end of a connection, until one of them ends.

    The memory is a file in `folder`, if there is one, for `take_off`."""
    connection.settimeout(HELLO_S)
    try:
        told, (device,), _, _ = recv_fds(connection, HELLO.size, 1)
        (then,) = HELLO.unpack(told)
    except (OSError, ValueError, struct.error):  # no client of ours
        return
    if not 0 <= monotonic_ns() - then < OLDEST_NS:
        connection.sendall(OTHER_CLOCK)
        return
    left = Path(f"{folder}/{os.getpid()}.lease")
    memory = os.open(left, os.O_RDWR | os.O_CREAT | os.O_TRUNC, 0o600) if folder else os.memfd_create(CGROUP)
    os.ftruncate(memory, MEMORY_SIZE)
    data = memoryview(mmap(memory, MEMORY_SIZE))
    words = data.cast("q")
    words[PID], words[APART], words[DEVICE], words[BEATS] = os.getpid(), apart, os.fstat(device).st_rdev, 1
    with suppress(OSError):
        send_fds(connection, [b"+"], [memory])
        connection.setblocking(True)
    watch(data, connection.fileno(), device)
    if folder:
        left.unlink()
    os.close(device)  # before the client hears of the end: it may open the device again at once


def put_message(memory: memoryview, message: bytes) -> None:
    words = memory.cast("q")
    slot = 1 - words[SLOT]
    at = WORDS_SIZE + slot * SLOT_SIZE
    stored = HEAD.pack(len(message), crc32(message)) + message
    if len(stored) > SLOT_SIZE:
        raise ValueError(f"a message of {len(message)} bytes is too long for a guardian")
    memory[at : at + len(stored)] = stored
    words[SLOT] = slot


def get_message(memory: memoryview) -> bytes:
    """The message in use; the one before it where a processor that reorders stores (ARM) shows a part of it."""
    newest = memory.cast("q")[SLOT] & 1
    for slot in (newest, 1 - newest):
        at = WORDS_SIZE + slot * SLOT_SIZE
        size, check = HEAD.unpack_from(memory, at)
        message = bytes(memory[at + HEAD.size : at + HEAD.size + size])
        if crc32(message) == check:
            return message
    return b""


def watch(memory: memoryview, socket: int, device: int) -> None:
    """Watch the lease until the client says goodbye or dies."""
    words = memory.cast("q")
    poll = select.poll()
    poll.register(socket, select.POLLIN)
    repeats, due = 0, 0
    while True:
        words[BEATS] += 1
        lease, now = words[LEASE], monotonic_ns()
        pause = PAUSE_NS
        if lease == 0 or now < lease:
            repeats, due = 0, now
            pause = PAUSE_NS if lease == 0 else min(PAUSE_NS, lease - now)
        elif now >= due and words[LEASE] == lease:  # the client may have come back this very moment
            words[WRITES] += 1
            write(device, get_message(memory))
            repeats += 1
            due = now + (PAUSE_NS if repeats < REPEATS else SLOW_NS)
        if poll.poll(pause / 1e6):
            goodbye = b""
            with suppress(ConnectionResetError):  # it died before it had read the answer
                goodbye = os.read(socket, 1)
            if not goodbye or words[LEASE] != 0:
                write_last(device, memory)
            return


def write_last(device: int, memory: memoryview) -> None:
    for _ in range(LAST_WRITES):
        write(device, get_message(memory))
        sleep(LAST_PAUSE_S)


def write(device: int, message: bytes) -> None:
    """Write the whole message, in place of data that the device has not taken yet."""
    with suppress(OSError, termios.error):  # unplugged
        if not _taken(device, message):
            termios.tcflush(device, termios.TCOFLUSH)
            _taken(device, message)


def _taken(device: int, message: bytes) -> bool:
    try:
        return os.write(device, message) == len(message)
    except BlockingIOError:
        return False


def take_off(folder: Path) -> None:
    """Write the messages of the leases in a folder that nobody ended or let expire."""
    for path in folder.glob("*.lease"):
        with path.open("rb") as file:  # the client may have made it longer or shorter
            memory = memoryview(bytearray(file.read(MEMORY_SIZE).ljust(MEMORY_SIZE, b"\0")))
        words = memory.cast("q")
        for node in _nodes(words[DEVICE]) if words[LEASE] else ():
            sys.stderr.write(f"{node}: its guardian was killed; takes the force off\n")
            with suppress(OSError):  # gone, or held by somebody else: the others get theirs
                device = os.open(node, os.O_WRONLY | os.O_NONBLOCK | os.O_NOCTTY)
                write_last(device, memory)
                os.close(device)
        path.unlink()


def _nodes(number: int) -> Iterator[str]:
    """The node of a device in /dev; none for a socket."""
    for folder, _, names in os.walk("/dev"):
        for path in (f"{folder}/{name}" for name in names):
            with suppress(OSError):
                if number and os.lstat(path).st_rdev == number:
                    yield path


def leave_cgroup() -> bool:
    """Move into a cgroup that does not end with that of the session; False where this user may not."""
    mounts, cgroups = (Path(f"/proc/self/{name}").read_text().splitlines() for name in ("mountinfo", "cgroup"))
    root = next((line.split()[4] for line in mounts if " - cgroup2 " in line), None)
    own = next((line.removeprefix("0::") for line in cgroups if line.startswith("0::")), "")
    above = [] if root is None else [Path(root + str(each)) for each in Path(own).parents] or [Path(root)]
    for folder in (each / CGROUP for each in reversed(above)):
        try:
            folder.mkdir(exist_ok=True)
            (folder / "cgroup.procs").write_text("0")
        except OSError:
            with suppress(OSError):  # which goes only where it is empty
                folder.rmdir()
        else:
            return True
    return False


def _go_first() -> None:
    """Raise the priority above the client's, which may keep the processor busy; 0 is that of the ordinary scheduler."""
    with suppress(OSError):
        os.sched_setaffinity(0, range(os.cpu_count() or 1))
    priority = min(os.sched_get_priority_max(os.SCHED_FIFO), os.sched_getparam(0).sched_priority + 1)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except OSError:
        with suppress(OSError):
            os.setpriority(os.PRIO_PROCESS, 0, -10)


if __name__ == "__main__":
    main(*sys.argv[1:])
