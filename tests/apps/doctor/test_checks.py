"""Checks of kernel, clocks, processors, memory, network, key and software on emulated machines."""

import gzip
import os
import socket
from collections.abc import Mapping
from dataclasses import dataclass, field
from errno import EADDRINUSE, EADDRNOTAVAIL, ENETUNREACH
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.apps.doctor.machines import CLOCK, CPU, graded, look, machine
from weberlink.apps.devices import NO_EXTRA, NO_RULES, NOTHING, READY, UNSEEN, DriverStatus
from weberlink.apps.doctor import Finding, Grade, Machine, Needs
from weberlink.apps.doctor.findings import Check
from weberlink.apps.doctor.kernel import clock_source, preemption, throttling, timers, wall_clock
from weberlink.apps.doctor.machine import Unreadable
from weberlink.apps.doctor.network import CHARGED_BYTES, firewall, key_file, port, receive_buffer, slave_address
from weberlink.apps.doctor.processors import cpu_list, cpu_quota, governor, idle_states, isolation, processors
from weberlink.apps.doctor.rights import huge_pages, shared_memory, swap
from weberlink.apps.doctor.software import extras, judge_build, judge_drivers, optional, python, uvloop
from weberlink.hardware.discovery import PluggedDevice
from weberlink.protocol.keys import generate
from weberlink.telemetry.ring import SLOT_BYTES

OK, ADVICE, PROBLEM, UNKNOWN = Grade.OK, Grade.ADVICE, Grade.PROBLEM, Grade.UNKNOWN
DYNAMIC = "Linux version 6.1.0-21-amd64 (debian-kernel@lists.debian.org) #1 SMP PREEMPT_DYNAMIC Debian 6.1.90-1"
NOT_RT = {"sys/kernel/realtime": None, "proc/version": DYNAMIC}
DEBUG = "sys/kernel/debug/sched/preempt"
CONFIG = "boot/config-6.1.0-21-rt-amd64"
OLD = NOT_RT | {"proc/version": "Linux version 5.10.0 (x) #1 SMP Debian", CONFIG: "CONFIG_PREEMPT_NONE=y\n"}
RUNTIME = "proc/sys/kernel/sched_rt_runtime_us"
DEEP = {
    f"{CPU}/cpu0/cpuidle/state2/name": "C6",
    f"{CPU}/cpu0/cpuidle/state2/latency": "133",
    f"{CPU}/cpu0/cpuidle/state2/disable": "0",
}
GOVERNOR = "cpufreq/scaling_governor"
SLICE = "sys/fs/cgroup/user.slice"
SWAP = {"proc/swaps": "Filename\tType\tSize\tUsed\tPriority\n/dev/sda2  partition\t2000000\t0\t-2\n"}
HUGE = "sys/kernel/mm/transparent_hugepage/enabled"
RING = 10 * 1000 * SLOT_BYTES
TIGHT = {"space": lambda _path: (64_000_000, int(1.5 * RING))}
LISTENING = Needs(listen=("0.0.0.0", 47000))
CALLING = Needs(slave=("robot", 47000))
# Port 47000 is B798; the tenth column is the inode.
SOCKETS = {"proc/net/udp": "sl local\n 12: 00000000:B798 00000000:0000 07 0:0 00:0 00000000 0 0 4242 2\n"}


def failing(number: int, kind: type[OSError] = OSError) -> Any:
    def fail(*_: object) -> Any:
        raise kind(number, os.strerror(number) if kind is OSError else "Name or service not known")

    return fail


def at(*addresses: str) -> dict[str, Any]:
    return {"resolve": lambda _name: list(addresses)}


def has(*names: str) -> dict[str, Any]:
    return {"which": lambda name: f"/bin/{name}" if name in names else None}


@dataclass(frozen=True)
class Case:
    """An emulated machine, and the finding expected of one check."""

    check: Check
    grade: Grade
    words: str = ""
    """In what was found or in the fix."""
    files: Mapping[str, str | None] = field(default_factory=dict)
    needs: Needs = Needs()  # noqa: RUF009 - frozen
    answers: Mapping[str, Any] = field(default_factory=dict)


CASES = [
    # kernel
    Case(preemption, OK, "6.1.0-21-rt-amd64"),
    Case(preemption, OK, files={"sys/kernel/realtime": None}),
    Case(preemption, OK, files=NOT_RT | {DEBUG: "none voluntary (full)"}),
    Case(preemption, OK, files=NOT_RT | {DEBUG: "full (lazy)"}),
    Case(preemption, ADVICE, f"echo full | sudo tee /{DEBUG} ", NOT_RT | {DEBUG: "none (voluntary) full"}),
    Case(preemption, ADVICE, f"echo full | sudo tee /{DEBUG} ", NOT_RT | {DEBUG: "(none) voluntary full lazy"}),
    Case(preemption, OK, files=NOT_RT | {"proc/cmdline": "quiet preempt=full"}),
    Case(preemption, ADVICE, "parameter preempt=full, then", NOT_RT | {CONFIG: "CONFIG_PREEMPT_VOLUNTARY=y\n"}),
    Case(preemption, UNKNOWN, f"sudo cat /{DEBUG}", NOT_RT | {CONFIG: None}),
    Case(preemption, ADVICE, "apt install linux-image-rt-amd64", OLD | {"etc/os-release": "ID=debian"}),
    Case(preemption, ADVICE, "sudo pro enable realtime-kernel", OLD | {"etc/os-release": "NAME=x\nID=ubuntu"}),
    Case(preemption, ADVICE, "PREEMPT_RT kernel of this", OLD | {"etc/os-release": "ID=arch"}),
    Case(timers, OK),
    Case(timers, PROBLEM, "4 ms", answers={"resolution_ns": lambda: 4e6}),
    Case(throttling, OK, files={RUNTIME: "-1"}),
    Case(throttling, OK, files={RUNTIME: "950000"}),
    Case(throttling, ADVICE, "sched_rt_runtime_us=950000", {RUNTIME: "100000"}),
    Case(throttling, PROBLEM, "sched_rt_runtime_us=950000", {RUNTIME: "0"}),
    Case(throttling, OK, files={RUNTIME: "0"}, needs=Needs(priority=0)),
    # clocks
    Case(clock_source, OK, files={f"{CLOCK}/current_clocksource": "kvm-clock"}),
    Case(clock_source, PROBLEM, f"echo tsc | sudo tee /{CLOCK}/", {f"{CLOCK}/current_clocksource": "hpet"}),
    Case(
        clock_source,
        PROBLEM,
        "dmesg",
        {f"{CLOCK}/current_clocksource": "hpet", f"{CLOCK}/available_clocksource": "hpet acpi_pm"},
    ),
    Case(wall_clock, OK),
    Case(wall_clock, ADVICE, answers={"clock_is_synchronised": lambda: False}),
    # processors
    Case(processors, PROBLEM, "slave on 7", needs=Needs(cpus=(1, 7))),
    Case(processors, PROBLEM, "two of 0, 1", needs=Needs(cpus=(1, 7))),
    Case(processors, OK, needs=Needs(cpus=(1, 7), sides=("master",))),
    Case(processors, ADVICE, answers={"affinity": lambda: frozenset({0})}),
    Case(processors, OK, needs=Needs(sides=("slave",)), answers={"affinity": lambda: frozenset({0})}),
    Case(processors, ADVICE, needs=Needs(cpus=(1, 1))),
    Case(processors, PROBLEM, "realtime: {busy_poll: false}", needs=Needs(busy_poll=True)),
    Case(processors, OK, needs=Needs(busy_poll=True, sides=("slave",))),
    Case(isolation, ADVICE, "isolcpus=", needs=Needs(busy_poll=True)),
    Case(isolation, OK, files={f"{CPU}/isolated": "2-3"}, needs=Needs(busy_poll=True, cpus=(2, 3))),
    Case(isolation, OK),
    Case(isolation, OK, files={f"{CPU}/isolated": "2-3"}, needs=Needs(cpus=(2, 3))),
    Case(isolation, ADVICE, "in the file: realtime: {cpus: [2, 3]}", {f"{CPU}/isolated": "2-3"}),
    Case(isolation, ADVICE, "isolcpus=2,3, then restart", needs=Needs(cpus=(2, 3))),
    Case(isolation, ADVICE, "isolcpus=2,3", {f"{CPU}/isolated": "2"}, Needs(cpus=(2, 3))),
    Case(governor, OK),
    Case(governor, ADVICE, f"tee /{CPU}/cpu*/{GOVERNOR}", {f"{CPU}/cpu1/{GOVERNOR}": "schedutil"}),
    Case(governor, OK, files={f"{CPU}/cpu0/{GOVERNOR}": None, f"{CPU}/cpu1/{GOVERNOR}": None}),
    Case(idle_states, ADVICE, "realtime: {wakeful: true}", DEEP, Needs(wakeful=False)),
    Case(idle_states, ADVICE, "C6 (133 us)", DEEP, Needs(wakeful=False)),
    Case(idle_states, OK, files=DEEP),
    Case(idle_states, OK, files=DEEP, needs=Needs(wakeful=False, rate_hz=100.0)),
    Case(idle_states, OK, files=DEEP | {f"{CPU}/cpu0/cpuidle/state2/disable": "1"}, needs=Needs(wakeful=False)),
    Case(cpu_quota, OK),
    Case(cpu_quota, OK, files={f"{SLICE}/session-1.scope/cpu.max": "max 100000"}),
    Case(cpu_quota, ADVICE, "50 %", {f"{SLICE}/cpu.max": "50000 100000"}),
    # memory
    Case(swap, OK, needs=Needs(lock_memory=False)),
    Case(swap, OK, files=SWAP),
    Case(swap, ADVICE, "2048 MB", SWAP, Needs(lock_memory=False)),
    Case(huge_pages, OK),
    Case(huge_pages, ADVICE, f"echo madvise | sudo tee /{HUGE}", {HUGE: "[always] madvise never"}),
    Case(shared_memory, PROBLEM, "remount", answers=TIGHT),
    Case(shared_memory, OK, needs=Needs(sides=("slave",)), answers=TIGHT),
    Case(shared_memory, OK, needs=Needs(rate_hz=500.0), answers=TIGHT),
    Case(shared_memory, PROBLEM, "--shm-size", {"run/.containerenv": ""}, answers={"space": lambda _path: (1, 0)}),
    # network
    Case(receive_buffer, OK, needs=Needs(rate_hz=1000.0)),
    Case(receive_buffer, ADVICE, f"={int(2 * 0.1 * 4000 * CHARGED_BYTES)}", needs=Needs(rate_hz=4000.0)),
    Case(port, OK),
    Case(port, OK, needs=LISTENING),
    Case(port, PROBLEM, "UDP port 47000 is in use", SOCKETS, LISTENING, {"bind": failing(EADDRINUSE)}),
    Case(
        port,
        PROBLEM,
        "10.9.9.9:47000 cannot be listened on",
        needs=Needs(listen=("10.9.9.9", 47000)),
        answers={"bind": failing(EADDRNOTAVAIL)},
    ),
    *(
        Case(slave_address, PROBLEM, "link.slave: ROBOT:PORT", needs=CALLING, answers=at(address))
        for address in ("192.0.2.1", "198.51.100.7", "203.0.113.9", "2001:db8::5")
    ),
    Case(slave_address, PROBLEM, "not known", needs=CALLING, answers={"resolve": failing(-2, socket.gaierror)}),
    Case(slave_address, PROBLEM, "ip route get 10.1.2.3", needs=CALLING, answers={"route": failing(ENETUNREACH)}),
    Case(slave_address, OK, "answers a ping", needs=CALLING, answers=has("ping") | {"run": lambda *_: (0, "")}),
    Case(slave_address, UNKNOWN, "ping -c 3", needs=CALLING, answers=has("ping") | {"run": lambda *_: (1, "")}),
    Case(slave_address, OK, "robot is this host", needs=CALLING, answers=at("127.0.0.1") | has("ping")),
    Case(firewall, OK, "nothing listens here"),
    Case(firewall, OK, "loopback", needs=Needs(listen=("127.0.0.1", 47000)), answers=has("nft")),
    Case(firewall, OK, "no firewall tool found", needs=LISTENING),
    *(
        Case(firewall, UNKNOWN, words, needs=LISTENING, answers=has(*installed))
        for installed, words in (
            (("iptables",), "sudo iptables -S INPUT | grep -w -e DROP -e REJECT -e 47000"),
            (("iptables", "nft"), "sudo nft list ruleset | grep -w -e drop -e reject -e 47000"),
            (("nft", "firewall-cmd"), "sudo firewall-cmd --query-port=47000/udp"),
            (("nft", "ufw"), "sudo ufw status | grep -w 47000"),
        )
    ),
    # software
    Case(python, OK, "Python 3."),
    Case(uvloop, OK),
    Case(extras, OK),
]


@pytest.mark.parametrize("case", CASES, ids=lambda case: f"{case.check.__name__}-{case.grade}")
def test_check_on_emulated_machine_gives_grade_and_fix(case: Case, tmp_path: Path) -> None:
    (found,) = look(case.check, machine(tmp_path, case.files, **case.answers), case.needs)
    assert found.grade is case.grade, found
    assert case.words in f"{found.found} {found.fix}"
    assert (found.fix is None) == (case.grade is OK)


def test_kernel_options_may_be_compressed_in_proc(tmp_path: Path) -> None:
    host = machine(tmp_path, NOT_RT | {CONFIG: None})
    (tmp_path / "proc/config.gz").write_bytes(gzip.compress(b"CONFIG_PREEMPT_NONE=y\nCONFIG_HZ=100\n"))
    assert "preemption none" in look(preemption, host)[0].found
    assert "100 Hz" in look(timers, host)[0].found


@given(st.sets(st.integers(0, 300)))
def test_cpu_list_parses_kernel_notation(numbers: set[int]) -> None:
    runs: list[list[int]] = []
    for number in sorted(numbers):
        if runs and runs[-1][-1] == number - 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    text = ",".join(f"{run[0]}-{run[-1]}" if len(run) > 1 else str(run[0]) for run in runs)
    assert cpu_list(text) == cpu_list(f"{text}\n") == numbers


@pytest.mark.parametrize("text", ["", "x", "1-", "-3"])
def test_malformed_cpu_list_is_empty(text: str) -> None:
    assert cpu_list(text) == frozenset()


def test_cgroup_version_1_has_quota_and_budget(tmp_path: Path) -> None:
    group = "sys/fs/cgroup/cpu/box"
    files = {
        "proc/self/cgroup": "3:cpuacct:/\n1:cpu:/box\n0::/\n",
        f"{group}/cpu.cfs_quota_us": "150000",
        f"{group}/cpu.cfs_period_us": "100000",
        f"{group}/cpu.rt_runtime_us": "0",
    }
    findings = look(cpu_quota, machine(tmp_path, files))
    assert graded(findings) == {"cpu quota": "advice", "real-time group": "problem"}
    assert "150 %" in findings[0].found
    assert f"/{group}/cpu.rt_runtime_us" in (findings[1].fix or "")
    assert graded(look(cpu_quota, machine(tmp_path, files), Needs(priority=0))) == {"cpu quota": "advice"}
    files |= {f"{group}/cpu.cfs_quota_us": "-1", f"{group}/cpu.rt_runtime_us": "950000"}
    assert graded(look(cpu_quota, machine(tmp_path, files))) == {"cpu quota": "ok"}


def test_missing_shared_memory_is_a_problem(tmp_path: Path) -> None:
    host = machine(tmp_path)
    (tmp_path / "dev/shm/.keep").unlink()
    (tmp_path / "dev/shm").rmdir()
    assert graded(look(shared_memory, host)) == {"shared memory": "problem"}


def test_kernel_charges_about_the_assumed_bytes() -> None:
    """Counts how many datagrams of an update's size a socket holds before it loses one."""
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender,
    ):
        receiver.bind(("127.0.0.1", 0))
        receiver.setblocking(False)
        size = receiver.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF)
        for _ in range(2 * size // 256):
            sender.sendto(bytes(48), receiver.getsockname())
        held = 0
        while True:
            try:
                receiver.recv(64)
            except BlockingIOError:
                break
            held += 1
    assert 0.5 * CHARGED_BYTES < size / held < 4.0 * CHARGED_BYTES


@pytest.mark.parametrize(
    ("command", "grade", "words"),
    [
        ("/usr/bin/netcat -u -l 47000", PROBLEM, "in use by /usr/bin/netcat"),
        ("python3 -m weberlink.system.daemon {}", OK, "running weberlink daemon"),
    ],
)
def test_holder_of_the_port_is_named(command: str, grade: Grade, words: str, tmp_path: Path) -> None:
    files = {**SOCKETS, "proc/77/cmdline": command.replace(" ", "\0")}
    host = machine(tmp_path, files, bind=failing(EADDRINUSE))
    (tmp_path / "proc/77/fd").mkdir()
    (tmp_path / "proc/77/fd/5").symlink_to("socket:[4242]")
    (found,) = look(port, host, LISTENING)
    assert found.grade is grade
    assert words in found.found


def test_real_port_and_route_are_checked() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        needs = Needs(listen=taken.getsockname())
        assert graded(look(port, Machine(), needs)) == {"port": "problem"}
    assert graded(look(port, Machine(), needs)) == {"port": "ok"}
    (found,) = look(slave_address, Machine(), Needs(slave=("localhost", 47000)))
    assert found == Finding("slave address", OK, "localhost is this host")


def test_silent_name_service_is_unknown(tmp_path: Path) -> None:
    def silent(_name: str) -> list[str]:
        raise Unreadable("the name service does not answer within 3 s")

    assert graded(look(slave_address, machine(tmp_path, resolve=silent), CALLING)) == {"slave address": "unknown"}


def test_key_file_problems_come_with_fixes_and_no_key(tmp_path: Path) -> None:
    good, missing, public, empty = (tmp_path / name for name in ("key", "missing", "public key", "empty"))
    generate(good)
    generate(public)
    public.chmod(0o640)
    empty.touch(0o600)
    (tmp_path / "link").symlink_to(good)

    def found(path: Path | None, here: Machine | None = None) -> Finding:
        (finding,) = look(key_file, here or Machine(), Needs(file=Path("x.yaml"), key_file=path))
        if path is not None and path.is_file() and path != empty:
            assert path.read_text().split()[1] not in repr(finding)
        return finding

    assert found(None).grade is OK
    assert found(good).grade is OK
    stranger = machine(tmp_path, user=good.stat().st_uid + 12345)
    for finding, fix in (
        (found(missing), f"weberlink keygen {missing} "),
        (found(public), f"chmod 600 '{public}'"),
        (found(empty), "expected one line"),
        (found(tmp_path / "link"), f"link.key_file: {good}"),
        (found(good, stranger), "sudo chown"),
        (found(tmp_path), ""),
    ):
        assert finding.grade is PROBLEM
        assert fix in (finding.fix or "")


@pytest.mark.parametrize(
    ("flags", "grade"), [((), OK), (("debug",), PROBLEM), (("free_threaded",), ADVICE), (("dev_mode",), ADVICE)]
)
def test_slow_or_untested_python_builds_are_reported(flags: tuple[str, ...], grade: Grade) -> None:
    kinds = {f"is_{name}": name in flags for name in ("debug", "free_threaded", "dev_mode")}
    assert judge_build("3.14.0", **kinds).grade is grade


def test_extras_are_those_for_users() -> None:
    assert "dev" not in optional()
    assert optional()["recording"] == ["mcap", "zstandard"]


PADDLE = PluggedDevice("/dev/ttyACM0", "Paddle")
NAMED = Needs(drivers=(("master", "paddle"), ("slave", "point")))
LATENCY = "/dev/ttyUSB0 delays replies by 16 ms (latency timer): echo 1 | sudo tee x"
INSTALL = "sudo weberlink device rules"


@pytest.mark.parametrize(
    ("side", "driver", "state", "advice", "needs", "expected"),
    [
        ("master", "paddle", READY, (), NAMED, (OK, None)),
        ("master", "paddle", NOTHING, (), NAMED, (PROBLEM, "plug it in and switch it on, then: weberlink device list")),
        ("master", "paddle", UNSEEN, (), NAMED, (OK, None)),
        ("master", "paddle", NO_RULES, (INSTALL,), NAMED, (PROBLEM, INSTALL)),
        ("master", "paddle", READY, (LATENCY,), NAMED, (ADVICE, LATENCY)),
        ("slave", "point", NO_EXTRA, ("pip install x",), NAMED, (PROBLEM, "pip install x")),
        ("master", "lever", NO_RULES, ("do this",), Needs(), (ADVICE, "do this")),
        ("slave", "arm", NOTHING, (), Needs(), (OK, None)),
        ("slave", "paddle", NOTHING, (), NAMED, (OK, None)),  # the same name on the other side
    ],
)
def test_driver_of_the_file_must_be_ready(
    side: str, driver: str, state: str, advice: tuple[str, ...], needs: Needs, expected: tuple[Grade, str | None]
) -> None:
    plugged = () if state in (NOTHING, UNSEEN, NO_EXTRA) else (PADDLE,)
    status = DriverStatus(side, driver, None, "hardware", None, state, plugged, advice)
    first = next(judge_drivers([status], needs))
    assert (first.grade, first.fix) == expected
