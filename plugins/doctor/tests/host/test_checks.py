"""Each check on emulated machines: facts of a machine, the grade that they get, and the fix."""

import os
import socket
from collections.abc import Mapping
from dataclasses import replace
from errno import EADDRINUSE
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from plugins.doctor.tests.host.machines import (
    BUILD,
    CLOCK,
    CPU,
    GRANTS,
    REFUSED,
    STRETCH,
    TRIAL,
    asking,
    idle_state,
    look,
    machine,
)
from weberlink.cli.devices import NO_RULES, READY, DriverStatus
from weberlink.config.model import DriverSettings
from weberlink.hardware.discovery import PluggedDevice
from weberlink.protocol.keys import generate
from weberlink.telemetry.ring import slot_bytes
from weberlink_doctor.host.checks import CHECKS
from weberlink_doctor.host.examination import examine
from weberlink_doctor.host.machine import Machine
from weberlink_doctor.host.network import CHARGED_BYTES
from weberlink_doctor.host.trial import HostTrial, RightsTrial, SessionTrial
from weberlink_doctor.report import Grade, Needs

OK, ADVICE, PROBLEM, UNKNOWN = Grade.OK, Grade.ADVICE, Grade.PROBLEM, Grade.UNKNOWN
DYNAMIC = "Linux version 6.1.0-21-amd64 (debian-kernel@lists.debian.org) #1 SMP PREEMPT_DYNAMIC Debian 6.1.90-1"
NOT_RT = {"sys/kernel/realtime": None, "proc/version": DYNAMIC}
DEBUG = "sys/kernel/debug/sched/preempt"
CONFIG = "boot/config-6.1.0-21-rt-amd64"
OLD = NOT_RT | {"proc/version": "Linux version 5.10.0 (x) #1 SMP Debian", CONFIG: "CONFIG_PREEMPT_NONE=y\n"}
RUNTIME = "proc/sys/kernel/sched_rt_runtime_us"
DEEP = idle_state(2, "C6", 133)
GOVERNOR = "cpufreq/scaling_governor"
SLICE = "sys/fs/cgroup/user.slice"
SWAP = {"proc/swaps": "Filename\tType\tSize\tUsed\tPriority\n/dev/sda2  partition\t2000000\t0\t-2\n"}
HUGE = "sys/kernel/mm/transparent_hugepage/enabled"
RING = 10 * 1000 * slot_bytes()
TIGHT = {"space": lambda _path: (64_000_000, int(1.5 * RING))}
LISTENING = asking(link={"listen": "0.0.0.0:47000"})
CALLING = asking(link={"slave": "robot:47000"})
SLEEPY = asking(realtime={"wakeful": False})
LIMITS = "| sudo tee -a /etc/security/limits.d/weberlink.conf"
NAMED = asking("x.yaml", master={"device": DriverSettings(driver="paddle")})
INSTALL = "sudo weberlink device rules"
# Port 47000 is B798; the tenth column is the inode.
SOCKETS = {"proc/net/udp": "sl local\n 12: 00000000:B798 00000000:0000 07 0:0 00:0 00000000 0 0 4242 2\n"}


def failing(number: int, kind: type[OSError] = OSError) -> Any:
    def fail(*_: object) -> Any:
        raise kind(number, os.strerror(number) if kind is OSError else "Name or service not known")

    return fail


def at(address: str) -> dict[str, Any]:
    return {"resolve": lambda _name: [address]}


def rights(*refused: str, p99: float = 60.0, **answers: Any) -> dict[str, Any]:
    """A trial of rights with these refused, and this lateness [us]."""
    grants = GRANTS | dict.fromkeys(refused, REFUSED)
    trial = replace(TRIAL, grants=grants, lateness_us={"p50": 10.0, "p99": p99, "max": p99})
    return {"rights_trial": lambda **_: trial, **answers}


def driver(side: str, name: str, state: str, *advice: str) -> dict[str, Any]:
    """A machine with one driver, whose device is plugged in."""
    status = DriverStatus(side, name, None, "hardware", None, state, (PluggedDevice("/dev/ttyACM0", "Paddle"),), advice)
    return {"drivers": lambda: [status]}


def has(*names: str) -> dict[str, Any]:
    return {"which": lambda name: f"/bin/{name}" if name in names else None}


def awake(**stretch: float | None) -> dict[str, Any]:
    """A trial whose stretches are all alike, but for these figures where processors stay awake."""
    trial = HostTrial([STRETCH | {"steal": 0.0}] * 4, [STRETCH | stretch] * 4)
    return {"host_trial": lambda **_: trial}


def sessions(most_hz: float, *, missed: float = 0.0, late_share: float = 0.2) -> dict[str, Any]:
    """A machine that is punctual up to a rate; above it late by more than is allowed, and below it by so much."""

    def trial(*, settings: Mapping[str, Any]) -> SessionTrial:
        rate_hz = settings["rate_hz"]
        return SessionTrial((0.3 if rate_hz > most_hz else late_share) * 1e6 / rate_hz, missed)

    return {"session_trial": trial}


class Case(NamedTuple):
    """An emulated machine, and the finding expected of one check."""

    check: str
    grade: Grade
    words: str = ""  # in what was found or in the fix
    files: Mapping[str, str | None] = {}
    needs: Needs = Needs()
    answers: Mapping[str, Any] = {}


CASES = [
    # kernel
    Case("preemption", OK, "6.1.0-21-rt-amd64"),
    Case("preemption", OK, files=NOT_RT | {DEBUG: "none voluntary (full)"}),
    Case("preemption", ADVICE, f"echo full | sudo tee /{DEBUG} ", NOT_RT | {DEBUG: "none (voluntary) full"}),
    Case("preemption", ADVICE, "parameter preempt=full, then", NOT_RT | {CONFIG: "CONFIG_PREEMPT_VOLUNTARY=y\n"}),
    Case("preemption", ADVICE, "apt install linux-image-rt-amd64", OLD | {"etc/os-release": "ID=debian"}),
    Case("timers", PROBLEM, "4 ms", answers={"resolution_ns": lambda: 4e6}),
    Case("throttling", PROBLEM, "sched_rt_runtime_us=950000", {RUNTIME: "0"}),
    # clocks
    Case("clock source", PROBLEM, f"echo tsc | sudo tee /{CLOCK}/", {f"{CLOCK}/current_clocksource": "hpet"}),
    Case(
        "clock source",
        PROBLEM,
        "dmesg",
        {f"{CLOCK}/current_clocksource": "hpet", f"{CLOCK}/available_clocksource": "hpet acpi_pm"},
    ),
    Case("wall clock", ADVICE, answers={"clock_is_synchronised": lambda: False}),
    # processors
    Case("processors", PROBLEM, "slave on 7", needs=asking(realtime={"cpus": (1, 7)})),
    Case("processors", ADVICE, answers={"affinity": lambda: frozenset({0})}),
    Case("governor", ADVICE, f"tee /{CPU}/cpu*/{GOVERNOR}", {f"{CPU}/cpu1/{GOVERNOR}": "schedutil"}),
    Case("idle states", ADVICE, "realtime: {wakeful: true}", DEEP, SLEEPY),
    Case("idle states", OK, files=DEEP, needs=asking(realtime={"wakeful": False}, rate_hz=100.0)),
    Case("cpu quota", ADVICE, "50 %", {f"{SLICE}/cpu.max": "50000 100000"}),
    # rights
    Case("scheduling", PROBLEM, f"echo 'ann - rtprio 98' {LIMITS}", answers=rights("priority")),
    Case("memory lock", OK, "no limit"),
    Case("memory lock", PROBLEM, f"echo 'ann - memlock unlimited' {LIMITS}", answers=rights("memory")),
    Case("idle latency", ADVICE, "(then restart)", DEEP, answers=rights("wakeful")),
    Case("timer slack", OK, "1 ns"),
    Case("rate", OK, "hold 4000 Hz here: late p99 50 us", answers=sessions(1e5)),
    Case("rate", OK, "hold 2000 Hz here: late p99 100 us", answers=sessions(2000.0)),
    Case("rate", ADVICE, "rate_hz: 2000", needs=asking(rate_hz=5000.0), answers=sessions(2000.0)),
    Case("rate", OK, "hold 5000 Hz", needs=asking(rate_hz=5000.0), answers=sessions(1e5)),
    Case("rate", ADVICE, "top -H", answers=sessions(1e5, missed=0.011)),
    Case("rate", ADVICE, "at 500 Hz: late p99 600 us", needs=asking(rate_hz=500.0), answers=sessions(100.0)),
    Case("punctuality", OK, answers=rights(p99=200.0)),
    Case("punctuality", ADVICE, "top -H", answers=rights(p99=300.0)),
    Case("punctuality", PROBLEM, answers=rights(p99=1200.0)),
    Case("punctuality", PROBLEM, needs=asking(rate_hz=4000.0), answers=rights(p99=300.0)),
    # host
    Case("host", OK, needs=SLEEPY, answers=awake(missed=0.03)),  # the share is that of the setting in use
    Case("host", ADVICE, "3.00 %", answers=awake(missed=0.03)),
    Case("wakeful", OK, "no clear difference"),
    Case("wakeful", ADVICE, "in the file: realtime: {wakeful: false}", answers=awake(steal=0.03)),
    # memory
    Case("swap", ADVICE, "2048 MB", SWAP, asking(realtime={"lock_memory": False})),
    Case("huge pages", ADVICE, f"echo madvise | sudo tee /{HUGE}", {HUGE: "[always] madvise never"}),
    Case("shared memory", PROBLEM, "remount", answers=TIGHT),
    # network
    Case("receive buffer", OK, needs=asking(rate_hz=1000.0)),
    Case("receive buffer", ADVICE, f"={int(2 * 0.1 * 4000 * CHARGED_BYTES)}", needs=asking(rate_hz=4000.0)),
    Case("port", OK, needs=LISTENING),
    Case("port", PROBLEM, "UDP port 47000 is in use", SOCKETS, LISTENING, {"bind": failing(EADDRINUSE)}),
    Case("slave address", PROBLEM, "link.slave: ROBOT:PORT", needs=CALLING, answers=at("2001:db8::5")),
    Case("slave address", PROBLEM, "not known", needs=CALLING, answers={"resolve": failing(-2, socket.gaierror)}),
    Case("slave address", OK, "robot is this host", needs=CALLING, answers=at("127.0.0.1") | has("ping")),
    Case("firewall", UNKNOWN, "sudo iptables -S INPUT | grep -w -e DROP", needs=LISTENING, answers=has("iptables")),
    # software
    Case("Python", OK, "Python 3."),
    Case("Python", PROBLEM, "release build", answers={"python": lambda: BUILD | {"is_debug": True}}),
    Case("build", OK, "WEBERLINK_PURE=1", answers={"is_compiled": lambda: True}),
    Case("build", OK, "make compiled", answers={"is_compiled": lambda: False}),
    Case("uvloop", PROBLEM, " uvloop", answers={"version": lambda _package: None}),
    # devices
    Case("driver", OK, "ready", needs=NAMED, answers=driver("master", "paddle", READY)),
    Case("driver", PROBLEM, INSTALL, needs=NAMED, answers=driver("master", "paddle", NO_RULES, INSTALL)),
    Case("device", ADVICE, "do this", answers=driver("master", "lever", NO_RULES, "do this")),
]


@pytest.mark.parametrize("case", CASES, ids=lambda case: f"{case.check}-{case.grade}")
def test_check_on_emulated_machine_gives_grade_and_fix(case: Case, tmp_path: Path) -> None:
    found = look(case.check, machine(tmp_path, case.files, **case.answers), case.needs)
    assert found.grade is case.grade, found
    assert case.words in f"{found.found} {found.fix}"
    assert found.fix is not None if found.grade in (ADVICE, PROBLEM) else found.grade is UNKNOWN or found.fix is None


def test_key_file_problems_come_with_fixes_and_no_key(tmp_path: Path) -> None:
    good, missing, public = (tmp_path / name for name in ("key", "missing", "public key"))
    generate(good)
    generate(public)
    public.chmod(0o640)
    for path, grade, fix in (
        (None, OK, ""),
        (good, OK, ""),
        (missing, PROBLEM, f"weberlink keygen {missing}"),
        (public, PROBLEM, f"chmod 600 '{public}'"),
        (tmp_path, PROBLEM, f"weberlink keygen {tmp_path}.new"),
    ):
        finding = look("key file", Machine(), asking("x.yaml", link={"security": "psk", "key_file": path}))
        assert (finding.grade, fix in (finding.fix or "")) == (grade, True)
        assert good.read_text().split()[1] not in repr(finding)


def test_failed_trial_is_reported_once_and_unknown(tmp_path: Path) -> None:
    trials = {"rights_trial": lambda **_: RightsTrial(failure="no processes")}
    trials["host_trial"] = lambda **_: HostTrial(failure="not permitted")
    trials["session_trial"] = lambda **_: SessionTrial(failure="no port")
    report = examine(Needs(), machine(tmp_path, **trials), [row for row in CHECKS if row.area in ("rights", "host")])
    assert [(each.check, each.grade, each.found) for each in report.findings] == [
        ("rights", UNKNOWN, "rights: no processes"),
        ("rate", UNKNOWN, "rate: no port"),
        ("host", UNKNOWN, "host: its share of missed ticks: not permitted"),
    ]
