"""Checks of the processors: number, isolation, frequency governor, idle states, control group quotas."""

import re
from collections.abc import Iterator

from weberlink.apps.doctor.findings import Finding, advice, ok, problem
from weberlink.apps.doctor.machine import Machine, Unreadable
from weberlink.apps.doctor.needs import Needs

CPUS = "/sys/devices/system/cpu"
WAKE_SHARE = 0.1
"""Share of a tick that waking up from an idle state may take."""


def processors(machine: Machine, needs: Needs) -> Finding:
    allowed = machine.affinity()
    names = ", ".join(map(str, sorted(allowed)))
    online = f"{len(allowed)} processor{'' if len(allowed) == 1 else 's'} for this process"
    pin = f"in the file: realtime: {{cpus: [MASTER, SLAVE]}} with two of {names}"
    barred = {side: cpu for side, cpu in needs.pinned.items() if cpu not in allowed}
    if barred:
        which = ", ".join(f"{side} on {cpu}" for side, cpu in barred.items())
        return problem(f"the file pins {which}, which this process may not use", pin)
    if len(set(needs.pinned.values())) < len(needs.pinned):
        return advice("the file pins both sides to one processor", pin)
    if needs.busy_poll and len(allowed) <= len(needs.sides):
        return problem(
            f"{online}, and with busy_poll each daemon takes one: little is left for everything else",
            "in the file: realtime: {busy_poll: false}; or add a processor",
        )
    if len(allowed) < len(needs.sides):
        return advice(
            f"{online}, for two daemons and everything else",
            "add a second processor, or run each side on its own host",
        )
    return ok(online)


def isolation(machine: Machine, needs: Needs) -> Finding:
    """Whether other tasks are kept off the processors that daemons are pinned to."""
    try:
        isolated = cpu_list(machine.read(f"{CPUS}/isolated"))
    except Unreadable:
        isolated = frozenset()
    pinned = frozenset(needs.pinned.values())
    names = ", ".join(map(str, sorted(isolated)))
    if not pinned and isolated:
        first, *others = sorted(isolated)
        return advice(
            f"processors {names} are isolated, and the file pins no daemon to them",
            f"in the file: realtime: {{cpus: [{first}, {others[0] if others else first}]}}",
        )
    if not pinned and needs.busy_poll:
        return advice(
            "with busy_poll a daemon takes a processor, and the file pins none",
            "in the file: realtime: {cpus: [MASTER, SLAVE]}, with kernel parameter isolcpus= for the same",
        )
    if not pinned:
        return ok("no processor isolated, no daemon pinned")
    if pinned <= isolated:
        return ok(f"daemons pinned to isolated processors {names}")
    wanted = ",".join(map(str, sorted(pinned)))
    return advice(
        f"daemons pinned to processors {wanted}, which other tasks may use too",
        f"kernel parameter isolcpus={wanted}, then restart",
    )


def governor(machine: Machine, _needs: Needs) -> Finding:
    found = [machine.read(path) for path in machine.find(f"{CPUS}/cpu[0-9]*/cpufreq/scaling_governor")]
    if not found:
        return ok("no frequency scaling (fixed frequency, or a virtual machine)")
    if all(name == "performance" for name in found):
        return ok(f"frequency governor performance on {len(found)} processors")
    return advice(
        f"frequency governor {', '.join(sorted(set(found)))}: a tick may start at a low frequency",
        f"echo performance | sudo tee {CPUS}/cpu*/cpufreq/scaling_governor",
    )


def idle_states(machine: Machine, needs: Needs) -> Finding:
    """Whether waking up is slow, and daemons do not prevent it."""
    states = machine.find(f"{CPUS}/cpu0/cpuidle/state[0-9]*")
    slow = slow_states(machine, needs)
    if slow and not needs.wakeful:
        return advice(
            f"waking up from {', '.join(slow)} takes more than a tenth of a tick",
            "in the file: realtime: {wakeful: true}",
        )
    if slow:
        return ok(f"waking up from {', '.join(slow)} is slow; daemons prevent these states")
    if states:
        return ok(f"idle states wake up within {max(_latency_us(machine, path) for path in states)} us")
    return ok("the kernel controls no idle states here")


def slow_states(machine: Machine, needs: Needs) -> list[str]:
    """Idle states in use that take more than a tenth of a tick to leave, with their latency."""
    limit_us = WAKE_SHARE * needs.period_us
    paths = [
        path for path in machine.find(f"{CPUS}/cpu0/cpuidle/state[0-9]*") if machine.read(f"{path}/disable") == "0"
    ]
    latencies = {machine.read(f"{path}/name"): _latency_us(machine, path) for path in paths}
    return [f"{name} ({latency_us} us)" for name, latency_us in latencies.items() if latency_us > limit_us]


def _latency_us(machine: Machine, path: str) -> int:
    return machine.number(f"{path}/latency")


def cpu_quota(machine: Machine, needs: Needs) -> Iterator[Finding]:
    """Whether a control group limits processor time. The quota holds for ordinary tasks, not for SCHED_FIFO."""
    groups = _groups(machine)
    limits = [limit for folder, name in _ancestors(groups) if (limit := _quota(machine, folder, name)) is not None]
    if limits:
        share, where = min(limits)
        yield advice(
            f"{where} limits tasks that are not real-time to {100 * share:.0f} % of a processor",
            "podman/docker: run without --cpus; systemd: CPUQuota= (empty) in the unit",
        )
    else:
        yield ok("no control group limits processor time")
    budget = f"/sys/fs/cgroup/cpu{groups.get('cpu', '/').rstrip('/')}/cpu.rt_runtime_us"
    try:
        if machine.number(budget) == 0 and needs.priority:
            yield problem(
                "the control group has no real-time budget: SCHED_FIFO is refused",
                f"echo 950000 | sudo tee {budget}",
                "real-time group",
            )
    except Unreadable:
        pass  # only kernels with real-time groups (cgroup version 1) have one


def cpu_list(text: str) -> frozenset[int]:
    """Parse a set of processors as the kernel writes it: "0-3,8"."""
    numbers: set[int] = set()
    for part in text.split(","):
        bounds = re.fullmatch(r"(\d+)(?:-(\d+))?", part.strip())
        if bounds is not None:
            numbers.update(range(int(bounds[1]), int(bounds[2] or bounds[1]) + 1))
    return frozenset(numbers)


def _groups(machine: Machine) -> dict[str, str]:
    """The control group of this process by controller; that of version 2 under the empty name."""
    groups = {}
    for line in machine.read("/proc/self/cgroup").splitlines():
        _, _, rest = line.partition(":")
        names, _, path = rest.partition(":")
        groups.update(dict.fromkeys(names.split(","), path))
    return groups


def _ancestors(groups: dict[str, str]) -> Iterator[tuple[str, str]]:
    """Folders of the groups that this process is in, and the file of a quota in them."""
    for controller, mount, name in (
        ("", "/sys/fs/cgroup", "cpu.max"),
        ("cpu", "/sys/fs/cgroup/cpu", "cpu.cfs_quota_us"),
    ):
        path = groups.get(controller)
        while path is not None:
            yield f"{mount}{path.rstrip('/')}", name
            path = None if path in ("/", "") else path.rpartition("/")[0] or "/"


def _quota(machine: Machine, folder: str, name: str) -> tuple[float, str] | None:
    """The share of a processor that a group is limited to, and its folder; None for no limit."""
    try:
        words = machine.read(f"{folder}/{name}").split()
        if name == "cpu.cfs_quota_us":
            words.append(machine.read(f"{folder}/cpu.cfs_period_us"))
        quota, period = words
    except (Unreadable, ValueError):
        return None
    if not quota.isdigit() or not period.isdigit() or int(period) == 0:  # "max", -1
        return None
    return int(quota) / int(period), folder
