"""Checks of the kernel and its clocks: preemption, timers, real-time throttling, clock source, wall clock."""

import gzip
import re

from weberlink.apps.doctor.findings import Finding, advice, ok, problem, unknown
from weberlink.apps.doctor.machine import Machine, Unreadable
from weberlink.apps.doctor.needs import Needs

DYNAMIC = "/sys/kernel/debug/sched/preempt"
PROMPT = ("full", "lazy")
"""Models under which a real-time task preempts kernel code at once: `lazy` delays ordinary tasks only
(Documentation/scheduler/sched-preemption.rst)."""
LEAST_SHARE = 0.5
"""Of a processor that real-time tasks should get: two daemons may share one."""
SOURCES = "/sys/devices/system/clocksource/clocksource0"
SLOW = {"hpet", "acpi_pm", "jiffies", "refined-jiffies", "pit"}
"""Clock sources read over a bus, or no finer than the kernel's tick; a daemon reads the clock several times a tick."""


def preemption(machine: Machine, _needs: Needs) -> Finding:
    version = machine.read("/proc/version")
    release = version.split()[2] if len(version.split()) > 2 else "of unknown release"
    if _is_real_time(machine, version):
        return ok(f"kernel {release}, PREEMPT_RT")
    model, dynamic = _model(machine, version)
    if model is None:
        return unknown(f"kernel {release}: its preemption model cannot be read without root", f"sudo cat {DYNAMIC}")
    if model in PROMPT:
        return ok(f"kernel {release}, preemption {model}")
    fix = _full_preemption(machine) if dynamic else _real_time_kernel(machine)
    return advice(f"preemption {model}: kernel code may delay a tick ({release})", fix)


def _full_preemption(machine: Machine) -> str:
    to_keep = "kernel parameter preempt=full"
    try:
        machine.read(DYNAMIC)
    except Unreadable as error:
        if "no such file" in str(error):  # debugfs need not be mounted
            return f"{to_keep}, then restart"
    return f"echo full | sudo tee {DYNAMIC}    (to keep: {to_keep})"


def _real_time_kernel(machine: Machine) -> str:
    try:
        system = machine.read("/etc/os-release")
    except Unreadable:
        system = ""
    if re.search(r"^ID=ubuntu$", system, re.M):
        return "sudo pro enable realtime-kernel    (Ubuntu LTS with Ubuntu Pro), then restart"
    if re.search(r"^ID=debian$", system, re.M):
        return "sudo apt install linux-image-rt-amd64    (or -arm64), then restart"
    return "install the PREEMPT_RT kernel of this distribution, then restart"


def _is_real_time(machine: Machine, version: str) -> bool:
    try:
        return machine.number("/sys/kernel/realtime") == 1
    except Unreadable:
        return "PREEMPT_RT" in version


def _model(machine: Machine, version: str) -> tuple[str | None, bool]:
    """The preemption model (None if unknown), and whether it can be changed at run time."""
    dynamic = "PREEMPT_DYNAMIC" in version
    if dynamic:
        try:
            chosen = re.search(r"\((\w+)\)", machine.read(DYNAMIC))
        except Unreadable:
            chosen = re.search(r"\bpreempt=(\w+)", machine.read("/proc/cmdline"))
        if chosen is not None:
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
    try:
        text = machine.read(f"/boot/config-{machine.read('/proc/sys/kernel/osrelease')}")
    except Unreadable:
        try:
            packed = (machine.root / "proc/config.gz").read_bytes()
            text = gzip.decompress(packed).decode(errors="replace")
        except (OSError, EOFError):
            return {}
    return dict(re.findall(r"^(CONFIG_\w+)=(.*)$", text, re.M))


def timers(machine: Machine, _needs: Needs) -> Finding:
    hertz = _build_options(machine).get("CONFIG_HZ")
    tick = f", kernel tick {hertz} Hz" if hertz else ""
    resolution_ns = machine.resolution_ns()
    if resolution_ns <= 1000:
        return ok(f"high-resolution timers ({resolution_ns:g} ns){tick}")
    return problem(
        f"timer resolution is only {resolution_ns / 1e6:g} ms{tick}",
        "remove highres=off and nohz=off from the kernel parameters, then restart",
    )


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
    available = machine.read(f"{SOURCES}/available_clocksource").split()
    better = next((name for name in available if name not in SLOW), None)
    if better is None:
        fix = "see why the kernel gave up the TSC: sudo dmesg | grep -iE 'tsc|clocksource'"
    else:
        at_once = f"echo {better} | sudo tee {SOURCES}/current_clocksource"
        fix = f"{at_once}    (to keep: kernel parameter clocksource={better})"
    return problem(f"clock source {current}: reading the time is slow", fix)


def wall_clock(machine: Machine, _needs: Needs) -> Finding:
    if machine.clock_is_synchronised():
        return ok("wall clock synchronised")
    return advice(
        "wall clock not synchronised; only logs and recordings are dated by it",
        "sudo timedatectl set-ntp true    (needs systemd-timesyncd or chrony)",
    )
