"""Checks of kernel, clocks, processors, rights, the host of a virtual machine, and memory."""

import gzip
import re
import resource
from collections.abc import Iterator, Sequence

from weberlink.realtime.process import HIGHEST_PRIORITY, LATENCY_REQUEST
from weberlink.session.daemon import RING_SECONDS
from weberlink.telemetry.ring import RECORDS_AT, slot_bytes
from weberlink.telemetry.runtime_directory import Places
from weberlink_doctor.host.checks import check
from weberlink_doctor.host.machine import Machine, Unreadable
from weberlink_doctor.host.trial import HostTrial, RightsTrial, Stretch
from weberlink_doctor.report import Finding, Needs, advice, ok, problem, unknown

# --- kernel and clocks

DYNAMIC = "/sys/kernel/debug/sched/preempt"
LEAST_SHARE = 0.5  # of a processor that real-time tasks should get: two daemons may share one
SOURCES = "/sys/devices/system/clocksource/clocksource0"
SLOW = {"hpet", "acpi_pm", "jiffies", "refined-jiffies", "pit"}
"""Clock sources read over a bus, or no finer than the kernel's tick; a daemon reads the clock several times a tick."""
REAL_TIME_KERNELS = {
    "ubuntu": "sudo pro enable realtime-kernel    (Ubuntu LTS with Ubuntu Pro), then restart",
    "debian": "sudo apt install linux-image-rt-amd64    (or -arm64), then restart",
}


@check("kernel", "preemption")
def preemption(machine: Machine, _needs: Needs) -> Finding:
    version = machine.read("/proc/version")
    release = version.split()[2] if len(version.split()) > 2 else "of unknown release"
    if machine.read("/sys/kernel/realtime", "") == "1" or "PREEMPT_RT" in version:
        return ok(f"kernel {release}, PREEMPT_RT")
    dynamic, options = "PREEMPT_DYNAMIC" in version, build_options(machine)
    chosen = re.search(r"\((\w+)\)", machine.read(DYNAMIC, ""))
    chosen = chosen or re.search(r"\bpreempt=(\w+)", machine.read("/proc/cmdline", ""))
    built = [name for name in ("none", "voluntary", "lazy") if options.get(f"CONFIG_PREEMPT_{name.upper()}") == "y"]
    if dynamic and chosen is not None:
        model = chosen[1]
    elif built:
        model = built[0]
    elif options.get("CONFIG_PREEMPT") == "y" or (not dynamic and re.search(r"\bPREEMPT\b", version)):
        model = "full"
    elif dynamic or not options:
        return unknown(f"kernel {release}: its preemption model cannot be read without root", f"sudo cat {DYNAMIC}")
    else:
        model = "none"
    # A real-time task preempts kernel code at once; `lazy` delays ordinary tasks only (sched-preemption.rst).
    if model in ("full", "lazy"):
        return ok(f"kernel {release}, preemption {model}")
    system = re.search(r"^ID=(\w+)$", machine.read("/etc/os-release", ""), re.M)
    fix = REAL_TIME_KERNELS.get(
        system[1] if system else "", "install the PREEMPT_RT kernel of this distribution, then restart"
    )
    if dynamic:
        fix = "kernel parameter preempt=full, then restart"
        if machine.may_have(DYNAMIC):  # debugfs need not be mounted
            fix = f"echo full | sudo tee {DYNAMIC}    (to keep: kernel parameter preempt=full)"
    return advice(f"preemption {model}: kernel code may delay a tick ({release})", fix)


def build_options(machine: Machine) -> dict[str, str]:
    """The options that this kernel was built with; empty if they cannot be read."""
    text = machine.read(f"/boot/config-{machine.read('/proc/sys/kernel/osrelease', '')}", "")
    if not text:
        try:
            text = gzip.decompress((machine.root / "proc/config.gz").read_bytes()).decode(errors="replace")
        except (OSError, EOFError):
            return {}
    return dict(re.findall(r"^(CONFIG_\w+)=(.*)$", text, re.M))


@check("kernel", "timers", "remove highres=off and nohz=off from the kernel parameters, then restart")
def timers(machine: Machine, _needs: Needs) -> Finding:
    hertz, resolution_ns = build_options(machine).get("CONFIG_HZ"), machine.resolution_ns()
    tick = f", kernel tick {hertz} Hz" if hertz else ""
    if resolution_ns <= 1000:
        return ok(f"high-resolution timers ({resolution_ns:g} ns){tick}")
    return problem(f"timer resolution is only {resolution_ns / 1e6:g} ms{tick}")


@check("kernel", "throttling")
def throttling(machine: Machine, needs: Needs) -> Finding:
    runtime, period = (machine.number(f"/proc/sys/kernel/sched_rt_{name}_us") for name in ("runtime", "period"))
    if runtime < 0:
        return ok("real-time tasks may take all of a processor (no throttling)")
    share = runtime / period if period > 0 else 0.0
    found = f"real-time tasks may take {100 * share:.0f} % of a processor"
    if share >= LEAST_SHARE:
        return ok(found)
    if not needs.realtime.priority:
        return ok(f"{found}; the file asks for none")
    grade = problem if runtime == 0 else advice
    return grade(found, f"sudo sysctl -w kernel.sched_rt_runtime_us={round(0.95 * max(period, 1))}")


@check("clocks", "clock source")
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


@check("clocks", "wall clock", "sudo timedatectl set-ntp true    (needs systemd-timesyncd or chrony)")
def wall_clock(machine: Machine, _needs: Needs) -> Finding:
    if machine.clock_is_synchronised():
        return ok("wall clock synchronised")
    return advice("wall clock not synchronised; only logs and recordings are dated by it")


# --- processors

CPUS = "/sys/devices/system/cpu"
GOVERNORS = f"{CPUS}/cpu*/cpufreq/scaling_governor"
WAKE_SHARE = 0.1  # share of a tick that waking up from an idle state may take


@check("processors", "processors")
def processors(machine: Machine, needs: Needs) -> Finding:
    allowed = machine.affinity()
    online = f"{len(allowed)} processor{'' if len(allowed) == 1 else 's'} for this process"
    pin = f"in the file: realtime: {{cpus: [MASTER, SLAVE]}} with two of {', '.join(map(str, sorted(allowed)))}"
    barred = [f"{side} on {cpu}" for side, cpu in needs.pinned.items() if cpu not in allowed]
    if barred:
        return problem(f"the file pins {', '.join(barred)}, which this process may not use", pin)
    if len(set(needs.pinned.values())) < len(needs.pinned):
        return advice("the file pins both sides to one processor", pin)
    if len(allowed) < len(needs.sides):
        found = f"{online}, for two daemons and everything else"
        return advice(found, "add a second processor, or run each side on its own host")
    return ok(online)


@check("processors", "isolation")
def isolation(machine: Machine, needs: Needs) -> Finding:
    """Whether other tasks are kept off the processors that daemons are pinned to."""
    # The kernel writes a set of processors as "0-3,8".
    parts = [re.fullmatch(r"(\d+)(?:-(\d+))?", part) for part in machine.read(f"{CPUS}/isolated", "").split(",")]
    isolated = {number for part in parts if part for number in range(int(part[1]), int(part[2] or part[1]) + 1)}
    pinned = set(needs.pinned.values())
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
    if needs.realtime.busy_poll:
        return advice(
            "with busy_poll a daemon takes a processor, and the file pins none",
            "in the file: realtime: {cpus: [MASTER, SLAVE]}, with kernel parameter isolcpus= for the same",
        )
    return ok("no processor isolated, no daemon pinned")


@check("processors", "governor", f"echo performance | sudo tee {GOVERNORS}")
def governor(machine: Machine, _needs: Needs) -> Finding:
    names = [machine.read(path) for path in machine.find(GOVERNORS)]
    if not names:
        return ok("no frequency scaling (fixed frequency, or a virtual machine)")
    if set(names) == {"performance"}:
        return ok(f"frequency governor performance on {len(names)} processors")
    return advice(f"frequency governor {', '.join(sorted(set(names)))}: a tick may start at a low frequency")


@check("processors", "idle states", "in the file: realtime: {wakeful: true}")
def idle_states(machine: Machine, needs: Needs) -> Finding:
    """Whether waking up is slow, and daemons do not prevent it."""
    slow = ", ".join(slow_states(machine, needs))
    if slow and not needs.realtime.wakeful:
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
    slow = {path: us for path, us in latencies_us.items() if us > WAKE_SHARE * needs.period_us}
    return [f"{machine.read(f'{path}/name')} ({latency_us} us)" for path, latency_us in slow.items()]


@check("processors", "cpu quota", "podman/docker: run without --cpus; systemd: CPUQuota= (empty) in the unit")
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
    if needs.realtime.priority and machine.read(budget, "") == "0":  # only kernels with real-time groups have one
        found = "the control group has no real-time budget: SCHED_FIFO is refused"
        yield problem(found, f"echo 950000 | sudo tee {budget}", "real-time group")


# --- what a daemon of this user is granted, and how punctual it is

LIMITS_FILE = "/etc/security/limits.d/weberlink.conf"
LATENCY_RULE = 'KERNEL=="cpu_dma_latency", GROUP="dialout", MODE="0660"'
LATENCY_RULES_FILE = "/etc/udev/rules.d/48-weberlink-latency.rules"
PUNCTUAL, LATE = 0.25, 1.0
"""Shares of a period: the 99th percentile of lateness should stay below the first, and must below the second."""
OTHER_LOAD = "fix the problems above first; then look for other load: top -H -d 1"
RATES_HZ = (4000.0, 2000.0, 1000.0)
"""Rates at which a session is tried, from the highest to the first that this machine holds."""
TOLERATED = 0.01  # share of ticks that may be missed, or of processor time that the host may take
FIRST_PERSON = 1000  # user ids below are those of the system (Debian, login.defs)
ROOM = 4
"""A limit should allow so many times the memory at the start: a ring, a robot's library and threads come on top."""
MEGABYTE = 1e6
CAP_IPC_LOCK = 14  # number of the capability that overrides the limit of locked memory


@check("rights", "rights")
def rights(machine: Machine, needs: Needs) -> Iterator[Finding]:
    trial = machine.rights_trial(
        priority=needs.realtime.priority,
        lock_memory=needs.realtime.lock_memory,
        wakeful=needs.realtime.wakeful,
        cpu=next((cpu for cpu in needs.pinned.values() if cpu in machine.affinity()), None),
        rate_hz=needs.rate_hz,
        encrypted=needs.system.link.security != "none",
    )
    if trial.failure is not None:
        raise Unreadable(trial.failure)
    yield _scheduling(machine, needs, trial)
    yield _memory_lock(machine, needs, trial)
    if needs.realtime.wakeful:
        yield _idle_latency(machine, needs, trial)
    detail = str(trial.grants["timer_slack"]["detail"])
    refused = unknown(f"timer slack of 1 ns: {detail}", check="timer slack")
    yield refused if refusal(trial, "timer_slack") else ok(detail, "timer slack")
    lateness = trial.lateness_us
    late = "/".join(f"{lateness[name]:.0f}" for name in ("p50", "p99", "max"))
    found = f"timer at {needs.rate_hz:g} Hz: late p50/p99/max {late} us, {trial.missed} missed"
    if lateness["p99"] <= PUNCTUAL * needs.period_us and not trial.missed:
        yield ok(found, "punctuality")
    else:
        grade = problem if lateness["p99"] > LATE * needs.period_us else advice
        yield grade(found, OTHER_LOAD, "punctuality")


@check("rights", "rate", OTHER_LOAD)
def rate(machine: Machine, needs: Needs) -> Finding:
    """The highest rate at which both ends of a session are punctual on this machine."""
    cpus = needs.realtime.cpus
    barred = {} if cpus is None or set(cpus) <= machine.affinity() else {"cpus": None}
    settings = {f"realtime.{name}": value for name, value in (needs.realtime.model_dump() | barred).items()}
    for rate_hz in sorted({*RATES_HZ, needs.rate_hz}, reverse=True):
        trial = machine.session_trial(settings=settings | {"rate_hz": rate_hz})
        if trial.failure is not None:
            raise Unreadable(trial.failure)
        found = f"late p99 {trial.p99_us:.0f} us, {100 * trial.missed:.2f} % of ticks missed"
        if trial.missed <= TOLERATED and trial.p99_us <= PUNCTUAL * 1e6 / rate_hz:
            found = f"both ends of a session hold {rate_hz:g} Hz here: {found}"
            return ok(found) if rate_hz >= needs.rate_hz else advice(found, f"in the file: rate_hz: {rate_hz:g}")
    return advice(f"a session is not punctual here at any rate; at {rate_hz:g} Hz: {found}")


def refusal(trial: RightsTrial, name: str) -> str:
    """Either "not permitted" or "not possible"; empty if granted. What the right needs is left to the fix."""
    grant = trial.grants[name]
    return "" if grant["granted"] else str(grant["detail"]).partition(":")[0]


def raise_limit(machine: Machine, limit: str, unit: str, container: str) -> str:
    """How to raise a limit where this process runs."""
    if machine.in_container:
        return f"podman/docker run {container} ..."
    if "INVOCATION_ID" in machine.variables and 0 < machine.user < FIRST_PERSON:  # a unit of the system
        return f"in the unit, under [Service]: {unit}"
    user = next(filter(None, (machine.variables.get(name) for name in ("SUDO_USER", "USER", "LOGNAME"))), "USER")
    return f"echo '{user} - {limit}' | sudo tee -a {LIMITS_FILE}    (then log in again)"


def _scheduling(machine: Machine, needs: Needs, trial: RightsTrial) -> Finding:
    name = "scheduling"
    if not needs.realtime.priority:
        found = "the file asks for the ordinary scheduler (priority 0)"
        return advice(found, "in the file: realtime: {priority: 50}", name)
    if not (refused := refusal(trial, "priority")):
        return ok(f"{trial.grants['priority']['detail']} granted", name)
    found = f"SCHED_FIFO {needs.realtime.priority} {refused} (rtprio limit {machine.limit(resource.RLIMIT_RTPRIO)})"
    fix = raise_limit(machine, "rtprio 98", "LimitRTPRIO=98", "--cap-add SYS_NICE --ulimit rtprio=98")
    return problem(found, fix, name)


def _memory_lock(machine: Machine, needs: Needs, trial: RightsTrial) -> Finding:
    """Whether memory can be locked, and later allocations too: they fail when the limit is nearly full."""
    name, needed = "memory lock", trial.memory_bytes
    if not needs.realtime.lock_memory:
        return advice("the file does not ask for locked memory", "in the file: realtime: {lock_memory: true}", name)
    capabilities = re.search(r"^CapEff:\s*([0-9a-f]+)", machine.read("/proc/self/status", ""), re.M)
    overridden = capabilities is not None and bool(int(capabilities[1], 16) >> CAP_IPC_LOCK & 1)
    limit = -1 if overridden else machine.limit(resource.RLIMIT_MEMLOCK)
    takes = f"{needed / MEGABYTE:.0f} MB"
    allowed = "no limit" if limit < 0 else f"memlock limit {limit / MEGABYTE:.0f} MB"
    locked = f"memory locked, {takes} for a daemon at its start"
    fix = raise_limit(machine, "memlock unlimited", "LimitMEMLOCK=infinity", "--ulimit memlock=-1")
    if refused := refusal(trial, "memory"):
        return problem(f"memory lock {refused}: a daemon takes {takes}, {allowed}", fix, name)
    if 0 <= limit < ROOM * needed:
        return advice(f"{locked}, but {allowed}", fix, name)
    return ok(f"{locked}, {allowed}", name)


def _idle_latency(machine: Machine, needs: Needs, trial: RightsTrial) -> Finding:
    """Whether daemons may keep processors out of deep idle states."""
    name = "idle latency"
    if not refusal(trial, "wakeful"):
        return ok("daemons may keep processors out of deep idle states", name)
    found = f"daemons may not keep processors awake ({LATENCY_REQUEST})"
    try:
        slow = slow_states(machine, needs)
    except Unreadable:  # the check of idle states reports it
        slow = []
    if not slow:
        return ok(f"{found}, which is not needed: no idle state is slow", name)
    if machine.in_container:
        return advice(found, f"podman/docker run --device {LATENCY_REQUEST} ...", name)
    return advice(found, f"echo '{LATENCY_RULE}' | sudo tee {LATENCY_RULES_FILE}    (then restart)", name)


# --- the host of a virtual machine

LATENESS_MARGIN = 0.05  # difference of the 99th percentiles of lateness that counts, as a share of a tick
STEAL_MARGIN = 0.02
"""Difference of steal that counts; the kernel counts in steps of 10 ms, about this share of a stretch."""


@check("host", "host", "give this machine processors of its own (pinned, not shared), and stop other load on its host")
def host(machine: Machine, needs: Needs) -> Iterator[Finding]:
    """What the host takes with processors kept awake or not, as the file has it, and which of both is better."""
    allowed = machine.affinity()
    trial = machine.host_trial(
        priority=min(needs.realtime.priority + 1, HIGHEST_PRIORITY),  # above daemons, which may run meanwhile
        processors=sorted(set(needs.pinned.values()) & allowed or allowed),
        rate_hz=needs.rate_hz,
    )
    if trial.failure is not None:
        raise Unreadable(f"its share of missed ticks: {trial.failure}")
    stretches = trial.awake if needs.realtime.wakeful and trial.awake else trial.asleep
    missed, steal = mean(stretches, "missed") or 0.0, mean(stretches, "steal")
    counted = "not counted here" if steal is None else f"{100 * steal:.1f} %"
    found = f"the host makes {100 * missed:.2f} % of ticks at {needs.rate_hz:g} Hz be missed; steal {counted}"
    yield ok(found) if max(missed, steal or 0.0) <= TOLERATED else advice(found)

    name = "wakeful"
    if trial.not_awake is not None:
        yield unknown(f"processors awake or not, which is better: {trial.not_awake}", check=name)
        return
    late = [mean(each, "p99_us") or 0.0 for each in (trial.awake, trial.asleep)]
    found = f"processors awake/not: late p99 {late[0]:.0f}/{late[1]:.0f} us"
    awake, asleep = mean(trial.awake, "steal"), mean(trial.asleep, "steal")
    if awake is not None and asleep is not None:
        found += f", steal {100 * awake:.1f}/{100 * asleep:.1f} %"
    better = awake_is_better(trial, needs.period_us)
    if better is None:
        yield ok(f"{found}: no clear difference", name)
        return
    found += f": {'awake' if better else 'not awake'} is better"
    setting = f"in the file: realtime: {{wakeful: {str(better).lower()}}}"
    yield ok(found, name) if better == needs.realtime.wakeful else advice(found, setting, name)


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

HUGE_PAGES = "/sys/kernel/mm/transparent_hugepage/enabled"


@check("memory", "swap", "in the file: realtime: {lock_memory: true}, or: sudo swapoff -a")
def swap(machine: Machine, needs: Needs) -> Finding:
    areas = machine.read("/proc/swaps").splitlines()[1:]
    size = f"{sum(int(line.split()[2]) for line in areas) * 1024 / MEGABYTE:.0f} MB of swap"
    if not areas:
        return ok("no swap")
    if needs.realtime.lock_memory:
        return ok(f"{size}; daemons lock their memory where that is granted")
    return advice(f"{size}, and the file does not lock memory")


@check("memory", "huge pages", f"echo madvise | sudo tee {HUGE_PAGES}")
def huge_pages(machine: Machine, _needs: Needs) -> Finding:
    chosen = re.search(r"\[(\w+)\]", machine.read(HUGE_PAGES))
    name = chosen[1] if chosen else "unknown"
    if name != "always":
        return ok(f"transparent huge pages {name}")
    return advice("transparent huge pages always: the kernel moves pages while daemons run")


@check("memory", "shared memory")
def shared_memory(machine: Machine, needs: Needs) -> Finding:
    """Whether there is room for the telemetry rings."""
    wanted = len(needs.sides) * (RECORDS_AT + int(RING_SECONDS * needs.rate_hz) * slot_bytes())
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
