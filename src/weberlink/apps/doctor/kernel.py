"""How soon the kernel lets a real-time task run: preemption, the length of its clock tick, its brake on such tasks."""

import gzip
import re
from collections.abc import Iterator

from weberlink.apps.doctor.finding import Check, Finding, advice, ok, problem, unknown
from weberlink.apps.doctor.host import Host, Unreadable
from weberlink.apps.doctor.needs import Needs

DYNAMIC = "/sys/kernel/debug/sched/preempt"
RT_RUNTIME = "/proc/sys/kernel/sched_rt_runtime_us"
RT_PERIOD = "/proc/sys/kernel/sched_rt_period_us"
PROMPT = ("full", "lazy")
"""Models under which a real-time task need not wait for kernel code to give way: `lazy` delays ordinary tasks only
(Documentation/scheduler/sched-preemption.rst)."""
LEAST_SHARE = 0.5
"""Of a processor that real-time tasks should be let have: two daemons may share one."""


def preemption(host: Host, _needs: Needs) -> Iterator[Finding]:
    """Whether kernel code gives way to a real-time task."""
    version = host.read("/proc/version")
    release = version.split()[2] if len(version.split()) > 2 else "of unknown release"
    if _is_real_time(host, version):
        yield ok("preemption", f"kernel {release}, PREEMPT_RT")
        return
    model, dynamic = _model(host, version)
    if model is None:
        yield unknown(
            "preemption",
            f"kernel {release}: which preemption model it uses cannot be read without root",
            f"sudo cat {DYNAMIC}",
        )
    elif model in PROMPT:
        yield ok("preemption", f"kernel {release}, preemption {model}")
    else:
        yield advice(
            "preemption",
            f"preemption {model}: a tick may wait for kernel code ({release})",
            _full(host) if dynamic else real_time_kernel(host),
        )


def _full(host: Host) -> str:
    """How to choose full preemption on a kernel that lets one choose."""
    to_keep = "kernel parameter preempt=full"
    try:
        host.read(DYNAMIC)
    except Unreadable as error:
        if "no such file" in str(error):  # it is in a file system for debugging, which need not be there
            return f"{to_keep}, then restart"
    return f"echo full | sudo tee {DYNAMIC}    (to keep: {to_keep})"


def real_time_kernel(host: Host) -> str:
    """How to get a PREEMPT_RT kernel here."""
    try:
        system = host.read("/etc/os-release")
    except Unreadable:
        system = ""
    if re.search(r"^ID=ubuntu$", system, re.M):
        return "sudo pro enable realtime-kernel    (Ubuntu LTS with Ubuntu Pro), then restart"
    if re.search(r"^ID=debian$", system, re.M):
        return "sudo apt install linux-image-rt-amd64    (or -arm64), then restart"
    return "install the PREEMPT_RT kernel of this distribution, then restart"


def _is_real_time(host: Host, version: str) -> bool:
    try:
        return host.number("/sys/kernel/realtime") == 1
    except Unreadable:
        return "PREEMPT_RT" in version


def _model(host: Host, version: str) -> tuple[str | None, bool]:
    """The preemption model, None if it cannot be told, and whether it can be changed while the kernel runs."""
    dynamic = "PREEMPT_DYNAMIC" in version
    if dynamic:
        try:
            chosen = re.search(r"\((\w+)\)", host.read(DYNAMIC))
        except Unreadable:
            chosen = re.search(r"\bpreempt=(\w+)", host.read("/proc/cmdline"))
        if chosen is not None:
            return chosen[1], True
    configured = build(host)
    for name in ("none", "voluntary", "lazy"):
        if configured.get(f"CONFIG_PREEMPT_{name.upper()}") == "y":
            return name, dynamic
    if configured.get("CONFIG_PREEMPT") == "y" or (not dynamic and re.search(r"\bPREEMPT\b", version)):
        return "full", dynamic
    return (None if dynamic or not configured else "none"), dynamic


def build(host: Host) -> dict[str, str]:
    """The options that this kernel was built with; empty if nobody says."""
    try:
        release = host.read("/proc/sys/kernel/osrelease")
        text = host.read(f"/boot/config-{release}")
    except Unreadable:
        try:
            packed = (host.root / "proc/config.gz").read_bytes()
            text = gzip.decompress(packed).decode(errors="replace")
        except (OSError, EOFError):
            return {}
    return dict(re.findall(r"^(CONFIG_\w+)=(.*)$", text, re.M))


def timers(host: Host, _needs: Needs) -> Iterator[Finding]:
    """Whether timers are as fine as the hardware, or as coarse as the kernel's clock tick."""
    hertz = build(host).get("CONFIG_HZ")
    tick = f", kernel tick {hertz} Hz" if hertz else ""
    resolution_ns = host.resolution_ns()
    if resolution_ns <= 1000:
        yield ok("timers", f"high-resolution timers ({resolution_ns:g} ns){tick}")
    else:
        yield problem(
            "timers",
            f"timers are as coarse as {resolution_ns / 1e6:g} ms{tick}",
            "remove highres=off and nohz=off from the kernel parameters, then restart",
        )


def throttling(host: Host, needs: Needs) -> Iterator[Finding]:
    """The share of time that the kernel lets real-time tasks have."""
    runtime, period = host.number(RT_RUNTIME), host.number(RT_PERIOD)
    if runtime < 0:
        yield ok("throttling", "real-time tasks may take all of a processor (no throttling)")
        return
    share = runtime / period if period > 0 else 0.0
    found = f"real-time tasks may take {100 * share:.0f} % of a processor"
    if share >= LEAST_SHARE:
        yield ok("throttling", found)
    elif needs.priority:
        grade = problem if runtime == 0 else advice
        yield grade("throttling", found, f"sudo sysctl -w kernel.sched_rt_runtime_us={round(0.95 * max(period, 1))}")
    else:
        yield ok("throttling", f"{found}; the file asks for none")


CHECKS: tuple[Check, ...] = (preemption, timers, throttling)
