"""Keys with rights, in running programs: who may drive, watch and stop, and what a removed key means."""

import os
from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path
from time import monotonic

import numpy as np
import pytest

from tests.program import ENGAGED, PATIENT, Program, document, free_port, weberlink
from tests.wait import until
from weberlink.cli.output import CommandError
from weberlink.cli.remote import ask
from weberlink.config import load
from weberlink.protocol.endpoint import WITHDRAWN
from weberlink.protocol.keys import HeldKey, Right, generate, load as load_keys
from weberlink.session.key_watch import LOOK_S, KeyWatch

SYSTEM = """
link: {listen: 127.0.0.1:PORT, slave: 127.0.0.1:PORT, security: psk, key_file: drive, names: {slave: arm}}
master: {device: {driver: operator}}
slave: {robot: {driver: point}, scene: [{shape: plane, stiffness_n_m: 500}]}
"""


@pytest.fixture
def system(tmp_path: Path) -> Path:
    """The file of all hosts, beside the key of each, and `book`, the keys of the robot's host."""
    for right in Right:
        generate(tmp_path / right, right, f"{right}@desk")
    book = tmp_path / "book"
    book.touch(0o600)
    book.write_text("".join((tmp_path / right).read_text() for right in Right))
    path = tmp_path / "system.yaml"
    path.write_text(SYSTEM.replace("PORT", str(free_port())))
    return path


def with_key(system: Path, right: str) -> tuple[object, ...]:
    return system, "--set", f"link.key_file={system.parent / right}", *PATIENT


@pytest.mark.realtime
def test_a_watcher_cannot_drive_a_stopper_cannot_watch_and_a_removed_key_ends_its_session(system: Path) -> None:
    watch, stop = with_key(system, "watch"), with_key(system, "stop")
    with Program("slave", *with_key(system, "book"), "--json", "-") as slave:
        robot = slave.telemetry("slave")
        until(lambda: len(robot.records), "the robot's end")
        status, output, _ = weberlink("remote", *watch, "--json", "-")
        assert (status, document(output)["state"], document(output)["serves"]) == (0, "listening", "")
        for arguments, right, asked in (
            (("master", *watch), "watch", "drive"),
            (("remote", "--stop", *watch), "watch", "stop"),
            (("remote", *stop), "stop", "watch"),
        ):
            status, *said = weberlink(*arguments)
            why = f"slave 'arm': the key of '{right}@desk' is to {right}, and it asks to {asked}"
            assert status == 1 and why in " ".join("".join(said).split())
        assert not (robot.records["state"] == ENGAGED).any()
        with Program("master", *with_key(system, "drive"), "--json", "-") as master:
            until(lambda: robot.last["state"] == ENGAGED, "the session")
            told = document(weberlink("remote", *watch, "--json", "-").output)
            assert (told["state"], told["serves"], told["fault"]) == ("engaged", "drive@desk", "none")
            book = system.parent / "book"
            book.write_text("".join((system.parent / right).read_text() for right in ("watch", "stop")))
            began = monotonic()
            until(lambda: robot.last["state"] != ENGAGED, "the end of the session")
            records = robot.records  # once: another look shows more of them
            records = records[records["at"] > began]
            pauses = np.diff(records["at"][: int(np.argmax(records["state"] != ENGAGED)) + 1], prepend=began)
            assert pauses[pauses < 0.02].sum() < 1.0, "without those in which this machine stood still"
            status, output, _ = master.finish()
            assert status == 1 and WITHDRAWN in document(output)["outcome"]
        status, output, _ = weberlink("remote", "--stop", *stop, "--json", "-")
        assert (status, document(output)) == (0, {"name": "arm", "stopped": True})
        status, output, _ = slave.finish()
    assert status == 1 and "emergency stop by stop@desk" in document(output)["outcome"]


def test_who_is_not_answered_is_told_to_stop_the_robot_by_hand(system: Path) -> None:
    loaded = load(system, [f"link.key_file={system.parent / 'stop'}"])
    with pytest.raises(CommandError, match=r"did not answer in 0\.2 s; it may not have stopped: stop it by hand"):
        ask(loaded, Right.STOP, 0.2)


def test_the_file_of_a_caller_holds_one_key(system: Path) -> None:
    status, _, errors = weberlink("remote", *with_key(system, "book"))
    assert status == 2 and "holds several keys, which is for the robot's end" in errors


def test_a_key_is_used_under_its_own_name(system: Path) -> None:
    status, _, errors = weberlink("remote", *with_key(system, "stop"), "--set", "link.names.master=ann")
    assert status == 2 and "link.names.master: the key is that of 'stop@desk'" in errors


class Loop:
    """Runs at once what a loop would run in a thread, and keeps what it would run later."""

    def __init__(self) -> None:
        self.later: list[Callable[[], None]] = []

    def run_in_executor(self, _executor: None, work: Callable[[], object]) -> Future[object]:
        done: Future[object] = Future()
        done.set_result(work())
        return done

    def call_later(self, delay: float, work: Callable[[], None]) -> None:
        assert delay == LOOK_S
        self.later.append(work)

    def look(self) -> None:
        self.later.pop()()


class Watched:
    """Keyring and endpoint at once: what was held, at each check."""

    def __init__(self) -> None:
        self.held: list[HeldKey] = []
        self.checks = 0

    def replace(self, keys: list[HeldKey]) -> None:
        self.held = list(keys)

    def check_keys(self, _now: float) -> None:
        self.checks += 1


def test_keys_are_read_when_their_file_changes_and_gone_when_it_cannot_be_read_twice(system: Path) -> None:
    assert 3 * LOOK_S < 1.0
    book, seen, loop = system.parent / "book", Watched(), Loop()
    watch = KeyWatch(book, lambda: load_keys(book), seen, seen)  # type: ignore[arg-type]
    watch.open(loop)  # type: ignore[arg-type]
    assert len(seen.held) == 3 and seen.checks == 1
    loop.look()
    assert seen.checks == 1, "nothing has changed"
    text = book.read_text()
    book.write_text(text.replace(" watch ", " stop "))
    loop.look()
    assert [key.right for key in seen.held] == ["drive", "stop", "stop"] and seen.checks == 2
    for broken in (lambda: book.chmod(0o644), lambda: os.replace(book, book.with_suffix(".away"))):  # noqa: PTH105
        broken()
        loop.look()
        assert len(seen.held) == 3, "an editor may be writing it"
        loop.look()
        assert seen.held == []
        book.touch(0o600)
        book.chmod(0o600)
        book.write_text(text)
        loop.look()
        assert len(seen.held) == 3
    watch.close()
    loop.look()
    assert not loop.later
