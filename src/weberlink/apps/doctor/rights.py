"""Checks of a daemon's rights and memory: scheduling class, memory lock, timer, swap, shared memory."""

import re
import resource
from collections.abc import Iterator, Mapping

from weberlink.apps.doctor.findings import Finding, advice, ok, problem, unknown
from weberlink.apps.doctor.machine import Machine
from weberlink.apps.doctor.needs import Needs
from weberlink.apps.doctor.processors import slow_states
from weberlink.apps.doctor.trial import RightsRequest, RightsTrial
from weberlink.realtime.process import LATENCY_REQUEST
from weberlink.system.daemon import RING_SECONDS
from weberlink.telemetry.ring import RECORDS_AT, SLOT_BYTES
from weberlink.telemetry.runtime_directory import Places

LIMITS_FILE = "/etc/security/limits.d/weberlink.conf"
LATENCY_RULE = 'KERNEL=="cpu_dma_latency", GROUP="dialout", MODE="0660"'
LATENCY_RULES_FILE = "/etc/udev/rules.d/48-weberlink-latency.rules"
HUGE_PAGES = "/sys/kernel/mm/transparent_hugepage/enabled"
PUNCTUAL, LATE = 0.25, 1.0
"""Shares of a period: the 99th percentile of lateness should stay below the first, and must below the second."""
FIRST_PERSON = 1000
"""User ids below are those of the system (Debian, login.defs)."""
ROOM = 4
"""A limit should allow so many times the memory at the start: a ring, a robot's library and threads come on top."""
MEGABYTE = 1e6


def rights(machine: Machine, needs: Needs) -> Iterator[Finding]:
    """Scheduling class, memory lock, timer slack and punctuality, from one trial."""
    pinned = next((cpu for cpu in needs.pinned.values() if cpu in machine.affinity()), None)
    trial = machine.trial(
        RightsRequest(needs.priority, needs.lock_memory, needs.wakeful, pinned, needs.rate_hz, needs.encrypted)
    )
    if trial.failure is not None:
        yield unknown(trial.failure)
        return
    yield _scheduling(machine, needs, trial)
    yield _memory(machine, needs, trial)
    yield from _wakeful(machine, needs, trial)
    slack = trial.grants["timer_slack"]
    if slack["granted"]:
        yield ok(str(slack["detail"]), "timer slack")
    else:
        yield unknown(f"timer slack of 1 ns: {slack['detail']}", check="timer slack")
    yield _punctuality(needs, trial)


def _scheduling(machine: Machine, needs: Needs, trial: RightsTrial) -> Finding:
    grant, check = trial.grants["priority"], "scheduling"
    if not needs.priority:
        found = "the file asks for the ordinary scheduler (priority 0)"
        return advice(found, "in the file: realtime: {priority: 50}", check)
    if grant["granted"]:
        return ok(f"{grant['detail']} granted", check)
    return problem(
        f"SCHED_FIFO {needs.priority} {_refusal(grant)} (rtprio limit {machine.limit(resource.RLIMIT_RTPRIO)})",
        _limit_line(machine, "rtprio 98", "LimitRTPRIO=98", "--cap-add SYS_NICE --ulimit rtprio=98"),
        check,
    )


def _refusal(grant: Mapping[str, bool | str]) -> str:
    """ "not permitted" or "not possible", without what it needs: the fix says that."""
    return str(grant["detail"]).partition(":")[0]


def _memory(machine: Machine, needs: Needs, trial: RightsTrial) -> Finding:
    """Whether memory can be locked, and later allocations too: they fail when the limit is nearly full."""
    check = "memory lock"
    if not needs.lock_memory:
        return advice("the file does not ask for locked memory", "in the file: realtime: {lock_memory: true}", check)
    grant, limit = trial.grants["memory"], machine.limit(resource.RLIMIT_MEMLOCK)
    takes = f"{trial.memory_bytes / MEGABYTE:.0f} MB"
    allowed = f"memlock limit {limit / MEGABYTE:.0f} MB"
    locked = f"memory locked, {takes} for a daemon at its start"
    fix = _limit_line(machine, "memlock unlimited", "LimitMEMLOCK=infinity", "--ulimit memlock=-1")
    if not grant["granted"]:
        return problem(f"memory lock {_refusal(grant)}: a daemon takes {takes}, {allowed}", fix, check)
    if limit < 0 or _has_ipc_lock(machine):
        return ok(f"{locked}, no limit", check)
    if limit < ROOM * trial.memory_bytes:
        return advice(f"{locked}, but {allowed}", fix, check)
    return ok(f"{locked}, {allowed}", check)


def _wakeful(machine: Machine, needs: Needs, trial: RightsTrial) -> Iterator[Finding]:
    """Whether daemons may keep processors out of deep idle states."""
    check = "idle latency"
    if not needs.wakeful:
        return
    if trial.grants["wakeful"]["granted"]:
        yield ok("daemons may keep processors out of deep idle states", check)
        return
    found = f"daemons may not keep processors awake ({LATENCY_REQUEST})"
    if machine.in_container:
        fix = f"podman/docker run --device {LATENCY_REQUEST} ..."
    else:
        fix = f"echo '{LATENCY_RULE}' | sudo tee {LATENCY_RULES_FILE}    (then restart)"
    if slow_states(machine, needs):
        yield advice(found, fix, check)
    else:
        yield ok(f"{found}, which is not needed: no idle state is slow", check)


def _has_ipc_lock(machine: Machine) -> bool:
    """Whether this process has CAP_IPC_LOCK, which overrides the limit."""
    line = next(
        (line for line in machine.read("/proc/self/status").splitlines() if line.startswith("CapEff:")), "CapEff: 0"
    )
    return bool(int(line.split()[1], 16) >> 14 & 1)


def _limit_line(machine: Machine, limit: str, unit: str, container: str) -> str:
    """How to raise a limit where this process runs: in a container, a systemd unit or a login."""
    if machine.in_container:
        return f"podman/docker run {container} ..."
    if "INVOCATION_ID" in machine.variables and 0 < machine.user < FIRST_PERSON:
        return f"in the unit, under [Service]: {unit}"
    user = (
        machine.variables.get("SUDO_USER")
        or machine.variables.get("USER")
        or machine.variables.get("LOGNAME")
        or "USER"
    )
    return f"echo '{user} - {limit}' | sudo tee -a {LIMITS_FILE}    (then log in again)"


def _punctuality(needs: Needs, trial: RightsTrial) -> Finding:
    lateness, period = trial.lateness_us, needs.period_us
    found = (
        f"timer at {needs.rate_hz:g} Hz: late p50/p99/max "
        f"{lateness['p50']:.0f}/{lateness['p99']:.0f}/{lateness['max']:.0f} us, {trial.missed} missed"
    )
    fix, check = "fix the problems above first; then look for other load: top -H -d 1", "punctuality"
    if lateness["p99"] > LATE * period:
        return problem(found, fix, check)
    if lateness["p99"] > PUNCTUAL * period or trial.missed:
        return advice(found, fix, check)
    return ok(found, check)


def swap(machine: Machine, needs: Needs) -> Finding:
    areas = machine.read("/proc/swaps").splitlines()[1:]
    size = f"{sum(int(line.split()[2]) for line in areas) * 1024 / MEGABYTE:.0f} MB of swap"
    if not areas:
        return ok("no swap")
    if needs.lock_memory:
        return ok(f"{size}; daemons lock their memory where that is granted")
    return advice(
        f"{size}, and the file does not lock memory", "in the file: realtime: {lock_memory: true}, or: sudo swapoff -a"
    )


def huge_pages(machine: Machine, _needs: Needs) -> Finding:
    chosen = re.search(r"\[(\w+)\]", machine.read(HUGE_PAGES))
    name = chosen[1] if chosen else "unknown"
    if name != "always":
        return ok(f"transparent huge pages {name}")
    return advice(
        "transparent huge pages always: the kernel moves pages while daemons run",
        f"echo madvise | sudo tee {HUGE_PAGES}",
    )


def shared_memory(machine: Machine, needs: Needs) -> Finding:
    """Whether there is room for the telemetry rings."""
    ring = RECORDS_AT + int(RING_SECONDS * needs.rate_hz) * SLOT_BYTES
    wanted = ring * len(needs.sides)
    root = machine.root
    parent = Places(machine.variables, root / "run/user", root / "dev/shm", root / "proc/self/mountinfo").memory()
    where = f"/{parent.relative_to(root)}" if parent.is_relative_to(root) else str(parent)
    if not parent.is_dir():
        return problem(f"there is no {where}", f"sudo mount -t tmpfs tmpfs {where}")
    total, free = machine.space(parent)
    found = (
        f"{where}: {free / MEGABYTE:.0f} of {total / MEGABYTE:.0f} MB free, telemetry takes {wanted / MEGABYTE:.1f} MB"
    )
    if free >= wanted:
        return ok(found)
    enlarge = f"sudo mount -o remount,size=256M {where}"
    return problem(found, "podman/docker run --shm-size=256m ..." if machine.in_container else enlarge)
