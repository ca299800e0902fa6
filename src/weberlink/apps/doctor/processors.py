"""The processors: how many, for whom, how fast and how deeply asleep."""

import re
from collections.abc import Iterator

from weberlink.apps.doctor.finding import Check, Finding, advice, ok, problem
from weberlink.apps.doctor.host import Host, Unreadable
from weberlink.apps.doctor.needs import Needs

CPUS = "/sys/devices/system/cpu"
WAKE_SHARE = 0.1
"""Of a tick's period that waking up from an idle state may take."""


def processors(host: Host, needs: Needs) -> Iterator[Finding]:
    """Whether there are as many as daemons, and those that the file pins them to."""
    allowed = host.affinity()
    online = f"{len(allowed)} processor{'' if len(allowed) == 1 else 's'} for this process"
    barred = {side: cpu for side, cpu in needs.pinned.items() if cpu not in allowed}
    if barred:
        there = ", ".join(map(str, sorted(allowed)))
        which = ", ".join(f"{side} on {cpu}" for side, cpu in barred.items())
        yield problem("processors", f"the file pins {which}, which this process may not use", _pin(there))
    elif len(set(needs.pinned.values())) < len(needs.pinned):
        yield advice(
            "processors", "the file pins both sides to one processor", _pin(", ".join(map(str, sorted(allowed))))
        )
    elif len(allowed) < len(needs.sides):
        yield advice(
            "processors",
            f"{online}, two daemons and all else",
            "give it a second processor, or run each side on a host of its own",
        )
    else:
        yield ok("processors", online)


def isolation(host: Host, needs: Needs) -> Iterator[Finding]:
    """Whether other work stays off the processors that daemons are pinned to."""
    try:
        isolated = cpu_list(host.read(f"{CPUS}/isolated"))
    except Unreadable:
        isolated = frozenset()
    pinned = frozenset(needs.pinned.values())
    names = ", ".join(map(str, sorted(isolated)))
    if not pinned:
        if isolated:
            yield advice(
                "isolation",
                f"processors {names} are isolated, and the file pins no daemon to them",
                f"in the file: realtime: {{cpus: [{', '.join(map(str, _two(isolated)))}]}}",
            )
        else:
            yield ok("isolation", "no processor isolated, no daemon pinned")
    elif pinned <= isolated:
        yield ok("isolation", f"daemons pinned to isolated processors {names}")
    else:
        wanted = ",".join(map(str, sorted(pinned)))
        yield advice(
            "isolation",
            f"daemons pinned to processors {wanted}, where other work may run too",
            f"kernel parameter isolcpus={wanted}, then restart",
        )


def governor(host: Host, _needs: Needs) -> Iterator[Finding]:
    """Whether processors change their frequency under a task that sleeps most of the time."""
    found = [host.read(path) for path in host.find(f"{CPUS}/cpu[0-9]*/cpufreq/scaling_governor")]
    if not found:
        yield ok("governor", "no frequency scaling here (fixed, or the host's of a virtual machine)")
    elif all(name == "performance" for name in found):
        yield ok("governor", f"frequency governor performance on {len(found)} processors")
    else:
        names = ", ".join(sorted(set(found)))
        yield advice(
            "governor",
            f"frequency governor {names}: a tick may find its processor slow",
            f"echo performance | sudo tee {CPUS}/cpu*/cpufreq/scaling_governor",
        )


def idle_states(host: Host, needs: Needs) -> Iterator[Finding]:
    """How long a processor may take to wake up, and whether the file has daemons see to it."""
    states = host.find(f"{CPUS}/cpu0/cpuidle/state[0-9]*")
    slow = slow_states(host, needs)
    if slow and not needs.wakeful:
        yield advice(
            "idle states",
            f"waking up from {', '.join(slow)} takes more than a tenth of a tick",
            "in the file: realtime: {wakeful: true}",
        )
    elif slow:
        yield ok("idle states", f"slow to wake up from {', '.join(slow)}; daemons ask for better")
    elif states:
        yield ok("idle states", f"idle states wake up within {max(_latency_us(host, path) for path in states)} us")
    else:
        yield ok("idle states", "no idle states of the kernel's choice here")


def slow_states(host: Host, needs: Needs) -> list[str]:
    """Idle states in use that take more than a tenth of a tick to leave, with their latency."""
    limit_us = WAKE_SHARE * needs.period_us
    paths = [path for path in host.find(f"{CPUS}/cpu0/cpuidle/state[0-9]*") if host.read(f"{path}/disable") == "0"]
    latencies = {host.read(f"{path}/name"): _latency_us(host, path) for path in paths}
    return [f"{name} ({latency_us} us)" for name, latency_us in latencies.items() if latency_us > limit_us]


def _latency_us(host: Host, path: str) -> int:
    return host.number(f"{path}/latency")


def cpu_quota(host: Host, needs: Needs) -> Iterator[Finding]:
    """Whether a control group limits processor time. The quota holds for ordinary tasks, not for SCHED_FIFO."""
    groups = _groups(host)
    share, where = min((_quota(host, path, name) for path, name in _ancestors(groups)), default=(None, ""), key=_tight)
    if share is not None:
        yield advice(
            "cpu quota",
            f"{where} allows {100 * share:.0f} % of a processor to what is not real-time",
            "podman/docker: run without --cpus; systemd: CPUQuota= (empty) in the unit",
        )
    else:
        yield ok("cpu quota", "no control group limits processor time")
    budget = _real_time_budget(host, groups)
    if budget == 0 and needs.priority:
        yield problem(
            "real-time group",
            "the control group has no real-time budget: SCHED_FIFO is refused",
            f"echo 950000 | sudo tee /sys/fs/cgroup/cpu{groups.get('cpu', '/').rstrip('/')}/cpu.rt_runtime_us",
        )


def cpu_list(text: str) -> frozenset[int]:
    """The numbers of "0-3,8", as the kernel writes sets of processors."""
    numbers: set[int] = set()
    for part in text.split(","):
        bounds = re.fullmatch(r"(\d+)(?:-(\d+))?", part.strip())
        if bounds is not None:
            numbers.update(range(int(bounds[1]), int(bounds[2] or bounds[1]) + 1))
    return frozenset(numbers)


def _pin(allowed: str) -> str:
    return f"in the file: realtime: {{cpus: [MASTER, SLAVE]}} with two of {allowed}"


def _two(isolated: frozenset[int]) -> tuple[int, int]:
    first, *others = sorted(isolated)
    return first, others[0] if others else first


def _groups(host: Host) -> dict[str, str]:
    """The control group of this process by controller; that of version 2 under the empty name."""
    groups = {}
    for line in host.read("/proc/self/cgroup").splitlines():
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


def _quota(host: Host, folder: str, name: str) -> tuple[float | None, str]:
    """The share of a processor that a group is limited to; None for no limit."""
    try:
        words = host.read(f"{folder}/{name}").split()
        if name == "cpu.cfs_quota_us":
            words.append(host.read(f"{folder}/cpu.cfs_period_us"))
        quota, period = words
    except (Unreadable, ValueError):
        return None, folder
    if not quota.isdigit() or not period.isdigit() or int(period) == 0:  # "max", -1
        return None, folder
    return int(quota) / int(period), folder


def _tight(limit: tuple[float | None, str]) -> float:
    return float("inf") if limit[0] is None else limit[0]


def _real_time_budget(host: Host, groups: dict[str, str]) -> int | None:
    """Of a kernel with real-time groups (cgroup version 1); None for any other."""
    try:
        return host.number(f"/sys/fs/cgroup/cpu{groups.get('cpu', '/').rstrip('/')}/cpu.rt_runtime_us")
    except Unreadable:
        return None


CHECKS: tuple[Check, ...] = (processors, isolation, governor, idle_states, cpu_quota)
