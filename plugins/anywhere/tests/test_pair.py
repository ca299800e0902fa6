"""`slave --invite` and `master --join` as their users meet them, with a real mailbox."""

import os
import pty
import re
import signal
from io import RawIOBase
from pathlib import Path

import pytest

from plugins.anywhere.tests import FILE
from plugins.anywhere.tests.mailbox_server import MailboxServer
from tests.program import ENGAGED, Program, free_port, weberlink
from tests.wait import until
from weberlink.config import ConfigurationError, load
from weberlink.protocol.endpoint import WITHDRAWN
from weberlink.testing.time import running_time
from weberlink_anywhere.pair import pair
from weberlink_anywhere.peers import Peer, PeerStore

pytest.importorskip("wormhole_mailbox_server")


class Hosts:
    def __init__(self, mailbox: str, folder: Path) -> None:
        self.mailbox, self._folder, self._port = mailbox, folder, free_port()

    def store(self, side: str) -> PeerStore:
        return PeerStore(self._folder / side)

    def command(self, side: str, *arguments: object) -> list[object]:
        settings = (
            f"link.finder.mailbox={self.mailbox}", "link.finder.path=direct",
            f"link.finder.peer_store={self._folder / side}",
            f"link.listen=127.0.0.1:{self._port}", f"link.slave=127.0.0.1:{self._port}",
            f"link.names.{side}={side} of the test", "link.silence_ms=2000",
        )  # fmt: skip
        return [side, FILE, *(part for one in settings for part in ("--set", one)), *arguments]

    def pair(self, side: str, code: str, label: str | None = None) -> str:
        options = [str(part) for part in self.command(side)[2:] if part != "--set"]
        return pair(load(FILE, options, [side]), side, code, label, accept=True)


@pytest.fixture
def hosts(mailbox: MailboxServer, tmp_path: Path) -> Hosts:
    return Hosts(mailbox.url, tmp_path)


def until_line(program: Program, start: str) -> str:
    while not (line := program.next_error()).startswith(start):
        assert line, f"the command ended without {start!r}"
    return line.removeprefix(start).rstrip()


def until_shown(screen: RawIOBase, pattern: str) -> str:
    shown = b""
    while (found := re.search(pattern.encode(), shown)) is None:
        piece = screen.read(1)
        assert piece, shown
        shown += piece
    return found[1].decode()


@pytest.mark.realtime
def test_a_code_joins_two_commands_in_a_session(hosts: Hosts) -> None:
    with Program(*hosts.command("slave", "--invite", "--accept")) as slave:
        code = until_line(slave, "Code: ")
        assert until_line(slave, "  weberlink master ") == f"{FILE} --join"
        with Program(*hosts.command("master", "--join", "--duration", "0.5"), given=f"{code}\n") as master:
            status, _, errors = master.finish()
            words = until_line(slave, "weberlink: both hosts must show ")
            slave.send(signal.SIGINT)
            assert (status, slave.finish()[0]) == (0, 0), errors
    assert f"weberlink: both hosts must show {words}" in errors.splitlines()
    assert "weberlink: paired with slave of the test; no code is needed from now on" in errors
    (at_slave,), (at_master,) = hosts.store("slave"), hosts.store("master")
    assert (at_slave.key, at_slave.name, at_slave.role) == (at_master.key, "master of the test", "master")


@pytest.mark.parametrize("answer", ["y", "n"])
def test_the_person_at_the_robot_compares_two_words(hosts: Hosts, answer: str) -> None:
    user, theirs = pty.openpty()
    with Program(*hosts.command("slave", "--invite"), terminal=theirs) as slave, os.fdopen(user, "r+b", 0) as screen:
        os.close(theirs)
        code = until_shown(screen, r"Code: (\S+)\s")
        screen.write(b"y\nn\n")  # typed before the question: neither counts
        with Program(*hosts.command("master", "--join", "--duration", "0.2"), given=f"{code}\n") as master:
            words = until_shown(screen, r"this one shows: (\w+ \w+)\s")
            assert until_shown(screen, r"(master of the test) asks to drive this robot\. .* \[y/N\]")
            assert list(hosts.store("slave")) == []
            screen.write(f"{answer}\n".encode())
            status, _, errors = master.finish()
        assert f"this one shows: {words}\n" in errors
        if answer == "y":
            assert until_shown(screen, "(paired with master of the test)")
            slave.send(signal.SIGINT)
    assert (status == 0) is (answer == "y"), errors
    assert len(list(hosts.store("slave"))) == len(list(hosts.store("master"))) == (answer == "y")


@pytest.mark.realtime
def test_a_peer_that_may_only_stop_from_now_on_is_not_served_any_more_and_may_stop(hosts: Hosts) -> None:
    for side, other in (("slave", "master"), ("master", "slave")):
        own, name = f"{side} of the test", f"{other} of the test"
        hosts.store(side).add(Peer(other, name, own, other, bytes(32)))  # type: ignore[arg-type]
    hosts.store("slave").add(Peer("new", "new", "slave of the test", "master", bytes(range(32))))
    with Program(*hosts.command("slave", "--json", "-")) as slave:
        with Program(*hosts.command("master", "--json", "-")) as master:
            robot = slave.engaged("slave")
            folder = hosts.store("slave").folder
            assert weberlink("peer", "master", "--right", "stop", "--store", folder).status == 0
            with running_time() as ran:
                until(lambda: robot.last["state"] != ENGAGED, "the end of the session")
            assert ran() < 1.0
            status, output, _ = master.finish()
            assert status == 1 and WITHDRAWN in output
        command = hosts.command("master")
        status, _, errors = weberlink("remote", *command[1:])
        assert status == 1 and "is to stop, and it asks to watch" in errors
        assert weberlink("remote", *command[1:], "--stop").status == 0
        status, output, _ = slave.finish()
    assert status == 1 and "emergency stop by master of the test" in output


@pytest.mark.realtime
def test_the_right_of_a_pairing_is_said_and_kept_at_the_robots_host(hosts: Hosts) -> None:
    with Program(*hosts.command("slave", "--invite", "--accept", "--right", "watch")) as slave:
        code = until_line(slave, "Code: ")
        assert hosts.pair("master", code) == "slave of the test"
        until_line(slave, "weberlink: paired with ")
    assert [peer.right for peer in hosts.store("slave")] == ["watch"]
    ended = weberlink(*hosts.command("slave", "--right", "watch"))
    assert ended.status == 2 and "--right: goes with --invite" in ended.errors


def test_unattended_the_key_is_kept_if_the_command_says_so(hosts: Hosts) -> None:
    ended = weberlink(*hosts.command("slave", "--invite"))
    assert (ended.status, "standard input is no terminal; run it on one, or add --accept" in ended.errors) == (2, True)


def test_the_code_is_no_argument(hosts: Hosts) -> None:
    assert weberlink(*hosts.command("master", "--join", "7-confidence-ribcage")).status == 2
    with Program(*hosts.command("master", "--join")) as master:
        assert master.finish()[::2] == (
            2,
            "weberlink: --join: standard input gave no code; the robot's host shows it\n",
        )


def test_ctrl_c_ends_an_invitation(hosts: Hosts) -> None:
    with Program(*hosts.command("slave", "--invite", "--accept")) as slave:
        until_line(slave, "Code: ")
        children = slave.children()
        slave.send(signal.SIGINT)
        status, _, errors = slave.finish()
    assert (status, errors.splitlines()[-1]) == (130, "weberlink: interrupted; nothing was kept")
    assert children
    assert not any(Path(f"/proc/{pid}").exists() for pid in children)
    assert list(hosts.store("slave")) == []


def test_a_mailbox_that_is_not_there_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=r"--invite: the mailbox ws://127\.0\.0\.1:1/v1 cannot be reached: "):
        Hosts("ws://127.0.0.1:1/v1", tmp_path).pair("slave", "")


@pytest.mark.parametrize(
    ("code", "reason"),
    [
        ("7-confidence-ribcgae", "did you mean ribcage"),
        ("weberlink:7-confidence-ribcage@ws://other.example/v1", "is of the mailbox ws://other.example/v1"),
    ],
)
def test_a_wrong_code_costs_no_guess(hosts: Hosts, code: str, reason: str) -> None:
    with pytest.raises(ConfigurationError, match=f"--join: .*{reason}"):
        hosts.pair("master", code)


@pytest.mark.parametrize(
    ("own", "label", "reason"),
    [
        ("slave of the test", "anna", "--peer: anna is known already"),  # a label that is taken
        ("another name", None, r'anna knows this host as another name, .*slave="another name"'),
    ],
)
def test_a_peer_that_is_known_is_refused_before_the_code(
    hosts: Hosts, own: str, label: str | None, reason: str
) -> None:
    hosts.store("slave").add(Peer("anna", "anna@pc", own, "master", bytes(32)))
    with pytest.raises(ConfigurationError, match=reason):
        hosts.pair("slave", "", label)
