"""What the kernel grants a daemon, really tried, and how punctual its timer then is."""

import resource
from collections.abc import Iterator, Mapping

from weberlink.apps.doctor.finding import Check, Finding, advice, ok, problem, unknown
from weberlink.apps.doctor.host import Host
from weberlink.apps.doctor.needs import Needs
from weberlink.apps.doctor.processors import slow_states
from weberlink.apps.doctor.trial import Request, Trial

LIMITS_FILE = "/etc/security/limits.d/weberlink.conf"
LATENCY_DEVICE = "/dev/cpu_dma_latency"
LATENCY_RULE = 'KERNEL=="cpu_dma_latency", GROUP="dialout", MODE="0660"'
LATENCY_RULES_FILE = "/etc/udev/rules.d/48-weberlink-latency.rules"
PUNCTUAL, LATE = 0.25, 1.0
"""Shares of a period: what the 99th percentile of lateness should stay below, and what it must."""
FIRST_PERSON = 1000
"""User ids below are those of the system (Debian, login.defs)."""
ROOM = 4
"""How often the memory of a start a limit should hold: a ring, a robot's library and threads come on top."""
MEGABYTE = 1e6


def rights(host: Host, needs: Needs) -> Iterator[Finding]:
    """Scheduling class, memory lock, timer slack and punctuality: one trial tells all."""
    pinned = next((cpu for cpu in needs.pinned.values() if cpu in host.affinity()), None)
    trial = host.trial(
        Request(needs.priority, needs.lock_memory, needs.wakeful, pinned, needs.rate_hz, needs.encrypted)
    )
    if trial.failure is not None:
        yield unknown("rights", trial.failure)
        return
    yield _scheduling(host, needs, trial)
    yield from _memory(host, needs, trial)
    yield from _wakeful(host, needs, trial)
    slack = trial.grants["timer_slack"]
    if slack["granted"]:
        yield ok("timer slack", f"{slack['detail']}")
    else:
        yield unknown("timer slack", f"timer slack of 1 ns: {slack['detail']}")
    yield _punctuality(needs, trial)


def _scheduling(host: Host, needs: Needs, trial: Trial) -> Finding:
    grant = trial.grants["priority"]
    if not needs.priority:
        return advice(
            "scheduling",
            "the file asks for the ordinary scheduler (priority 0)",
            "in the file: realtime: {priority: 50}",
        )
    if grant["granted"]:
        return ok("scheduling", f"{grant['detail']} granted")
    return problem(
        "scheduling",
        f"SCHED_FIFO {needs.priority} {_refusal(grant)} (rtprio limit {host.limit(resource.RLIMIT_RTPRIO)})",
        _limit_line(host, "rtprio 98", "LimitRTPRIO=98", "--cap-add SYS_NICE --ulimit rtprio=98"),
    )


def _refusal(grant: Mapping[str, bool | str]) -> str:
    """ "not permitted" or "not possible", without what it needs: the fix says that."""
    return str(grant["detail"]).partition(":")[0]


def _memory(host: Host, needs: Needs, trial: Trial) -> Iterator[Finding]:
    """Whether memory can be locked, and goes on to be: under a limit that it nearly fills, a later allocation fails."""
    if not needs.lock_memory:
        yield advice(
            "memory lock", "the file does not ask for locked memory", "in the file: realtime: {lock_memory: true}"
        )
        return
    grant, limit = trial.grants["memory"], host.limit(resource.RLIMIT_MEMLOCK)
    takes = f"{trial.memory_bytes / MEGABYTE:.0f} MB"
    allowed = f"memlock limit {limit / MEGABYTE:.0f} MB"
    fix = _limit_line(host, "memlock unlimited", "LimitMEMLOCK=infinity", "--ulimit memlock=-1")
    if not grant["granted"]:
        yield problem("memory lock", f"memory lock {_refusal(grant)}: a daemon takes {takes}, {allowed}", fix)
    elif limit < 0 or _may_lock_anyway(host):
        yield ok("memory lock", f"memory locked, {takes} for a daemon at its start, no limit")
    elif limit < ROOM * trial.memory_bytes:
        yield advice("memory lock", f"memory locked, {takes} for a daemon at its start, but {allowed}", fix)
    else:
        yield ok("memory lock", f"memory locked, {takes} for a daemon at its start, {allowed}")


def _wakeful(host: Host, needs: Needs, trial: Trial) -> Iterator[Finding]:
    """Whether daemons may keep processors awake, which matters where there is a deep sleep."""
    if not needs.wakeful:
        return
    grant = trial.grants["wakeful"]
    if grant["granted"]:
        yield ok("idle latency", "daemons may keep processors out of deep idle states")
        return
    found = f"daemons may not keep processors awake ({LATENCY_DEVICE})"
    if host.in_container:
        fix = f"podman/docker run --device {LATENCY_DEVICE} ..."
    else:
        fix = f"echo '{LATENCY_RULE}' | sudo tee {LATENCY_RULES_FILE}    (then restart)"
    if slow_states(host, needs):
        yield advice("idle latency", found, fix)
    else:
        yield ok("idle latency", f"{found}, nor is there need: no idle state is slow")


def _may_lock_anyway(host: Host) -> bool:
    """CAP_IPC_LOCK: no limit counts."""
    line = next(
        (line for line in host.read("/proc/self/status").splitlines() if line.startswith("CapEff:")), "CapEff: 0"
    )
    return bool(int(line.split()[1], 16) >> 14 & 1)


def _limit_line(host: Host, limit: str, unit: str, container: str) -> str:
    """How to raise a limit where this process runs: a login, a unit of systemd, a container."""
    if host.in_container:
        return f"podman/docker run {container} ..."
    if "INVOCATION_ID" in host.variables and 0 < host.user < FIRST_PERSON:
        return f"in the unit, under [Service]: {unit}"
    user = host.variables.get("SUDO_USER") or host.variables.get("USER") or host.variables.get("LOGNAME") or "USER"
    return f"echo '{user} - {limit}' | sudo tee -a {LIMITS_FILE}    (then log in again)"


def _punctuality(needs: Needs, trial: Trial) -> Finding:
    lateness, period = trial.lateness_us, needs.period_us
    found = (
        f"timer at {needs.rate_hz:g} Hz: late p50/p99/max "
        f"{lateness['p50']:.0f}/{lateness['p99']:.0f}/{lateness['max']:.0f} us, {trial.missed} missed"
    )
    fix = "first what is above; then look for the load: top -H -d 1"
    if lateness["p99"] > LATE * period:
        return problem("punctuality", found, fix)
    if lateness["p99"] > PUNCTUAL * period or trial.missed:
        return advice("punctuality", found, fix)
    return ok("punctuality", found)


CHECKS: tuple[Check, ...] = (rights,)
