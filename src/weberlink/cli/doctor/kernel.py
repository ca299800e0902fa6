"""Kernel, clocks and processors: preemption, timers, clock source, isolation, frequency, idle states, quotas."""

import gzip
import re
from collections.abc import Iterator

from weberlink.cli.doctor.machine import Machine
from weberlink.cli.doctor.needs import Needs
from weberlink.cli.doctor.report import Finding, advice, ok, problem, unknown

DYNAMIC = "/sys/kernel/debug/sched/preempt"
PROMPT = ("full", "lazy")
"""Models under which a real-time task preempts kernel code at once: `lazy` delays ordinary tasks only
(Documentation/scheduler/sched-preemption.rst)."""
LEAST_SHARE = 0.5
"""Of a processor that real-time tasks should get: two daemons may share one."""
SOURCES = "/sys/devices/system/clocksource/clocksource0"
SLOW = {"hpet", "acpi_pm", "jiffies", "refined-jiffies", "pit"}
"""Clock sources read over a bus, or no finer than the kernel's tick; a daemon reads the clock several times a tick."""
REAL_TIME_KERNELS = {
    "ubuntu": "sudo pro enable realtime-kernel    (Ubuntu LTS with Ubuntu Pro), then restart",
    "debian": "sudo apt install linux-image-rt-amd64    (or -arm64), then restart",
}
OTHER_KERNEL = "install the PREEMPT_RT kernel of this distribution, then restart"
CPUS = "/sys/devices/system/cpu"
GOVERNORS = f"{CPUS}/cpu*/cpufreq/scaling_governor"
WAKE_SHARE = 0.1
"""Share of a tick that waking up from an idle state may take."""


def preemption(machine: Machine, _needs: Needs) -> Finding:
    version = machine.read("/proc/version")
    release = version.split()[2] if len(version.split()) > 2 else "of unknown release"
    if machine.read("/sys/kernel/realtime", "") == "1" or "PREEMPT_RT" in version:
        return ok(f"kernel {release}, PREEMPT_RT")
    model, dynamic = _model(machine, version)
    if model is None:
        return unknown(f"kernel {release}: its preemption model cannot be read without root", f"sudo cat {DYNAMIC}")
    if model in PROMPT:
        return ok(f"kernel {release}, preemption {model}")
    system = re.search(r"^ID=(\w+)$", machine.read("/etc/os-release", ""), re.M)
    fix = REAL_TIME_KERNELS.get(system[1] if system else "", OTHER_KERNEL)
    if dynamic:
        to_keep = "kernel parameter preempt=full"
        at_once = f"echo full | sudo tee {DYNAMIC}    (to keep: {to_keep})"
        fix = at_once if machine.may_have(DYNAMIC) else f"{to_keep}, then restart"  # debugfs need not be mounted
    return advice(f"preemption {model}: kernel code may delay a tick ({release})", fix)


def _model(machine: Machine, version: str) -> tuple[str | None, bool]:
    """The preemption model (None if unknown), and whether it can be changed at run time."""
    dynamic = "PREEMPT_DYNAMIC" in version
    chosen = re.search(r"\((\w+)\)", machine.read(DYNAMIC, ""))
    chosen = chosen or re.search(r"\bpreempt=(\w+)", machine.read("/proc/cmdline", ""))
    if dynamic and chosen is not None:
        return chosen[1], True
    options = _build_options(machine)
    for name in ("none", "voluntary", "lazy"):
        if options.get(f"CONFIG_PREEMPT_{name.upper()}") == "y":
            return name, dynamic
    if options.get("CONFIG_PREEMPT") == "y" or (not dynamic and re.search(r"\bPREEMPT\b", version)):
        return "full", dynamic
    return (None if dynamic or not options else "none"), dynamic


def _build_options(machine: Machine) -> dict[str, str]:
    """The options that this kernel was built with; empty if they cannot be read."""
    text = machine.read(f"/boot/config-{machine.read('/proc/sys/kernel/osrelease', '')}", "")
    if not text:
        try:
            text = gzip.decompress((machine.root / "proc/config.gz").read_bytes()).decode(errors="replace")
        except (OSError, EOFError):
            return {}
    return dict(re.findall(r"^(CONFIG_\w+)=(.*)$", text, re.M))


def timers(machine: Machine, _needs: Needs) -> Finding:
    hertz, resolution_ns = _build_options(machine).get("CONFIG_HZ"), machine.resolution_ns()
    tick = f", kernel tick {hertz} Hz" if hertz else ""
    if resolution_ns <= 1000:
        return ok(f"high-resolution timers ({resolution_ns:g} ns){tick}")
    return problem(f"timer resolution is only {resolution_ns / 1e6:g} ms{tick}")


def throttling(machine: Machine, needs: Needs) -> Finding:
    runtime, period = (machine.number(f"/proc/sys/kernel/sched_rt_{name}_us") for name in ("runtime", "period"))
    if runtime < 0:
        return ok("real-time tasks may take all of a processor (no throttling)")
    share = runtime / period if period > 0 else 0.0
    found = f"real-time tasks may take {100 * share:.0f} % of a processor"
    if share >= LEAST_SHARE:
        return ok(found)
    if not needs.priority:
        return ok(f"{found}; the file asks for none")
    grade = problem if runtime == 0 else advice
    return grade(found, f"sudo sysctl -w kernel.sched_rt_runtime_us={round(0.95 * max(period, 1))}")


def clock_source(machine: Machine, _needs: Needs) -> Finding:
    current = machine.read(f"{SOURCES}/current_clocksource")
    if current not in SLOW:
        return ok(f"clock source {current}")
    fix = "see why the kernel gave up the TSC: sudo dmesg | grep -iE 'tsc|clocksource'"
    better = [name for name in machine.read(f"{SOURCES}/available_clocksource").split() if name not in SLOW]
    if better:
        at_once = f"echo {better[0]} | sudo tee {SOURCES}/current_clocksource"
        fix = f"{at_once}    (to keep: kernel parameter clocksource={better[0]})"
    return problem(f"clock source {current}: reading the time is slow", fix)


def wall_clock(machine: Machine, _needs: Needs) -> Finding:
    if machine.clock_is_synchronised():
        return ok("wall clock synchronised")
    return advice("wall clock not synchronised; only logs and recordings are dated by it")


def processors(machine: Machine, needs: Needs) -> Finding:
    allowed = machine.affinity()
    online = f"{len(allowed)} processor{'' if len(allowed) == 1 else 's'} for this process"
    pin = f"in the file: realtime: {{cpus: [MASTER, SLAVE]}} with two of {', '.join(map(str, sorted(allowed)))}"
    barred = [f"{side} on {cpu}" for side, cpu in needs.pinned.items() if cpu not in allowed]
    if barred:
        return problem(f"the file pins {', '.join(barred)}, which this process may not use", pin)
    if len(set(needs.pinned.values())) < len(needs.pinned):
        return advice("the file pins both sides to one processor", pin)
    if needs.busy_poll and len(allowed) <= len(needs.sides):
        return problem(
            f"{online}, and with busy_poll each daemon takes one: little is left for everything else",
            "in the file: realtime: {busy_poll: false}; or add a processor",
        )
    if len(allowed) < len(needs.sides):
        found = f"{online}, for two daemons and everything else"
        return advice(found, "add a second processor, or run each side on its own host")
    return ok(online)


def isolation(machine: Machine, needs: Needs) -> Finding:
    """Whether other tasks are kept off the processors that daemons are pinned to."""
    isolated = cpu_list(machine.read(f"{CPUS}/isolated", ""))
    pinned = frozenset(needs.pinned.values())
    names = ", ".join(map(str, sorted(isolated)))
    if pinned and pinned <= isolated:
        return ok(f"daemons pinned to isolated processors {names}")
    if pinned:
        wanted = ",".join(map(str, sorted(pinned)))
        found = f"daemons pinned to processors {wanted}, which other tasks may use too"
        return advice(found, f"kernel parameter isolcpus={wanted}, then restart")
    if isolated:
        pair = ", ".join(map(str, (sorted(isolated) * 2)[:2]))
        found = f"processors {names} are isolated, and the file pins no daemon to them"
        return advice(found, f"in the file: realtime: {{cpus: [{pair}]}}")
    if needs.busy_poll:
        return advice(
            "with busy_poll a daemon takes a processor, and the file pins none",
            "in the file: realtime: {cpus: [MASTER, SLAVE]}, with kernel parameter isolcpus= for the same",
        )
    return ok("no processor isolated, no daemon pinned")


def cpu_list(text: str) -> frozenset[int]:
    """Parse a set of processors as the kernel writes it: "0-3,8"."""
    parts = [re.fullmatch(r"(\d+)(?:-(\d+))?", part.strip()) for part in text.split(",")]
    return frozenset(number for part in parts if part for number in range(int(part[1]), int(part[2] or part[1]) + 1))


def governor(machine: Machine, _needs: Needs) -> Finding:
    names = [machine.read(path) for path in machine.find(GOVERNORS)]
    if not names:
        return ok("no frequency scaling (fixed frequency, or a virtual machine)")
    if set(names) == {"performance"}:
        return ok(f"frequency governor performance on {len(names)} processors")
    return advice(f"frequency governor {', '.join(sorted(set(names)))}: a tick may start at a low frequency")


def idle_states(machine: Machine, needs: Needs) -> Finding:
    """Whether waking up is slow, and daemons do not prevent it."""
    slow = ", ".join(slow_states(machine, needs))
    if slow and not needs.wakeful:
        return advice(f"waking up from {slow} takes more than a tenth of a tick")
    if slow:
        return ok(f"waking up from {slow} is slow; daemons prevent these states")
    latencies_us = [machine.number(path) for path in machine.find(f"{CPUS}/cpu0/cpuidle/state[0-9]*/latency")]
    if latencies_us:
        return ok(f"idle states wake up within {max(latencies_us)} us")
    return ok("the kernel controls no idle states here")


def slow_states(machine: Machine, needs: Needs) -> list[str]:
    """Idle states in use that take more than a tenth of a tick to leave, with their latency."""
    paths = machine.find(f"{CPUS}/cpu0/cpuidle/state[0-9]*")
    latencies_us = {path: machine.number(f"{path}/latency") for path in paths if machine.read(f"{path}/disable") == "0"}
    return [
        f"{machine.read(f'{path}/name')} ({latency_us} us)"
        for path, latency_us in latencies_us.items()
        if latency_us > WAKE_SHARE * needs.period_us
    ]


def control_group(machine: Machine, needs: Needs) -> Iterator[Finding]:
    """Whether a control group limits processor time. A quota holds for ordinary tasks, not for SCHED_FIFO."""
    groups: dict[str, str] = {}  # by controller; that of version 2 under the empty name
    for line in machine.read("/proc/self/cgroup").splitlines():
        names, _, path = line.partition(":")[2].partition(":")
        groups.update(dict.fromkeys(names.split(","), path.rstrip("/")))
    quotas = []
    for mount, controller in (("/sys/fs/cgroup", ""), ("/sys/fs/cgroup/cpu", "cpu")):
        path = groups.get(controller, "")
        for folder in [mount + path.rsplit("/", up)[0] for up in range(path.count("/") + 1)]:
            old = [machine.read(f"{folder}/cpu.cfs_{name}_us", "") for name in ("quota", "period")]
            words = old if controller else machine.read(f"{folder}/cpu.max", "").split()
            if len(words) == 2 and all(word.isdecimal() for word in words) and int(words[1]):  # else "max", -1
                quotas.append((int(words[0]) / int(words[1]), folder))
    if quotas:
        share, where = min(quotas)
        yield advice(f"{where} limits tasks that are not real-time to {100 * share:.0f} % of a processor")
    else:
        yield ok("no control group limits processor time")
    budget = f"/sys/fs/cgroup/cpu{groups.get('cpu', '')}/cpu.rt_runtime_us"
    if needs.priority and machine.read(budget, "") == "0":  # only kernels with real-time groups have one
        found = "the control group has no real-time budget: SCHED_FIFO is refused"
        yield problem(found, f"echo 950000 | sudo tee {budget}", "real-time group")
