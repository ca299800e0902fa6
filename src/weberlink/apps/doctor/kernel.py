"""Kernel and clocks: preemption, timers, real-time throttling, clock source, wall clock."""

import gzip
import re

from weberlink.apps.doctor.machine import Machine
from weberlink.apps.doctor.needs import Needs
from weberlink.apps.doctor.report import Finding, advice, ok, problem, unknown

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
