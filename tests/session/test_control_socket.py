"""The control socket of a daemon, and the description beside its ring: what is asked, by whom, and what is believed."""

import json
import socket
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, cast

import pytest

from tests.session.systems import configuration
from tests.strangers import as_stranger, ask_socket, needs_root, squat_fifo, squat_file, squat_large
from tests.wait import PATIENCE, loop_in_a_thread
from weberlink.config import MASTER, SLAVE
from weberlink.config.model import DirectionFaults
from weberlink.protocol.emulation import EmulatedLink
from weberlink.session import description
from weberlink.session.control_socket import IS_STOPPED, ControlSocket, ask, path_beside
from weberlink.session.daemon import STOP_SLACK_S, LiveLink, stop_limit_s
from weberlink.session.launcher import STOP_LIMIT_S
from weberlink.session.tuning import LiveSettings, Tuning
from weberlink.telemetry.runtime_directory import listening_socket

ORDERED_AT = 1000.0  # when the run of these daemons was ordered [s]


class Unchanging:
    """A side that has settings, takes no others, and notes how it was stopped."""

    def __init__(self) -> None:
        self.tuning = Tuning(LiveSettings(0.1, "zoh"), {}, lambda *_: None)
        self.stops: list[str] = []

    def stop(self, now: float, reason: str) -> None:
        self.stops.append(reason)

    def emergency(self, now: float) -> None:
        self.stops.append("emergency")

    def propose(self, change: Mapping[str, object], now: float) -> str | None:
        return self.tuning.complaint(change)


@contextmanager
def daemon(ring: Path, link: LiveLink | None = None, listener: socket.socket | None = None) -> Iterator[Unchanging]:
    side = Unchanging()
    control = ControlSocket(listener or listening_socket(path_beside(ring)), cast(Any, side), link, ORDERED_AT)
    try:
        with loop_in_a_thread() as loop:
            loop.call_soon_threadsafe(control.open, loop)
            yield side
    finally:
        control.close()


@pytest.mark.parametrize("question", [b"[" * 1024, b"[" * 5000, b"{" * 1024, b'{"weber": NaN}', b"\xff" * 9, b""])
def test_no_question_ends_a_daemon(tmp_path: Path, question: bytes) -> None:
    ring = tmp_path / "x.ring"
    with daemon(ring), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as asker:
        asker.bind("")
        asker.settimeout(PATIENCE)
        asker.sendto(question, str(path_beside(ring)))
        told = json.loads(asker.recv(5000))
        assert (told["accepted"], told["why"]) == (False, "a question is a JSON object")
        assert ask(ring, {}, PATIENCE)["settings"] == {"weber": 0.1, "predictor": "zoh"}


@pytest.mark.parametrize("question", [b"[]", b"{}", b'{"weber": 0.2}'])
def test_a_question_without_an_address_is_not_answered(tmp_path: Path, question: bytes) -> None:
    path = path_beside(tmp_path / "x.ring")
    control = ControlSocket(listening_socket(path), cast(Any, Unchanging()), None, ORDERED_AT)
    with closing(control), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as asker:
        asker.sendto(question, str(path))
        control._on_questions()


FILE = {"delay_ms": 1.0, "jitter_ms": 0.0, "loss": 0.1}  # of the emulated link, beside a burst of 3
REQUESTS: list[tuple[dict[str, Any], bool, list[str] | None]] = [
    ({"stop": "the page was closed"}, True, ["the page was closed"]),
    ({"stop": "x" * 100}, True, ["x" * 100]),
    ({"stop": "x" * 101}, False, []),
    ({"stop": ""}, False, []),
    ({"stop": "a\nb"}, False, []),
    ({"stop": "enough", "weber": 0.2}, False, []),
    ({"emergency": ORDERED_AT}, True, ["emergency"]),
    ({"emergency": ORDERED_AT + 1, "weber": 0.2}, True, ["emergency"]),
    ({"emergency": ORDERED_AT - 1e-6}, False, []),
    ({"emergency": True}, False, []),
    ({"emergency": "now"}, False, []),
    ({"weber": 0.2}, False, []),
    ({"delay_ms": 20}, True, None),
    ({"jitter_ms": 10_000}, True, None),
    ({"jitter_ms": 10_001}, False, None),
    ({"delay_ms": -1}, False, None),
    ({"loss": True}, False, None),
    ({"loss": 0.75}, True, None),
    ({"loss": 0.76}, False, None),
    ({"loss": 0.1, "burst": 2}, False, None),
    ({"loss": 0.1, "weber": 0.2}, False, None),
]
"""What is asked, whether it is done, and how the side is stopped by it; None for requests to the link."""


@pytest.mark.parametrize(("request_", "accepted", "stops"), REQUESTS)
def test_a_request_is_done_or_refused_with_a_reason(
    tmp_path: Path, request_: dict[str, Any], accepted: bool, stops: list[str] | None
) -> None:
    faults = DirectionFaults(**FILE, burst=3)
    link = None if stops is not None else LiveLink(faults, EmulatedLink(faults.emulation(), lambda: 0.5, 0.0))
    with daemon(tmp_path / "x.ring", link) as side:
        answer = ask(tmp_path / "x.ring", request_, PATIENCE)
        assert (answer["accepted"], side.stops) == (accepted, stops or [])
        assert answer["link"] == (None if link is None else FILE | (request_ if accepted else {}))
        assert accepted or answer["why"]


@pytest.mark.parametrize("request_", [{"weber": 0.2}, {"delay_ms": 20}, {"stop": "enough"}])
def test_nothing_is_done_after_an_emergency_stop(tmp_path: Path, request_: dict[str, Any]) -> None:
    faults = DirectionFaults()
    with daemon(tmp_path / "x.ring", LiveLink(faults, EmulatedLink(faults.emulation(), lambda: 0.5, 0.0))) as side:
        assert ask(tmp_path / "x.ring", {"emergency": ORDERED_AT}, PATIENCE)["accepted"]
        told = ask(tmp_path / "x.ring", request_, PATIENCE)
        assert (told["accepted"], told["why"], side.stops) == (False, IS_STOPPED, ["emergency"])


@pytest.mark.parametrize("fixed", ["fixed by the file", ""])
def test_a_link_that_is_fixed_or_not_emulated_is_not_changed(tmp_path: Path, fixed: str) -> None:
    faults = DirectionFaults()
    link = LiveLink(faults, EmulatedLink(faults.emulation(), lambda: 0.5, 0.0), fixed) if fixed else None
    with daemon(tmp_path / "x.ring", link):
        answer = ask(tmp_path / "x.ring", {"loss": 0.5}, PATIENCE)
        assert not answer["accepted"] and (answer["why"] == fixed or link is None)


@needs_root
def test_another_user_cannot_ask(tmp_path: Path) -> None:
    with TemporaryDirectory() as folder:  # that others may enter
        Path(folder).chmod(0o755)
        ring = Path(folder) / "x.ring"
        with daemon(ring):
            assert as_stranger(ask_socket, path_beside(ring), b"{}") == "refused"


def test_an_answer_of_anybody_else_is_not_heard(tmp_path: Path) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as server, ThreadPoolExecutor() as pool:
        server.bind(str(tmp_path / "x.ask"))
        server.settimeout(PATIENCE)
        asked = pool.submit(ask, tmp_path / "x.ring", {}, PATIENCE)
        _, asker = server.recvfrom(100)
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as other, pytest.raises(PermissionError):
            other.sendto(b'{"accepted": true}', asker)
        server.sendto(b'{"accepted": false}', asker)
        assert asked.result() == {"accepted": False}


@pytest.mark.parametrize("content", [b"[]", b"[" * 5000, b"no JSON", b"{" * 1024, b'{"rate_hz": Infinity}'])
def test_a_description_that_cannot_be_trusted_is_none(tmp_path: Path, content: bytes) -> None:
    path = description.path_beside(tmp_path / "x.ring")
    path.write_bytes(content)
    assert description.read(tmp_path / "x.ring") is None


@needs_root
@pytest.mark.parametrize("attack", [squat_file, squat_fifo, squat_large])
def test_a_description_of_another_user_costs_nothing(attack: Callable[[Path], None]) -> None:
    with TemporaryDirectory() as folder:
        Path(folder).chmod(0o1777)
        as_stranger(attack, Path(folder) / "x.json")
        assert description.read(Path(folder) / "x.ring") is None


@pytest.mark.parametrize("ramp_ms", [0.1, 50.0, 999.0, 2500.0, 5000.0])
def test_a_stop_may_last_as_long_as_its_fade_and_ends_before_the_launcher_kills(ramp_ms: float) -> None:
    limits = configuration(f"master.limits.ramp_ms={ramp_ms}").system
    assert 1e-3 * ramp_ms < stop_limit_s(limits, MASTER) < STOP_LIMIT_S
    assert stop_limit_s(limits, SLAVE) == STOP_SLACK_S
