"""What the system says of a process and its sockets (/proc), seen from outside. Reads only; Linux."""

from pathlib import Path
from typing import NamedTuple


class Footprint(NamedTuple):
    """What a process holds at one moment; memory in KiB.

    Of `pss_kib` a process has more when another one that shares its pages ends; `dirty_kib` is all its own.
    """

    rss_kib: int
    pss_kib: int
    dirty_kib: int
    descriptors: int
    threads: int


class SocketQueue(NamedTuple):
    """A UDP socket: bytes that wait in it, and datagrams dropped for want of room so far."""

    waiting: int
    drops: int


def footprint(pid: int) -> Footprint | None:
    """None if there is no such process any more."""
    base = Path(f"/proc/{pid}")
    try:
        rolled = dict(_numbers(base / "smaps_rollup"))
        threads = dict(_numbers(base / "status"))["Threads"]
        return Footprint(
            rolled["Rss"], rolled["Pss"], rolled["Private_Dirty"], sum(1 for _ in (base / "fd").iterdir()), threads
        )
    except (FileNotFoundError, ProcessLookupError, PermissionError, KeyError):
        return None


def _numbers(path: Path) -> list[tuple[str, int]]:
    rows = []
    for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
        name, _, rest = line.partition(":")
        word = rest.split()[:1]
        if word and word[0].isdigit():
            rows.append((name, int(word[0])))
    return rows


def cpu_seconds(pid: int) -> float:
    """Time on a processor that all threads of a process have had; 0 if it has gone."""
    total = 0
    for path in Path(f"/proc/{pid}/task").glob("*/schedstat"):
        try:
            total += int(path.read_text(encoding="ascii").split()[0])
        except (FileNotFoundError, ProcessLookupError):
            continue
    return total * 1e-9


def socket_queue(port: int) -> SocketQueue:
    """Of the UDP socket bound to a port; nothing waits where there is none."""
    waiting = drops = 0
    for line in Path("/proc/net/udp").read_text(encoding="ascii").splitlines()[1:]:
        columns = line.split()
        if int(columns[1].partition(":")[2], 16) == port:
            waiting += int(columns[4].partition(":")[2], 16)
            drops += int(columns[12])
    return SocketQueue(waiting, drops)
