"""Rights of a daemon, its punctuality, the host of a virtual machine, and memory: swap, huge pages, shared memory."""

import re
import resource
from collections.abc import Sequence
from typing import NamedTuple

from weberlink.cli.doctor.kernel import slow_states
from weberlink.cli.doctor.machine import Machine, Unreadable
from weberlink.cli.doctor.needs import Needs
from weberlink.cli.doctor.report import Finding, advice, ok, problem, unknown
from weberlink.cli.doctor.trial import HostTrial, RightsTrial, Stretch
from weberlink.realtime.process import HIGHEST_PRIORITY, LATENCY_REQUEST
from weberlink.session.daemon import RING_SECONDS
from weberlink.telemetry.ring import RECORDS_AT, SLOT_BYTES
from weberlink.telemetry.runtime_directory import Places

LIMITS_FILE = "/etc/security/limits.d/weberlink.conf"
LATENCY_RULE = 'KERNEL=="cpu_dma_latency", GROUP="dialout", MODE="0660"'
LATENCY_RULES_FILE = "/etc/udev/rules.d/48-weberlink-latency.rules"
HUGE_PAGES = "/sys/kernel/mm/transparent_hugepage/enabled"
LOCK_IT = "in the file: realtime: {lock_memory: true}"
PUNCTUAL, LATE = 0.25, 1.0
"""Shares of a period: the 99th percentile of lateness should stay below the first, and must below the second."""
FIRST_PERSON = 1000
"""User ids below are those of the system (Debian, login.defs)."""
ROOM = 4
"""A limit should allow so many times the memory at the start: a ring, a robot's library and threads come on top."""
MEGABYTE = 1e6
CAP_IPC_LOCK = 14
"""Number of the capability that overrides the limit of locked memory."""
TOLERATED = 0.01
"""Share of ticks, or of processor time, that the host may take."""
LATENESS_MARGIN = 0.05
"""Difference of the 99th percentiles of lateness that counts, as a share of a tick."""
STEAL_MARGIN = 0.02
"""Difference of steal that counts; the kernel counts in steps of 10 ms, about this share of a stretch."""


class Rights(NamedTuple):
    """What a daemon of this user was granted, and where its limits are set."""

    trial: RightsTrial
    priority_limit: int
    memory_limit: int
    """[bytes]; -1 for none."""
    in_container: bool
    in_unit: bool
    """Whether a unit of the system, not of a person, started this process."""
    user: str
    slow_states: list[str]

    def limit_line(self, limit: str, unit: str, container: str) -> str:
        """How to raise a limit where this process runs."""
        if self.in_container:
            return f"podman/docker run {container} ..."
        if self.in_unit:
            return f"in the unit, under [Service]: {unit}"
        return f"echo '{self.user} - {limit}' | sudo tee -a {LIMITS_FILE}    (then log in again)"

    def refusal(self, name: str) -> str:
        """Either "not permitted" or "not possible"; empty if granted. What the right needs is left to the fix."""
        grant = self.trial.grants[name]
        return "" if grant["granted"] else str(grant["detail"]).partition(":")[0]


def rights(machine: Machine, needs: Needs) -> Rights:
    trial = machine.rights_trial(
        priority=needs.priority,
        lock_memory=needs.lock_memory,
        wakeful=needs.wakeful,
        cpu=next((cpu for cpu in needs.pinned.values() if cpu in machine.affinity()), None),
        rate_hz=needs.rate_hz,
        encrypted=needs.encrypted,
    )
    if trial.failure is not None:
        raise Unreadable(trial.failure)
    try:
        slow = slow_states(machine, needs)
    except Unreadable:  # the check of idle states reports it
        slow = []
    capabilities = re.search(r"^CapEff:\s*([0-9a-f]+)", machine.read("/proc/self/status", ""), re.M)
    overridden = capabilities is not None and bool(int(capabilities[1], 16) >> CAP_IPC_LOCK & 1)
    names = (machine.variables.get(name) for name in ("SUDO_USER", "USER", "LOGNAME"))
    return Rights(
        trial,
        machine.limit(resource.RLIMIT_RTPRIO),
        -1 if overridden else machine.limit(resource.RLIMIT_MEMLOCK),
        machine.in_container,
        "INVOCATION_ID" in machine.variables and 0 < machine.user < FIRST_PERSON,
        next(filter(None, names), "USER"),
        slow,
    )


def scheduling(rights: Rights, needs: Needs) -> Finding:
    if not needs.priority:
        return advice("the file asks for the ordinary scheduler (priority 0)", "in the file: realtime: {priority: 50}")
    if not (refusal := rights.refusal("priority")):
        return ok(f"{rights.trial.grants['priority']['detail']} granted")
    fix = rights.limit_line("rtprio 98", "LimitRTPRIO=98", "--cap-add SYS_NICE --ulimit rtprio=98")
    return problem(f"SCHED_FIFO {needs.priority} {refusal} (rtprio limit {rights.priority_limit})", fix)


def memory_lock(rights: Rights, needs: Needs) -> Finding:
    """Whether memory can be locked, and later allocations too: they fail when the limit is nearly full."""
    if not needs.lock_memory:
        return advice("the file does not ask for locked memory", LOCK_IT)
    needed, limit = rights.trial.memory_bytes, rights.memory_limit
    takes, allowed = f"{needed / MEGABYTE:.0f} MB", f"memlock limit {limit / MEGABYTE:.0f} MB"
    allowed = "no limit" if limit < 0 else allowed
    locked = f"memory locked, {takes} for a daemon at its start"
    fix = rights.limit_line("memlock unlimited", "LimitMEMLOCK=infinity", "--ulimit memlock=-1")
    if refusal := rights.refusal("memory"):
        return problem(f"memory lock {refusal}: a daemon takes {takes}, {allowed}", fix)
    if 0 <= limit < ROOM * needed:
        return advice(f"{locked}, but {allowed}", fix)
    return ok(f"{locked}, {allowed}")


def idle_latency(rights: Rights, needs: Needs) -> Finding | None:
    """Whether daemons may keep processors out of deep idle states."""
    if not needs.wakeful:
        return None
    if not rights.refusal("wakeful"):
        return ok("daemons may keep processors out of deep idle states")
    found = f"daemons may not keep processors awake ({LATENCY_REQUEST})"
    if not rights.slow_states:
        return ok(f"{found}, which is not needed: no idle state is slow")
    if rights.in_container:
        return advice(found, f"podman/docker run --device {LATENCY_REQUEST} ...")
    return advice(found, f"echo '{LATENCY_RULE}' | sudo tee {LATENCY_RULES_FILE}    (then restart)")


def timer_slack(rights: Rights, _needs: Needs) -> Finding:
    detail = str(rights.trial.grants["timer_slack"]["detail"])
    return unknown(f"timer slack of 1 ns: {detail}") if rights.refusal("timer_slack") else ok(detail)


def punctuality(rights: Rights, needs: Needs) -> Finding:
    lateness, missed = rights.trial.lateness_us, rights.trial.missed
    found = (
        f"timer at {needs.rate_hz:g} Hz: late p50/p99/max "
        f"{lateness['p50']:.0f}/{lateness['p99']:.0f}/{lateness['max']:.0f} us, {missed} missed"
    )
    if lateness["p99"] > LATE * needs.period_us:
        return problem(found)
    return advice(found) if lateness["p99"] > PUNCTUAL * needs.period_us or missed else ok(found)


# --- the host of a virtual machine


def host(machine: Machine, needs: Needs) -> HostTrial:
    allowed = machine.affinity()
    trial = machine.host_trial(
        priority=min(needs.priority + 1, HIGHEST_PRIORITY),  # above daemons, which may run meanwhile
        processors=sorted(set(needs.pinned.values()) & allowed or allowed),
        rate_hz=needs.rate_hz,
    )
    if trial.failure is not None:
        raise Unreadable(f"its share of missed ticks: {trial.failure}")
    return trial


def host_share(trial: HostTrial, needs: Needs) -> Finding:
    """What the host takes with processors kept awake or not, as the file has it."""
    stretches = trial.awake if needs.wakeful and trial.awake else trial.asleep
    missed, steal = mean(stretches, "missed") or 0.0, mean(stretches, "steal")
    counted = "not counted here" if steal is None else f"{100 * steal:.1f} %"
    found = f"the host makes {100 * missed:.2f} % of ticks at {needs.rate_hz:g} Hz be missed; steal {counted}"
    return ok(found) if max(missed, steal or 0.0) <= TOLERATED else advice(found)


def wakeful(trial: HostTrial, needs: Needs) -> Finding:
    """Whether the host takes more of processors that are kept awake."""
    if trial.not_awake is not None:
        return unknown(f"processors awake or not, which is better: {trial.not_awake}")
    late = [mean(each, "p99_us") or 0.0 for each in (trial.awake, trial.asleep)]
    found = f"processors awake/not: late p99 {late[0]:.0f}/{late[1]:.0f} us"
    steal = mean(trial.awake, "steal"), mean(trial.asleep, "steal")
    if steal[0] is not None and steal[1] is not None:
        found += f", steal {100 * steal[0]:.1f}/{100 * steal[1]:.1f} %"
    better = awake_is_better(trial, needs.period_us)
    if better is None:
        return ok(f"{found}: no clear difference")
    found += f": {'awake' if better else 'not awake'} is better"
    setting = f"in the file: realtime: {{wakeful: {str(better).lower()}}}"
    return ok(found) if better == needs.wakeful else advice(found, setting)


def awake_is_better(trial: HostTrial, period_us: float) -> bool | None:
    """Whether processors should be kept awake; None if there is no clear difference.

    Lateness decides; where it makes no difference, steal. A difference is clear if its mean exceeds the margin and no
    pair of neighbouring stretches has it the other way round: the load of a host changes from second to second.
    """
    for name, margin in (("p99_us", LATENESS_MARGIN * period_us), ("steal", STEAL_MARGIN)):
        pairs = [(asleep[name], awake[name]) for asleep, awake in zip(trial.asleep, trial.awake, strict=True)]
        gains = [asleep - awake for asleep, awake in pairs if asleep is not None and awake is not None]
        if gains and abs(sum(gains)) > margin * len(gains) and (min(gains) >= 0.0 or max(gains) <= 0.0):
            return sum(gains) > 0.0
    return None


def mean(stretches: Sequence[Stretch], name: str) -> float | None:
    """Mean of a figure of the stretches; None if it was not measured."""
    values = [value for each in stretches if (value := each[name]) is not None]
    return sum(values) / len(values) if values else None


# --- memory


def swap(machine: Machine, needs: Needs) -> Finding:
    areas = machine.read("/proc/swaps").splitlines()[1:]
    size = f"{sum(int(line.split()[2]) for line in areas) * 1024 / MEGABYTE:.0f} MB of swap"
    if not areas:
        return ok("no swap")
    if needs.lock_memory:
        return ok(f"{size}; daemons lock their memory where that is granted")
    return advice(f"{size}, and the file does not lock memory")


def huge_pages(machine: Machine, _needs: Needs) -> Finding:
    chosen = re.search(r"\[(\w+)\]", machine.read(HUGE_PAGES))
    name = chosen[1] if chosen else "unknown"
    if name != "always":
        return ok(f"transparent huge pages {name}")
    return advice("transparent huge pages always: the kernel moves pages while daemons run")


def shared_memory(machine: Machine, needs: Needs) -> Finding:
    """Whether there is room for the telemetry rings."""
    wanted = len(needs.sides) * (RECORDS_AT + int(RING_SECONDS * needs.rate_hz) * SLOT_BYTES)
    root = machine.root
    folder = Places(machine.variables, root / "run/user", root / "dev/shm", root / "proc/self/mountinfo").memory()
    where = f"/{folder.relative_to(root)}" if folder.is_relative_to(root) else str(folder)
    if not folder.is_dir():
        return problem(f"there is no {where}", f"sudo mount -t tmpfs tmpfs {where}")
    total, free = machine.space(folder)
    room = f"{free / MEGABYTE:.0f} of {total / MEGABYTE:.0f} MB free"
    found = f"{where}: {room}, telemetry takes {wanted / MEGABYTE:.1f} MB"
    if free >= wanted:
        return ok(found)
    enlarge = f"sudo mount -o remount,size=256M {where}"
    return problem(found, "podman/docker run --shm-size=256m ..." if machine.in_container else enlarge)
