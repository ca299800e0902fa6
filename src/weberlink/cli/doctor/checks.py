"""The table of checks of this machine, and the runner that reads, judges and reports each row."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

from weberlink.cli.doctor import kernel, network, rights, software
from weberlink.cli.doctor.machine import Machine, Unreadable
from weberlink.cli.doctor.needs import Needs
from weberlink.cli.doctor.report import DoctorReport, Finding, Grade


def whole(machine: Machine, _needs: Needs) -> Machine:
    """For checks whose next reading depends on what the last one found."""
    return machine


@dataclass(frozen=True, slots=True)
class Check:
    """One row of the table.

    Args:
        area: heading of the report.
        name: of the check, the same on every machine.
        judge: compares the fact with the needs; None where there is nothing to report.
        fix: of advice and problems for which `judge` names no other.
        read: reads the fact. Rows with the same function share one reading; if it fails, the first of them reports
            that. Raises Unreadable.
    """

    area: str
    name: str
    judge: Callable[[Any, Needs], Finding | Iterable[Finding] | None]
    fix: str | None = None
    read: Callable[[Machine, Needs], Any] = whole


CHECKS = (
    Check("kernel", "preemption", kernel.preemption),
    Check(
        "kernel", "timers", kernel.timers, "remove highres=off and nohz=off from the kernel parameters, then restart"
    ),
    Check("kernel", "throttling", kernel.throttling),
    Check("clocks", "clock source", kernel.clock_source),
    Check(
        "clocks",
        "wall clock",
        kernel.wall_clock,
        "sudo timedatectl set-ntp true    (needs systemd-timesyncd or chrony)",
    ),
    Check("processors", "processors", kernel.processors),
    Check("processors", "isolation", kernel.isolation),
    Check("processors", "governor", kernel.governor, f"echo performance | sudo tee {kernel.GOVERNORS}"),
    Check("processors", "idle states", kernel.idle_states, "in the file: realtime: {wakeful: true}"),
    Check(
        "processors",
        "cpu quota",
        kernel.control_group,
        "podman/docker: run without --cpus; systemd: CPUQuota= (empty) in the unit",
    ),
    Check("rights", "scheduling", rights.scheduling, read=rights.rights),
    Check("rights", "memory lock", rights.memory_lock, read=rights.rights),
    Check("rights", "idle latency", rights.idle_latency, read=rights.rights),
    Check("rights", "timer slack", rights.timer_slack, read=rights.rights),
    Check(
        "rights",
        "punctuality",
        rights.punctuality,
        "fix the problems above first; then look for other load: top -H -d 1",
        rights.rights,
    ),
    Check(
        "host",
        "host",
        rights.host_share,
        "give this machine processors of its own (pinned, not shared), and stop other load on its host",
        rights.host,
    ),
    Check("host", "wakeful", rights.wakeful, read=rights.host),
    Check("memory", "swap", rights.swap, "in the file: realtime: {lock_memory: true}, or: sudo swapoff -a"),
    Check("memory", "huge pages", rights.huge_pages, f"echo madvise | sudo tee {rights.HUGE_PAGES}"),
    Check("memory", "shared memory", rights.shared_memory),
    Check("network", "receive buffer", network.receive_buffer),
    Check(
        "network", "port", network.port, "in the file: link.listen, with 0.0.0.0 or an address of `ip -brief address`"
    ),
    Check("network", "slave address", network.slave_address),
    Check("network", "firewall", network.firewall),
    Check("key", "key file", network.key_file),
    Check("devices", "devices", software.devices, read=lambda machine, _: machine.drivers()),
    Check("software", "Python", software.python, read=lambda machine, _: machine.python()),
    Check("software", "build", software.compiled, read=lambda machine, _: machine.is_compiled()),
    Check("software", "uvloop", software.uvloop),
    Check("software", "guests", software.guests),
)


def examine(needs: Needs, machine: Machine | None = None, checks: Sequence[Check] = CHECKS) -> DoctorReport:
    """Run the checks on a machine; default: this one."""
    here, facts = machine or Machine(), dict[Any, Any]()
    return DoctorReport(needs, [each for check in checks for each in _run(check, here, needs, facts)])


def _run(check: Check, machine: Machine, needs: Needs, facts: dict[Any, Any]) -> Iterator[Finding]:
    """The findings of a row; an error becomes the last finding, so that it hides no other check."""
    try:
        if check.read not in facts:
            facts[check.read] = None  # in case that reading fails
            facts[check.read] = check.read(machine, needs)
        elif facts[check.read] is None:
            return
        found = check.judge(facts[check.read], needs)
        for each in [found] if isinstance(found, Finding) else found or ():
            fix = each.fix or (check.fix if each.grade in (Grade.ADVICE, Grade.PROBLEM) else None)
            yield replace(each, area=check.area, check=each.check or check.name, fix=fix)
    except Exception as error:  # a machine that no test covers must not stop the report
        kind = "" if isinstance(error, Unreadable) else f"{type(error).__name__}: "
        reason = " ".join(str(error).split())
        yield Finding(Grade.UNKNOWN, f"{check.name}: {kind}{reason}", None, check.name, check.area)
