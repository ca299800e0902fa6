"""The process that takes the force off: when it writes, when it does not, and what is refused without it.

Live: the guardian is a process, and its messages come through a pseudo terminal. A lease is a least time; nothing here
measures how soon after it a message comes.
"""

import os
import signal
import subprocess
import sys
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from select import select
from socket import AF_UNIX, SOCK_DGRAM, send_fds, socket, socketpair
from struct import pack
from time import monotonic, monotonic_ns, sleep
from types import SimpleNamespace
from typing import Any

import pytest

from conftest import may_use_fifo
from tests.confined import NAMESPACE, control_group, namespaces
from tests.hardware.helpers import descriptors
from tests.program import ROOT
from tests.wait import PATIENCE, until
from weberlink.child_process import isolated_python
from weberlink.hardware import guardian_process
from weberlink.hardware.fault import BadReply, HardwareFault
from weberlink.hardware.guardian import IN_A_CONTAINER, LEASE_S, SHARED, SILENT_S, Guardian
from weberlink.hardware.guardian_process import (
    BEATS,
    HEAD,
    HELLO,
    LEASE,
    MEMORY_SIZE,
    OTHER_CLOCK,
    SLOT,
    SLOT_SIZE,
    WORDS_SIZE,
    WRITES,
    get_message,
    put_message,
    watch,
)
from weberlink.hardware.serial_port import SerialPort

ZERO, FORCE, OTHER_ZERO, HERE = b"zero\n", b"force\n", b"nothing\n", b"here\n"
TAKE_OFF = ("-P", "-m", guardian_process.__name__, "zero")
"""Arguments of Python in `ExecStopPost=` of the unit, before its runtime directory."""
LONG_S = 60.0
"""A command of this age is still good, and its lease twice as long: this machine may stall."""
WHILE_S = 0.12


@dataclass
class Wire:
    """A port with a guardian, and the device's end of it."""

    guardian: Any
    port: SerialPort
    near: int

    def heard(self, wait: float = 0.0, *, size: int = 1) -> bytes:
        """What comes within a time; with a size, at least so much, for the kernel hands it over in parts."""
        came = b""
        while len(came) < size and select((self.near,), (), (), wait)[0]:
            came += os.read(self.near, 1000)
        return came

    def push(self, stale: float = LONG_S) -> None:
        self.guardian.given(monotonic(), stale)
        self.port.write(FORCE)

    def signal_guardian(self, number: signal.Signals) -> None:
        assert self.guardian.pid is not None
        os.kill(self.guardian.pid, number)

    def until_told(self, use: Callable[[], None]) -> None:
        """Use it until the death of its guardian is told."""

        def is_told() -> bool:
            self.heard()
            try:
                use()
            except HardwareFault as fault:
                return "guardian process died" in str(fault)
            return False

        until(is_told, "the news of its death", pause=0.005)


@contextmanager
def guarded(guardian: Guardian) -> Iterator[Wire]:
    before = descriptors()
    near, far = os.openpty()
    tty.setraw(far)
    wire = Wire(guardian, SerialPort(os.ttyname(far), guardian=guardian), near)
    yield wire
    wire.port.close()
    assert guardian.pid is None
    os.close(near)
    os.close(far)
    assert descriptors() == before


@dataclass
class Service:
    process: subprocess.Popen[str]
    folder: Path

    @property
    def socket(self) -> Path:
        return self.folder / "socket"

    @property
    def leases(self) -> list[Path]:
        return sorted(self.folder.glob("*.lease"))


@contextmanager
def serving(folder: Path) -> Iterator[Service]:
    """A service with its runtime directory, as a unit of systemd has it."""
    with socket(AF_UNIX, SOCK_DGRAM) as manager:
        manager.bind(str(folder / "notify"))
        manager.settimeout(PATIENCE)
        command = (sys.executable, "-m", "weberlink", "guardian", str(folder / "socket"))
        told = {"RUNTIME_DIRECTORY": str(folder), "NOTIFY_SOCKET": str(folder / "notify")}
        with subprocess.Popen(command, env={**os.environ, **told}, text=True, stderr=subprocess.PIPE) as process:
            try:
                assert manager.recv(100) == b"READY=1"
                yield Service(process, folder)
            finally:
                process.terminate()


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    with serving(tmp_path_factory.mktemp("guardian")) as service:
        yield service


@pytest.fixture(params=["its own", "the service"])
def guardian_of_the_host(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch, service: Service) -> str:
    monkeypatch.setenv("WEBERLINK_GUARDIAN", str(service.socket) if request.param == "the service" else "")
    return str(request.param)


@pytest.fixture
def wire(guardian_of_the_host: str) -> Iterator[Wire]:
    with guarded(Guardian(ZERO, (OTHER_ZERO,))) as wire:
        yield wire


def test_unrenewed_force_is_taken_off_again_and_again(wire: Wire) -> None:
    began = monotonic()
    wire.push(LEASE_S / 2.0)
    assert wire.heard(PATIENCE, size=len(FORCE + ZERO)).startswith(FORCE + ZERO)
    assert monotonic() - began >= LEASE_S
    assert wire.heard(PATIENCE).startswith(ZERO), "again"
    assert wire.guardian.new_writes()
    wire.port.write(ZERO)
    sleep(WHILE_S)
    wire.heard()
    assert wire.heard(WHILE_S) == b"", "a parent that is back is left alone"
    wire.push(LEASE_S / 2.0)
    assert wire.heard(PATIENCE, size=len(FORCE + ZERO)).startswith(FORCE + ZERO), "and watched again"


def test_nothing_is_written_while_the_lease_lasts_nor_where_there_is_no_force(wire: Wire) -> None:
    assert wire.heard(WHILE_S) == b""
    for rest in (b"", ZERO, OTHER_ZERO):
        wire.push()
        if rest:
            wire.port.write(rest)
            wire.guardian.given(monotonic() - 2.0 * LONG_S, LONG_S)
        assert wire.heard(PATIENCE, size=len(FORCE + rest)) == FORCE + rest
        assert wire.heard(WHILE_S) == b""
        assert not wire.guardian.new_writes()


@pytest.mark.parametrize(("stale", "lasts"), [(0.01, LEASE_S), (LONG_S, 2.0 * LONG_S)])
def test_a_lease_is_twice_the_age_of_a_stale_command_and_no_shorter_than_the_least(
    wire: Wire, stale: float, lasts: float
) -> None:
    given_at = monotonic()
    wire.guardian.given(given_at, stale)
    with suppress(BadReply):  # this machine may stall
        wire.guardian.before(FORCE)
    assert wire.guardian._words[LEASE] == pytest.approx(1e9 * (given_at + lasts), abs=1e3)


def test_stale_force_is_not_written(wire: Wire) -> None:
    wire.guardian.given(monotonic() - 0.02, 0.01)
    with pytest.raises(BadReply, match=r"held up for \d+ ms"):
        wire.port.write(FORCE)
    wire.port.write(ZERO)
    assert set(wire.heard(PATIENCE).splitlines(keepends=True)) == {ZERO}, "the guardian may have written its own"


@pytest.mark.parametrize(
    ("number", "says"), [(signal.SIGKILL, "guardian process died"), (signal.SIGSTOP, r"process \d+ has not run")]
)
def test_without_its_guardian_there_is_no_force(wire: Wire, number: signal.Signals, says: str) -> None:
    wire.push()
    process = wire.guardian.pid
    wire.signal_guardian(number)
    gives_up = monotonic() + PATIENCE
    with pytest.raises(HardwareFault, match=says) as caught:
        while monotonic() < gives_up:
            wire.push()
            sleep(0.01)
    assert not isinstance(caught.value, BadReply)
    while wire.heard(WHILE_S):  # the kernel hands over the last force late
        pass
    with suppress(HardwareFault):
        wire.port.write(ZERO)
    assert wire.heard(PATIENCE) == ZERO, "which is written all the same"
    assert process is not None
    with suppress(ProcessLookupError):
        os.kill(process, signal.SIGCONT)  # it ends with its client


def test_a_guardian_that_runs_is_trusted_and_one_that_died_is_told_at_rest_too(wire: Wire) -> None:
    ends = monotonic() + 2.0 * SILENT_S
    while monotonic() < ends:
        with suppress(BadReply):  # this machine may stall
            wire.push(LEASE_S)
        wire.heard()
        sleep(0.005)
    wire.signal_guardian(signal.SIGKILL)
    wire.until_told(lambda: wire.port.write(ZERO))


def test_a_guardian_of_one_device_ignores_signals_to_its_session(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("WEBERLINK_GUARDIAN", "")
    with guarded(Guardian(ZERO)) as wire:
        assert wire.guardian.pid is not None
        assert os.getsid(wire.guardian.pid) != os.getsid(0)
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            wire.signal_guardian(number)
        wire.push(LEASE_S / 2.0)
        until(wire.guardian.new_writes, "the zero")


def test_closing_takes_remaining_force_off(wire: Wire) -> None:
    wire.push()
    wire.port.close()
    heard = b""
    while not heard.endswith(ZERO):
        heard += wire.heard(PATIENCE)
    assert heard.startswith(FORCE + ZERO)
    with pytest.raises(HardwareFault, match="guardian process died"):
        wire.guardian.before(FORCE)
    wire.guardian.before(ZERO)
    assert not wire.guardian.new_writes(), "nobody writes any more"


def test_a_guardian_that_has_written_watches_anew(wire: Wire) -> None:
    wire.push(LEASE_S / 2.0)
    until(wire.guardian.new_writes, "the zero")
    wire.port.close()
    wire.port = SerialPort(wire.port.path, guardian=wire.guardian)
    assert not wire.guardian.new_writes()
    wire.port.write(OTHER_ZERO)


def test_blocked_device_still_gets_the_zero(wire: Wire) -> None:
    wire.push(LEASE_S / 2.0)
    with pytest.raises(HardwareFault, match="takes no more data"):
        while True:
            wire.guardian.given(monotonic(), LONG_S)
            wire.port.write(FORCE * 100)
    wire.guardian.given(monotonic(), LEASE_S / 2.0)
    with pytest.raises(HardwareFault):
        wire.port.write(FORCE)
    until(wire.guardian.new_writes, "the zero")
    assert wire.heard(WHILE_S, size=1_000_000).endswith(ZERO)


# --- however the session ends


PUSHING = """
import sys
from contextlib import suppress
from time import monotonic, sleep
from weberlink.hardware.fault import BadReply
from weberlink.hardware.guardian import Guardian
from weberlink.hardware.serial_port import SerialPort

guardian = Guardian(b"zero\\n")
port = SerialPort(sys.argv[1], guardian=guardian)
while True:
    guardian.given(monotonic(), 0.25)  # a busy machine holds it up for less
    with suppress(BadReply):
        port.write(b"force\\n")
    sleep(0.005)
"""


@contextmanager
def pushing(prefix: tuple[str, ...] = ()) -> Iterator[tuple[subprocess.Popen[str], int]]:
    near, far = os.openpty()
    tty.setraw(far)
    command = (*prefix, sys.executable, "-c", PUSHING, os.ttyname(far))
    with subprocess.Popen(command, cwd=ROOT, stderr=subprocess.PIPE, text=True) as process:
        try:
            yield process, near
        finally:
            process.kill()
            os.close(near)
            os.close(far)


def read_until(near: int, message: bytes) -> None:
    """Read until this is the last that came."""
    heard = b""
    while not heard.endswith(message):
        assert select((near,), (), (), PATIENCE)[0], f"nothing but {heard[-20:]!r}"
        heard = (heard + os.read(near, 1000))[-100:]


@pytest.mark.realtime
@pytest.mark.usefixtures("guardian_of_the_host")
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
def test_force_ends_with_the_process_that_commands_it(number: signal.Signals) -> None:
    with pushing() as (process, near):
        read_until(near, FORCE)
        process.send_signal(number)
        read_until(near, ZERO)


@pytest.mark.realtime
@pytest.mark.usefixtures("guardian_of_the_host")
def test_force_ends_when_the_control_group_of_the_session_is_killed() -> None:
    with control_group() as group:
        if group is None:
            pytest.skip("this user may make no control group")
        with pushing(group.prefix) as (_, near):
            read_until(near, FORCE)
            group.kill()
            read_until(near, ZERO)


@pytest.mark.realtime
def test_in_a_container_the_guardian_of_the_host_alone_counts(
    monkeypatch: pytest.MonkeyPatch, service: Service
) -> None:
    if not namespaces():
        pytest.skip("this user may make no PID namespace")
    monkeypatch.setenv("WEBERLINK_GUARDIAN", "")
    with pushing(NAMESPACE) as (process, _):
        assert process.communicate(timeout=PATIENCE)[1].strip().endswith(IN_A_CONTAINER)
    monkeypatch.setenv("WEBERLINK_GUARDIAN", str(service.socket))
    with pushing(NAMESPACE) as (process, near):
        read_until(near, FORCE)
        process.kill()
        read_until(near, ZERO)


@pytest.mark.realtime
def test_a_guardian_that_must_stay_in_the_control_group_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    if not namespaces():
        pytest.skip("this user may not make /sys read-only for a process")
    monkeypatch.setenv("WEBERLINK_GUARDIAN", "")
    read_only = 'mount -t tmpfs -o ro none /sys/fs/cgroup && exec "$@"'
    with pushing(("unshare", "--mount", "sh", "-c", read_only, "sh")) as (process, near):
        read_until(near, FORCE)
        process.kill()
        assert process.stderr is not None
        assert process.stderr.read() == SHARED
        read_until(near, ZERO)


# --- the service


def test_the_end_of_the_service_takes_the_force_off_and_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with serving(tmp_path) as ending:
        monkeypatch.setenv("WEBERLINK_GUARDIAN", str(ending.socket))
        with guarded(Guardian(ZERO)) as wire:
            wire.push()
            for pid in (wire.guardian.pid, ending.process.pid):
                os.kill(pid, signal.SIGTERM)  # as systemd does with all processes of a unit
            read_until(wire.near, ZERO)
            wire.until_told(lambda: wire.port.write(ZERO))
        assert ending.leases == []
        with pytest.raises(HardwareFault, match=r"does not answer at .*: Connection refused"):
            ending.process.wait()
            Guardian(ZERO).watch(0)


@pytest.mark.realtime
def test_where_all_were_killed_the_end_of_the_unit_writes_the_zero(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("WEBERLINK_GUARDIAN", str(tmp_path / "socket"))
    with serving(tmp_path) as killed, pushing() as (process, near):
        read_until(near, FORCE)
        (lease,) = killed.leases
        guard = int(lease.stem)
        os.kill(guard, signal.SIGSTOP)  # so that it writes nothing while the others end
        read_until(near, FORCE)  # it may have written before, if this machine stalled
        for pid in (process.pid, killed.process.pid, guard):
            os.kill(pid, signal.SIGKILL)
        process.wait()
        left = FORCE
        while select((near,), (), (), WHILE_S)[0]:
            left += os.read(near, 1000)
        assert left.endswith(FORCE), "nobody was left to write a zero"
        strange = pack("<7q", 1, 0, 0, 1 << 40, 0, 0, Path("/dev/null").stat().st_rdev)
        (tmp_path / "0.lease").write_bytes(strange)  # what a client has left in its memory costs nobody else a zero
        done = subprocess.run((sys.executable, *TAKE_OFF, str(tmp_path)), check=True, capture_output=True, text=True)
        read_until(near, ZERO)
        assert "takes the force off" in done.stderr
        assert killed.leases == []


def test_who_has_another_clock_or_says_nothing_of_use_is_left_and_the_service_goes_on(service: Service) -> None:
    """Another clock as in a time namespace: its leases would never end, or never begin."""
    assert service.socket.stat().st_mode & 0o777 == 0o660, "for user and group alone"
    others = [(HELLO.pack(monotonic_ns() + ahead), [0], OTHER_CLOCK) for ahead in (-(10**10), 10**9)]
    for said, files, answer in (*others, (b"", [], b""), (b"x", [], b""), (b"x" * HELLO.size, [], b"")):
        with socket(AF_UNIX) as client:
            client.connect(str(service.socket))
            send_fds(client, [said], files)
            client.settimeout(PATIENCE)
            assert client.recv(1000) == answer
    assert service.process.poll() is None


def test_a_second_service_does_not_take_the_place_of_the_first(service: Service) -> None:
    command = isolated_python(guardian_process.__file__, "serve", str(service.socket))
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=PATIENCE)
    assert (done.returncode, "serves there already" in done.stderr) == (1, True)


def test_a_message_that_just_has_room_is_kept_and_a_longer_one_refused(wire: Wire) -> None:
    most = b"x" * (SLOT_SIZE - HEAD.size)
    wire.guardian.keep(most)
    with pytest.raises(ValueError, match="too long"):
        wire.guardian.keep(most + b"x")
    wire.push(LEASE_S / 2.0)
    assert wire.heard(PATIENCE, size=len(FORCE + most)).startswith(FORCE + most)


def test_a_message_that_is_seen_in_part_is_not_written() -> None:
    """As where a processor reorders stores: the message before it counts, and nothing where there is none."""
    memory = memoryview(bytearray(MEMORY_SIZE))
    for whole in (b"", ZERO):
        put_message(memory, FORCE)
        slot = memory.cast("q")[SLOT]
        memory[WORDS_SIZE + slot * SLOT_SIZE + HEAD.size] ^= 1
        assert get_message(memory) == whole
        put_message(memory, ZERO)


# --- the loop of the process, in virtual time

MS = 1_000_000


class Loop:
    """The loop with a clock that goes on while it polls; deeds of the parent come at their time [ms]."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, deeds: dict[int, int], goodbye: bytes) -> None:
        self.now, self.deeds, self.writes, self.beats = MS, deeds, list[int](), list[int]()
        self.memory = memoryview(bytearray(MEMORY_SIZE))
        self.words = self.memory.cast("q")
        self.words[BEATS] = 1
        put_message(self.memory, OTHER_ZERO)
        put_message(self.memory, ZERO)
        monkeypatch.setattr(guardian_process, "monotonic_ns", lambda: self.now)
        monkeypatch.setattr(guardian_process, "select", SimpleNamespace(poll=lambda: self, POLLIN=1))
        monkeypatch.setattr(guardian_process, "write", self._write)
        monkeypatch.setattr(guardian_process, "sleep", lambda _: None)
        reading, writing = os.pipe()
        os.write(writing, goodbye)
        os.close(writing)
        watch(self.memory, reading, -1)
        os.close(reading)

    def register(self, *socket: int) -> None: ...

    def poll(self, wait_ms: float) -> bool:
        self.beats.append(self.words[BEATS])
        due = min(self.deeds)
        self.now = min(self.now + round(wait_ms * MS), due * MS)
        if self.now < due * MS:
            return False
        self.words[LEASE] = self.deeds.pop(due) * MS
        return not self.deeds

    def _write(self, device: int, message: bytes) -> None:
        assert message == ZERO
        self.writes.append(self.now // MS)


@pytest.mark.parametrize(("goodbye", "ends", "last"), [(b"x", 0, 0), (b"x", 9000, 2), (b"", 0, 2)])
def test_a_lease_that_expires_is_met_at_once_ten_times_and_then_slowly(
    monkeypatch: pytest.MonkeyPatch, goodbye: bytes, ends: int, last: int
) -> None:
    loop = Loop(monkeypatch, {100: 150, 2500: 2551, 3000: 0, 5000: ends}, goodbye)
    met = [*range(150, 331, 20), 1330, 2330, *range(2551, 2732, 20)]
    assert (loop.writes, loop.words[WRITES]) == (met + [5000] * last, len(met))
    assert loop.beats == list(range(2, len(loop.beats) + 2))
    assert len(loop.beats) >= (5000 - 1) // 20, "every 20 ms at the longest"


@pytest.mark.parametrize("first", [BlockingIOError(), 2])
def test_what_the_device_has_not_taken_makes_room_for_the_message(monkeypatch: pytest.MonkeyPatch, first: Any) -> None:
    done, outcomes = list[Any](), [first, len(ZERO)]

    def write(device: int, message: bytes) -> int:
        done.append((device, message))
        outcome = outcomes.pop(0)
        if isinstance(outcome, Exception):
            raise outcome
        return int(outcome)

    flush = SimpleNamespace(error=OSError, TCOFLUSH=1, tcflush=lambda device, _: done.append(device))
    monkeypatch.setattr(guardian_process, "os", SimpleNamespace(write=write))
    monkeypatch.setattr(guardian_process, "termios", flush)
    guardian_process.write(5, ZERO)
    assert done == [(5, ZERO), 5, (5, ZERO)]


def test_what_is_said_of_the_zero_before_the_device_is_guarded_counts() -> None:
    guardian = Guardian(OTHER_ZERO)
    guardian.zero, guardian.rests = ZERO, (HERE,)
    with guarded(guardian):
        guardian.given(monotonic() - 9.0, 0.01)
        for rest in (ZERO, HERE):
            guardian.before(rest)
        for force in (FORCE, OTHER_ZERO):
            with pytest.raises(BadReply, match="held up"):
                guardian.before(force)


@pytest.mark.parametrize(
    ("stale", "gap", "silent"), [(0.2, 0.1, 0.1), (0.01, 0.04, 0.04), (0.01, 0.06, 0.0), (0.2, 0.3, 0.0)]
)
def test_a_guardian_is_silent_only_while_this_process_looks(stale: float, gap: float, silent: float) -> None:
    """Looks farther apart than a command may be old: this process was held up, and the guardian may have been too."""
    guardian = Guardian(ZERO)
    guardian._connection, other_end = socketpair()
    with guardian._connection, other_end:
        guardian._connection.setblocking(False)
        guardian.given(0.0, stale)
        assert guardian._silent(100.0) == 0.0
        assert guardian._silent(100.0 + gap) == pytest.approx(silent)


GO_FIRST = """
import os
from weberlink.hardware.guardian_process import _go_first
for policy, priority in ((os.SCHED_FIFO, 20), (os.SCHED_RR, 30), (os.SCHED_FIFO, 99), (os.SCHED_OTHER, 0)):
    os.sched_setscheduler(0, policy, os.sched_param(priority))
    _go_first()
    print(os.sched_getscheduler(0) == os.SCHED_FIFO, os.sched_getparam(0).sched_priority, os.nice(0))
"""


@pytest.mark.skipif(os.geteuid() != 0 or not may_use_fifo(), reason="needs root and the right to SCHED_FIFO")
def test_it_goes_before_its_client() -> None:
    told = subprocess.run([sys.executable, "-c", GO_FIRST], capture_output=True, text=True, check=True, cwd=ROOT).stdout
    assert [line.rpartition(" ")[0] for line in told.splitlines()] == ["True 21", "True 31", "True 99", "True 1"]
