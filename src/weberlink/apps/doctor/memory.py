"""Memory: what could send a page away, and the shared memory that telemetry is written to."""

import re
from collections.abc import Iterator

from weberlink.apps.doctor.finding import Check, Finding, advice, ok, problem
from weberlink.apps.doctor.host import Host
from weberlink.apps.doctor.needs import Needs
from weberlink.system.daemon import RING_SECONDS
from weberlink.telemetry.record import RECORD
from weberlink.telemetry.ring import RECORDS_AT
from weberlink.telemetry.runtime_directory import Places

HUGE_PAGES = "/sys/kernel/mm/transparent_hugepage/enabled"
MEGABYTE = 1e6


def swap(host: Host, needs: Needs) -> Iterator[Finding]:
    """Whether pages may go to disk."""
    areas = host.read("/proc/swaps").splitlines()[1:]
    size = sum(int(line.split()[2]) for line in areas) * 1024
    if not areas:
        yield ok("swap", "no swap")
    elif needs.lock_memory:
        yield ok("swap", f"{size / MEGABYTE:.0f} MB of swap; daemons lock their memory where that is granted")
    else:
        yield advice(
            "swap",
            f"{size / MEGABYTE:.0f} MB of swap, and the file does not lock memory",
            "in the file: realtime: {lock_memory: true}, or: sudo swapoff -a",
        )


def huge_pages(host: Host, _needs: Needs) -> Iterator[Finding]:
    """Whether the kernel rearranges pages behind a daemon's back."""
    chosen = re.search(r"\[(\w+)\]", host.read(HUGE_PAGES))
    name = chosen[1] if chosen else "unknown"
    if name == "always":
        yield advice(
            "huge pages",
            "transparent huge pages always: the kernel moves pages while daemons run",
            f"echo madvise | sudo tee {HUGE_PAGES}",
        )
    else:
        yield ok("huge pages", f"transparent huge pages {name}")


def shared_memory(host: Host, needs: Needs) -> Iterator[Finding]:
    """Whether there is room for the rings of telemetry."""
    ring = RECORDS_AT + int(RING_SECONDS * needs.rate_hz) * RECORD.size
    wanted = ring * len(needs.sides)
    root = host.root
    places = Places(host.variables, root / "run/user", root / "dev/shm", root / "proc/self/mountinfo")
    parent = places.memory()
    where = f"/{parent.relative_to(root)}" if parent.is_relative_to(root) else str(parent)
    if not parent.is_dir():
        yield problem("shared memory", f"there is no {where}", f"sudo mount -t tmpfs tmpfs {where}")
        return
    total, free = host.space(parent)
    found = (
        f"{where}: {free / MEGABYTE:.0f} of {total / MEGABYTE:.0f} MB free, telemetry takes {wanted / MEGABYTE:.1f} MB"
    )
    if free >= wanted:
        yield ok("shared memory", found)
    elif host.in_container:
        yield problem("shared memory", found, "podman/docker run --shm-size=256m ...")
    else:
        yield problem("shared memory", found, f"sudo mount -o remount,size=256M {where}")


CHECKS: tuple[Check, ...] = (swap, huge_pages, shared_memory)
