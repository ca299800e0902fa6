"""Settings changed in a session: at one tick on both sides, and through the control socket of a daemon."""

import asyncio
import json
import socket
import tracemalloc
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from math import inf
from pathlib import Path
from signal import SIGINT
from tempfile import TemporaryDirectory
from threading import Thread
from time import monotonic
from typing import Any

import numpy as np
import pytest

from tests.compiled import replaces_methods
from tests.program import ENGAGED, Program
from tests.strangers import as_stranger, ask_socket, needs_root, squat_fifo, squat_file, squat_large
from tests.system.systems import Step, decoded, raw, steps, system
from tests.wait import PATIENCE, until
from weberlink.codec import Decoder
from weberlink.codec.deadband import Deadband
from weberlink.control.tuning import LiveSettings, Tuning
from weberlink.geometry.vector import distance
from weberlink.system import description
from weberlink.system.composition.link import build_link
from weberlink.system.configuration.model import DirectionFaults
from weberlink.system.control_socket import LOOK_S, ControlSocket, LiveChangeError, ask, path_beside
from weberlink.system.live_link import LiveLink
from weberlink.system.simulation import Simulation
from weberlink.telemetry.ring import default_path


def changed(simulation: Simulation, change: dict[str, Any], asker: str, seconds: float = 1.0) -> list[Step]:
    """The steps of a system in which one side asks for a change after half a second."""
    before = list(steps(simulation, 0.5))
    side = getattr(simulation, asker)
    assert side.propose(change, 0.5) is None
    return before + list(steps(simulation, seconds))


@pytest.mark.parametrize("asker", ["master", "slave"])
@pytest.mark.parametrize("delay_ms", [0, 60])
def test_both_ends_make_a_change_at_the_tick_that_was_agreed(asker: str, delay_ms: int) -> None:
    simulation = system(f"link.emulate={{delay_ms: {delay_ms}, seed: 3}}", "link.silence_ms=400")
    seen = changed(simulation, {"weber": 0.3}, asker)
    first = [
        next(i for i, step in enumerate(seen) if getattr(step, side).settings == 1) for side in ("master", "slave")
    ]
    verdict = getattr(simulation, asker).tuning.result
    assert verdict.refusal is None
    assert first[("master", "slave").index(asker)] == verdict.tick
    assert abs(first[0] - first[1]) <= 1
    assert simulation.slave.tuning.settings.weber == 0.3


def test_a_larger_weber_factor_widens_the_deadband_from_that_tick_on() -> None:
    simulation = system("slave.scene=[{shape: plane, stiffness_n_m: 500}]", "codec.force.floor_n=0")
    seen = changed(simulation, {"weber": 0.3}, "master", 3.0)
    ratios = [
        (step.slave.settings, step.slave.bound / np.linalg.norm([step.slave.raw_x, step.slave.raw_y, step.slave.raw_z]))
        for step in seen
        if step.slave.state == ENGAGED and not step.slave.ramping and abs(step.slave.raw_z) > 0.2
    ]
    assert {round(ratio, 6) for settings, ratio in ratios if settings == 0} <= {0.1}
    assert {round(ratio, 6) for settings, ratio in ratios if settings == 1} == {0.3}


@replaces_methods
@pytest.mark.parametrize("asker", ["master", "slave"])
def test_smooth_updates_keep_the_law_after_a_smaller_weber_factor(asker: str, monkeypatch: pytest.MonkeyPatch) -> None:
    given: list[float] = []
    retune = Decoder.retune

    def noted(self: Decoder, deadband: Deadband, since: float = -inf) -> None:
        given.append(since)
        retune(self, deadband, since)

    monkeypatch.setattr(Decoder, "retune", noted)
    overrides = (
        "codec.force.smooth_ms=20", "codec.force.predictor=zoh", "codec.force.floor_n=0.002",
        "slave.scene=[{shape: plane, stiffness_n_m: 500}]", "link.emulate={delay_ms: 5}",
    )  # fmt: skip
    seen = changed(system("codec.force.weber=0.3", *overrides), {"weber": 0.02}, asker, 4.0)
    at_master, at_slave = sorted(given, reverse=True)
    after = [step.slave for step in seen if step.slave.settings == 1]
    assert at_slave == -inf, "its mirror, at once"
    assert after[0].tick - 1 <= at_master <= after[0].tick
    engaged = [each for each in after if each.state == ENGAGED]
    assert all(distance(decoded(each), raw(each)) <= each.bound + 1e-3 for each in engaged)
    always = list(steps(system("codec.force.weber=0.02", *overrides), 4.5))[-len(after) :]
    assert sum(each.sent for each in after) < 1.5 * sum(step.slave.sent for step in always)


def test_another_predictor_is_in_use_at_both_ends_from_the_first_send_on() -> None:
    simulation = system()
    seen = changed(simulation, {"predictor": "zoh"}, "slave", 4.0)
    after = [step for step in seen if step.slave.settings == 1]
    assert {step.slave.selected for step in after} == {0}, "the bank's first, at the very tick"
    assert {step.master.selected for step in after[200:]} == {0}
    assert any(step.slave.sent for step in after)


@pytest.mark.parametrize(
    ("overrides", "change", "complaint"),
    [
        (["control.live_changes=false"], {"weber": 0.2}, "control.live_changes is off"),
        (["codec.force.predictor=plane"], {"predictor": "zoh"}, "codec.force.predictor is neither hybrid nor adaptive"),
        ([], {"scheme": "none"}, "unknown setting scheme; known are weber, predictor"),
    ],
)
def test_what_the_file_fixes_stays(overrides: list[str], change: dict[str, Any], complaint: str) -> None:
    simulation = system(*overrides)
    list(steps(simulation, 0.3))
    for side in (simulation.master, simulation.slave):
        assert complaint in (side.propose(change, 0.3) or "")


@pytest.mark.realtime
def test_a_running_daemon_answers_on_its_control_socket() -> None:
    with Program("loopback", "--duration", "30") as program:
        slave, master = program.telemetry("slave"), program.telemetry("master")
        until(lambda: master.last["state"] == ENGAGED, "a session")
        ring = default_path(f"{program.pid}-slave")
        described = description.read(ring)
        assert described is not None
        assert (described["side"], described["changes"]) == ("slave", ["predictor", "weber"])
        assert "key_file" not in described["system"]["link"]
        assert path_beside(ring).stat().st_mode & 0o777 == 0o600
        assert ask(ring, {})["settings"] == {"weber": 0.1, "predictor": "hybrid"}
        answer = ask(ring, {"weber": 0.25}, patience_s=60.0)
        assert answer["accepted"]
        until(lambda: slave.last["settings"] == 1 and master.last["settings"] == 1, "the change on both sides")
        records = slave.records
        assert records["tick"][records["settings"] == 1][0] >= answer["tick"]
        refused = ask(ring, {"weber": 2.0})
        assert (refused["accepted"], refused["generation"]) == (False, 1)
        program.send(SIGINT)
        assert program.finish()[0] == 0
    assert not list(ring.parent.glob(f"weberlink-{program.pid}-*")), "nothing is left behind"


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
def daemon(ring: Path, link: LiveLink | None = None) -> Iterator[Unchanging]:
    """A control socket in a thread, as that of a daemon."""
    loop, side = asyncio.new_event_loop(), Unchanging()
    control = ControlSocket(ring, side, link)
    control.open(loop)
    thread = Thread(target=loop.run_forever)
    thread.start()
    try:
        yield side
    finally:
        loop.call_soon_threadsafe(loop.stop)
        thread.join()
        control.close()
        loop.close()


class Asking(Unchanging):
    """A side whose peer is to agree to a Weber factor."""

    def __init__(self) -> None:
        super().__init__()
        self.tuning = Tuning(LiveSettings(0.1, "zoh"), {"weber": ()}, lambda *_: None)
        self.proposed: list[bytes] = []

    def propose(self, change: Mapping[str, object], now: float) -> str | None:
        complaint = self.tuning.complaint(change)
        if complaint is None:
            self.proposed.append(self.tuning.ask(change))
        return complaint

    def hear(self, refusal: str) -> None:
        """The peer answers the newest proposal."""
        self.tuning.settle(0, self.proposed[-1], refusal)


def test_every_request_is_answered_though_the_next_one_comes_at_once(tmp_path: Path) -> None:
    side, refusals = Asking(), [f"refusal {number}" for number in range(5)]
    control = ControlSocket(tmp_path / "x.ring", side)
    with ExitStack() as stack:
        askers = [stack.enter_context(socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)) for _ in refusals]

        async def go() -> None:
            control.open(asyncio.get_running_loop())
            for number, (asker, refusal) in enumerate(zip(askers, refusals, strict=True)):
                asker.bind("")
                asker.sendto(b'{"weber": 0.2}', str(path_beside(tmp_path / "x.ring")))
                while len(side.proposed) <= number:
                    await asyncio.sleep(0)
                side.hear(refusal)
            await asyncio.sleep(5 * LOOK_S)
            control.close()

        asyncio.run(go())
        for asker, refusal in zip(askers, refusals, strict=True):
            asker.setblocking(False)
            assert json.loads(asker.recv(5000))["why"] == refusal
            with pytest.raises(BlockingIOError):
                asker.recv(5000)


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


@pytest.mark.parametrize(
    ("request_", "stops", "complaint"),
    [
        ({"stop": "the page was closed"}, ["the page was closed"], None),
        ({"emergency": True}, ["emergency"], None),
        ({"emergency": True, "weber": 0.2}, ["emergency"], None),
        ({"emergency": False}, [], "emergency must be true, not False"),
        ({"stop": ""}, [], "1 to 100 printable characters"),
        ({"stop": "x" * 101}, [], "1 to 100 printable characters"),
        ({"stop": "a\nb"}, [], "1 to 100 printable characters"),
        ({"stop": True}, [], "1 to 100 printable characters"),
        ({"stop": "enough", "weber": 0.2}, [], "ask for stop alone"),
        ({"delay_ms": 5}, [], "add emulate: {} under link"),
        ({"weber": 0.2}, [], "control.live_changes is off"),
    ],
)
def test_stop_is_done_or_refused_with_a_reason(
    tmp_path: Path, request_: dict[str, Any], stops: list[str], complaint: str | None
) -> None:
    with daemon(tmp_path / "x.ring") as side:
        answer = ask(tmp_path / "x.ring", request_, PATIENCE)
        assert (answer["accepted"], answer["link"], side.stops) == (complaint is None, None, stops)
        assert complaint is None or complaint in answer["why"]


@pytest.mark.parametrize(
    ("request_", "complaint"),
    [
        ({"delay_ms": 20}, None),
        ({"jitter_ms": 2.5, "loss": 0.3}, None),
        ({"delay_ms": -1}, "delay_ms: should be greater than or equal to 0, not -1"),
        ({"jitter_ms": 10_001}, "jitter_ms: should be less than or equal to 10000, not 10001"),
        ({"loss": True}, "loss: should be a number, not True"),
        ({"delay_ms": "5"}, "delay_ms: should be a number, not '5'"),
        ({"loss": 0.9}, "loss must be at most burst / (1 + burst)"),
        ({"loss": 0.1, "burst": 2}, "burst is no setting of the link"),
        ({"loss": 0.1, "weber": 0.2}, "weber is no setting of the link"),
    ],
)
def test_emulated_link_changes_within_the_bounds_of_the_file(
    tmp_path: Path, request_: dict[str, Any], complaint: str | None
) -> None:
    file = {"delay_ms": 1.0, "jitter_ms": 0.0, "loss": 0.1}
    faults = DirectionFaults(**file, burst=3)
    link = LiveLink(faults, build_link(faults, lambda: 0.5, 0.0))
    with daemon(tmp_path / "x.ring", link):
        answer = ask(tmp_path / "x.ring", request_, PATIENCE)
        assert answer["accepted"] == (complaint is None)
        assert answer["link"] == (file | request_ if complaint is None else file)
        assert complaint is None or complaint in answer["why"]


def test_fixed_link_is_not_changed(tmp_path: Path) -> None:
    link = LiveLink(DirectionFaults(), build_link(DirectionFaults(), lambda: 0.5, 0.0), "fixed by the file")
    with daemon(tmp_path / "x.ring", link):
        answer = ask(tmp_path / "x.ring", {"loss": 0.5}, PATIENCE)
        assert (answer["accepted"], answer["why"], answer["link"]["loss"]) == (False, "fixed by the file", 0.0)


@needs_root
def test_another_user_cannot_ask(tmp_path: Path) -> None:
    with TemporaryDirectory() as folder:  # that others may enter
        Path(folder).chmod(0o755)
        ring = Path(folder) / "x.ring"
        with daemon(ring):
            assert as_stranger(ask_socket, path_beside(ring), b"{}") == "refused"


@needs_root
@pytest.mark.parametrize("attack", [squat_file, squat_fifo])
def test_what_another_user_put_in_its_place_is_not_asked(attack: Callable[[Path], None]) -> None:
    with TemporaryDirectory() as folder:
        Path(folder).chmod(0o1777)
        as_stranger(attack, Path(folder) / "x.ask")
        with pytest.raises(LiveChangeError, match="not a socket"):
            ask(Path(folder) / "x.ring", {}, PATIENCE)


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
        began = monotonic()
        assert description.read(Path(folder) / "x.ring") is None
        assert monotonic() - began < 1.0


def test_a_description_that_is_too_large_is_not_read(tmp_path: Path) -> None:
    squat_large(tmp_path / "x.json")
    tracemalloc.start()
    try:
        assert description.read(tmp_path / "x.ring") is None
        assert tracemalloc.get_traced_memory()[1] < 1e6
    finally:
        tracemalloc.stop()
