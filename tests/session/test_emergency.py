"""The emergency stop: whom it reaches, what it needs, how long it goes on, and what it does not stop."""

import json
import os
import socket
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Timer
from time import monotonic, sleep
from typing import Any, cast

import pytest

from tests.session.test_control_socket import ORDERED_AT, Unchanging, daemon
from tests.strangers import as_stranger, needs_root
from tests.wait import PATIENCE, until
from weberlink.order import EMERGENCY
from weberlink.session.control_socket import LONGEST_ANSWER, ControlSocket, ask, control_sockets, path_beside, reserved
from weberlink.session.daemon import Stopped
from weberlink.session.emergency import FIND_S, NO_SESSION, REPEAT_S, EmergencyStop, Scope

FIRST, SECOND = "7", "8"
SIDES = ("master", "slave")
LONG = b" " * LONGEST_ANSWER + b"1"


def ring_of(folder: Path, session: str, side: str = "master") -> Path:
    return folder / f"weberlink-{session}-{side}.ring"


@contextmanager
def stopping(folder: Path, name: str | None = None, at: float = ORDERED_AT) -> Iterator[EmergencyStop]:
    stop = EmergencyStop(Scope(str(folder)), name, at)
    yield stop
    stop.close()


def finish(stop: EmergencyStop) -> dict[str, Any]:
    until(lambda: stop.advance(monotonic()), "every side to acknowledge")
    return stop.answer()


@pytest.mark.parametrize(
    ("name", "stopped"), [(FIRST, {FIRST}), (None, {FIRST, SECOND}), ("6", {FIRST, SECOND}), (SECOND, {SECOND})]
)
def test_a_stop_ends_the_named_session_or_all_if_it_does_not_run(
    tmp_path: Path, name: str | None, stopped: set[str]
) -> None:
    with ExitStack() as stack, stopping(tmp_path, name) as stop:
        sides = {
            (session, side): stack.enter_context(daemon(ring_of(tmp_path, session, side)))
            for session in (FIRST, SECOND)
            for side in SIDES
        }
        assert finish(stop) == {"accepted": True, "sessions": sorted(stopped)}
        for (session, _), side in sides.items():
            assert bool(side.stops) is (session in stopped), "at both ends"


def test_a_daemon_is_reached_when_its_directory_was_emptied(tmp_path: Path) -> None:
    folder, name = tmp_path / "u", str(os.getpid())  # a path of a socket has 107 bytes
    folder.mkdir()
    ring = ring_of(folder, name)
    with reserved(ring) as (listener, held), stopping(folder) as stop, daemon(ring, listener=listener.dup()) as side:
        for path in folder.iterdir():
            path.unlink()
        folder.rmdir()
        assert ask(ring, {}, PATIENCE)["settings"]
        assert finish(stop) == {"accepted": True, "sessions": [name]}
    os.close(held)
    assert set(side.stops) == {"emergency"}


def squat_sockets(folder: Path, names: list[str], ready: int, over: int) -> None:
    held = []
    for number in range(50):
        (folder / str(number)).mkdir()
        for name in names:
            held.append(socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM))
            held[-1].bind(str(folder / str(number) / name))
    os.write(ready, b"x")
    os.read(over, 1)


@needs_root
def test_sockets_that_another_user_calls_so_are_not_asked(tmp_path: Path) -> None:
    names = [f"weberlink-{session}-slave.ask" for session in (os.getpid(), FIRST)]
    (is_ready, ready), (over, end) = os.pipe(), os.pipe()
    with TemporaryDirectory() as folder, daemon(ring_of(tmp_path, FIRST)), ThreadPoolExecutor() as pool:
        Path(folder).chmod(0o1777)
        squatted = pool.submit(as_stranger, squat_sockets, Path(folder), names, ready, over)
        os.read(is_ready, 1)
        found = control_sockets()
        os.write(end, b"x")
        squatted.result()
    for each in (is_ready, ready, over, end):
        os.close(each)
    assert path_beside(ring_of(tmp_path, FIRST)) in found
    assert not [path for path in found if path.is_relative_to(folder)]


def test_a_stop_is_repeated_until_it_is_acknowledged_or_the_side_has_ended(tmp_path: Path) -> None:
    path, unreadable = path_beside(ring_of(tmp_path, FIRST)), "its answer cannot be read: "
    answers = [(b"", "does not answer"), (b'{"accepted": false, "why": "not yet"}', "not yet"), (b"", "not yet")]
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as side, stopping(tmp_path) as stop:
        side.bind(str(path))
        side.setblocking(False)
        for number, (answer, why) in enumerate((*answers, (b"[", unreadable), (LONG, unreadable), (b"7", "7"))):
            now = ORDERED_AT + number * REPEAT_S
            assert not stop.advance(now)
            request, asker = side.recvfrom(100)
            assert json.loads(request) == {"emergency": ORDERED_AT}
            if answer:
                side.sendto(answer, asker)
            assert not stop.advance(now + 0.9 * REPEAT_S)
            with pytest.raises(BlockingIOError):
                side.recv(100)
            told = stop.answer()
            assert (told["accepted"], told["why"].startswith(f"{FIRST}-master: {why}")) == (False, True)
        side.close()
        assert finish(stop) == {"accepted": True, "sessions": [FIRST]}


@pytest.mark.parametrize("at", [ORDERED_AT - 1.0, ORDERED_AT])
def test_a_run_that_was_ordered_after_the_stop_goes_on(tmp_path: Path, at: float) -> None:
    with daemon(ring_of(tmp_path, FIRST)) as side, stopping(tmp_path, at=at) as stop:
        answer = finish(stop)
    if at < ORDERED_AT:
        assert (side.stops, answer) == ([], {"accepted": False, "why": NO_SESSION})
    else:
        assert (set(side.stops), answer["accepted"]) == ({"emergency"}, True)


def test_a_side_that_appears_while_a_stop_is_armed_is_stopped_too(tmp_path: Path) -> None:
    path = path_beside(ring_of(tmp_path, FIRST))
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as silent, stopping(tmp_path) as stop:
        silent.bind(str(path))
        assert not stop.advance(monotonic())
        with daemon(ring_of(tmp_path, SECOND)) as side:
            until(lambda: stop.advance(monotonic()) or side.stops, "the side that began", patience=PATIENCE + FIND_S)
            assert "7-master" in stop.answer()["why"]


@contextmanager
def opening(ring: Path, side: Any) -> Iterator[None]:
    """Open the device of a daemon, in this thread."""
    with reserved(ring) as (listener, held):
        control = ControlSocket(listener.dup(), cast(Any, side), None, ORDERED_AT)
        try:
            with control.opening(Stopped):
                yield
        finally:
            control.close()
            os.close(held)


@pytest.mark.parametrize(
    ("request_", "outcome"), [({"emergency": ORDERED_AT}, EMERGENCY), ({"stop": "not today"}, "not today")]
)
def test_a_stop_ends_a_daemon_that_waits_for_its_device(tmp_path: Path, request_: dict[str, Any], outcome: str) -> None:
    ring, side, answers = ring_of(tmp_path, FIRST), Unchanging(), []
    asking = Timer(0.05, lambda: answers.extend([ask(ring, {"weber": 0.2}), ask(ring, request_, PATIENCE)]))
    with pytest.raises(Stopped, match=f"^{outcome}$"), opening(ring, side):
        asking.start()
        sleep(PATIENCE)
    asking.join()
    assert [(each["accepted"], "opened" in each.get("why", "")) for each in answers] == [(False, True), (True, False)]
    assert side.stops == [], "its device is not open"


def test_a_stop_that_came_before_the_daemon_could_read_it_counts(tmp_path: Path) -> None:
    ring = ring_of(tmp_path, FIRST)
    with reserved(ring) as (listener, held), stopping(tmp_path) as stop:
        assert not stop.advance(monotonic())
        control = ControlSocket(listener.dup(), cast(Any, Unchanging()), None, ORDERED_AT)
        with pytest.raises(Stopped, match=EMERGENCY), control.opening(Stopped):
            raise AssertionError("its device is opened")
        assert finish(stop)["accepted"]
        control.close()
        os.close(held)


@pytest.mark.parametrize(
    ("scope", "holds"),
    [
        (Scope(), True),
        (Scope(session=FIRST), False),
        (Scope(parent=os.getppid()), True),
        (Scope(parent=1), False),
        (Scope(folder="/elsewhere"), False),
    ],
)
def test_a_scope_is_of_a_folder_a_session_or_the_children_of_a_process(
    tmp_path: Path, scope: Scope, holds: bool
) -> None:
    assert scope.holds(path_beside(ring_of(tmp_path, str(os.getpid())))) is holds
