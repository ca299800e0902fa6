"""Buffers, ports and addresses, made up and, where that is possible, real."""

import os
import socket
from errno import EADDRINUSE, EADDRNOTAVAIL, ENETUNREACH
from pathlib import Path

import pytest

from tests.apps.doctor.machine import look, machine, only
from weberlink.apps.doctor import Finding, Grade, Host, Needs
from weberlink.apps.doctor.examination import guarded
from weberlink.apps.doctor.host import Unreadable
from weberlink.apps.doctor.network import CHARGED_BYTES, port, receive_buffer, slave_address

LISTENING = Needs(listen=("0.0.0.0", 47000))
CALLING = Needs(slave=("robot", 47000))
# Port 47000 is B798; the tenth column is the inode.
SOCKETS = (
    "  sl  local_address ...\n 12: 00000000:B798 00000000:0000 07 00000000:00000000 00:00000000 00000000 0 0 4242 2\n"
)


def busy(_host: str, _port: int) -> None:
    raise OSError(EADDRINUSE, os.strerror(EADDRINUSE))


def held_by(command: str, tmp_path: Path) -> Finding:
    host = machine(tmp_path, {"proc/net/udp": SOCKETS, "proc/77/cmdline": command.replace(" ", "\0")}, bind=busy)
    (tmp_path / "proc/77/fd").mkdir()
    (tmp_path / "proc/77/fd/5").symlink_to("socket:[4242]")
    return only(port, host, LISTENING)


def test_the_buffer_must_hold_what_arrives_within_the_silence_limit(tmp_path: Path) -> None:
    host = machine(tmp_path)
    assert only(receive_buffer, host, Needs(rate_hz=1000.0)).grade is Grade.OK
    small = only(receive_buffer, host, Needs(rate_hz=4000.0))
    assert small.grade is Grade.ADVICE
    wanted = int((small.fix or "").rpartition("=")[2])
    enlarged = machine(tmp_path, {"proc/sys/net/core/rmem_default": str(wanted)})
    assert only(receive_buffer, enlarged, Needs(rate_hz=4000.0)).grade is Grade.OK


def test_the_kernel_charges_a_datagram_no_less_than_is_assumed() -> None:
    """Measured: how many datagrams of an update's size a socket holds before it loses one."""
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


def test_a_free_port_is_fine_and_so_is_none(tmp_path: Path) -> None:
    assert only(port, machine(tmp_path), LISTENING).grade is Grade.OK
    assert only(port, machine(tmp_path)).grade is Grade.OK


def test_a_port_that_somebody_has_is_a_problem_that_names_them(tmp_path: Path) -> None:
    found = held_by("/usr/bin/netcat -u -l 47000", tmp_path)
    assert found.grade is Grade.PROBLEM
    assert "/usr/bin/netcat" in found.found
    assert found.fix == "see who has it: sudo ss -lunp 'sport = :47000'"


def test_a_session_that_runs_has_its_port_by_right(tmp_path: Path) -> None:
    assert held_by("python3 -m weberlink.daemon {}", tmp_path).grade is Grade.OK


def test_a_holder_that_this_user_may_not_see_is_a_problem_all_the_same(tmp_path: Path) -> None:
    found = only(port, machine(tmp_path, {"proc/net/udp": SOCKETS}, bind=busy), LISTENING)
    assert (found.grade, found.found) == (Grade.PROBLEM, "UDP port 47000 is in use")


def test_an_address_that_is_not_of_this_host_is_a_problem(tmp_path: Path) -> None:
    def foreign(_host: str, _port: int) -> None:
        raise OSError(EADDRNOTAVAIL, os.strerror(EADDRNOTAVAIL))

    found = only(port, machine(tmp_path, bind=foreign), Needs(listen=("10.9.9.9", 47000)))
    assert found.grade is Grade.PROBLEM
    assert "10.9.9.9:47000 cannot be listened on" in found.found


def test_real_ports_are_seen_free_and_taken() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        address = taken.getsockname()
        found = only(port, Host(), Needs(listen=address))
        assert found.grade is Grade.PROBLEM
        assert f"UDP port {address[1]} is in use" in found.found
    assert only(port, Host(), Needs(listen=address)).grade is Grade.OK


@pytest.mark.parametrize("address", ["192.0.2.1", "198.51.100.7", "203.0.113.9", "2001:db8::5"])
def test_an_address_of_an_example_is_a_problem(tmp_path: Path, address: str) -> None:
    found = only(slave_address, machine(tmp_path, resolve=lambda _name: [address]), CALLING)
    assert found.grade is Grade.PROBLEM
    assert "link.slave: ROBOT:PORT" in (found.fix or "")


def test_a_name_that_nobody_knows_and_an_address_without_a_way_are_problems(tmp_path: Path) -> None:
    def nobody(_name: str) -> list[str]:
        raise socket.gaierror(socket.EAI_NONAME, "Name or service not known")

    def nowhere(_address: str) -> str:
        raise OSError(ENETUNREACH, os.strerror(ENETUNREACH))

    unresolved = only(slave_address, machine(tmp_path, resolve=nobody), CALLING)
    assert unresolved.grade is Grade.PROBLEM
    assert "Name or service not known" in unresolved.found
    unreachable = only(slave_address, machine(tmp_path, route=nowhere), CALLING)
    assert (unreachable.grade, unreachable.fix) == (Grade.PROBLEM, "ip route get 10.1.2.3")


@pytest.mark.parametrize(("status", "grade"), [(0, Grade.OK), (1, Grade.UNKNOWN)])
def test_a_host_that_answers_no_ping_is_not_known_to_be_away(tmp_path: Path, status: int, grade: Grade) -> None:
    asked: list[tuple[str, ...]] = []

    def run(*command: str) -> tuple[int, str]:
        asked.append(command)
        return status, ""

    host = machine(tmp_path, which=lambda name: f"/bin/{name}", run=run)
    assert only(slave_address, host, CALLING).grade is grade
    assert asked == [("ping", "-n", "-c", "1", "-W", "1", "10.1.2.3")]


def test_this_host_is_not_asked(tmp_path: Path) -> None:
    host = machine(tmp_path, resolve=lambda _name: ["127.0.0.1"], which=lambda name: f"/bin/{name}")
    assert only(slave_address, host, Needs(slave=("localhost", 47000))).found == "localhost is this host"


def test_a_name_service_that_does_not_answer_is_unknown(tmp_path: Path) -> None:
    def silent(_name: str) -> list[str]:
        raise Unreadable("the name service does not answer within 3 s")

    host = machine(tmp_path, resolve=silent)
    (found,) = guarded(slave_address, host, CALLING)
    assert found.grade is Grade.UNKNOWN


def test_the_real_look_up_and_the_real_route_know_this_host() -> None:
    (found,) = look(slave_address, Host(), Needs(slave=("localhost", 47000)))
    assert found == Finding("slave address", Grade.OK, "localhost is this host")
