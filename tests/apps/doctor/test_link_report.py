"""The report of doctor --link: one line for each thing that is wrong, and lines that can be copied."""

import io
import json
from dataclasses import asdict
from pathlib import Path

import pytest
from rich.console import Console

from tests.apps.doctor.links import MeasuredLink
from tests.system.systems import CONFIGS
from weberlink.anywhere.nat import ANY, Behaviour, Nat
from weberlink.anywhere.stun import WayOut
from weberlink.apps.doctor import DoctorReport, Grade
from weberlink.apps.doctor.link_figures import LinkTrial
from weberlink.apps.doctor.link_report import judge, judge_way_out, stun_servers, towards
from weberlink.apps.doctor.link_trial import received
from weberlink.protocol.aio.hand_over import PathFacts
from weberlink.protocol.emulation import Emulation
from weberlink.system.configuration import MASTER, load

LOOPBACK, ANYWHERE = CONFIGS / "loopback.yaml", CONFIGS / "anywhere.yaml"
SERVER = ("203.0.113.1", 3478)
INDEPENDENT, BOTH = frozenset({Behaviour.INDEPENDENT}), frozenset({Behaviour.ADDRESS_AND_PORT})


def measured(faults: Emulation, *paths: PathFacts) -> LinkTrial:
    """A trial in virtual time, as it comes from its process."""
    link = MeasuredLink(faults, faults, seconds=2.0).run()
    return received(**json.loads(json.dumps(asdict(link.measurement.result(paths, "in real time: yes")))))


def report(
    trial: LinkTrial, way_out: WayOut | None = None, file: Path = LOOPBACK, overrides: tuple[str, ...] = ()
) -> DoctorReport:
    return judge(load(file, overrides, [MASTER]), way_out, trial)


def shown(found: DoctorReport) -> list[str]:
    stream = io.StringIO()
    found.show(Console(file=stream, width=80))
    return stream.getvalue().splitlines()


def test_report_fits_a_terminal_and_lines_can_be_copied() -> None:
    faults = Emulation(delay_s=0.02, jitter_s=0.005, loss=0.45, burst=3.0)
    path = PathFacts(route="relayed", via="lab", interface="wifi", remote="a:1", dscp=0)
    found = report(measured(faults, path), overrides=("control.scheme=none", "link.playout_ms=5"))
    text = shown(found)
    assert max(map(len, text)) <= 80
    lines = [line.strip() for line in text if "->" in line]
    assert {"-> --set control.scheme=bounded", "-> --set link.playout_ms=0"} <= set(lines)
    assert any(line.startswith("-> --set link.silence_ms=") for line in lines)
    assert any("relayed by lab over wifi" in line for line in text)
    assert "class of service 0; the file asks for 46" in " ".join(" ".join(text).split())


def test_json_has_figures_nat_and_paths() -> None:
    found = report(measured(Emulation(delay_s=0.01), PathFacts(remote="a:1")), MAPPED, ANYWHERE)
    document = json.loads(json.dumps(found.document, allow_nan=False))
    assert document["nat"]["mapping"] == ["address-and-port-dependent"]
    assert document["nat"]["needs_relay"] is True
    assert document["link"]["rtt_ms"]["p50"] == pytest.approx(21.0, abs=2.0)
    assert document["paths"][0]["route"] == "direct"


@pytest.mark.parametrize("trial", [LinkTrial(failure="no path to robot: UDP is blocked"), LinkTrial()])
def test_failed_measurement_is_one_problem(trial: LinkTrial) -> None:
    found = report(trial)
    assert found.count(Grade.PROBLEM) == 1
    assert found.document["link"] is None


MAPPED = WayOut(Nat(SERVER, ("198.51.100.7", 20_000), True, BOTH, BOTH))
UNCLEAR = WayOut(Nat(SERVER, ("198.51.100.7", 20_000), True, ANY, ANY))
REACHED = WayOut(Nat(SERVER, ("198.51.100.7", 20_000), True, INDEPENDENT, INDEPENDENT))
OUTSIDE = WayOut(Nat(SERVER, ("198.51.100.7", 20_000), False, INDEPENDENT, INDEPENDENT))
BLOCKED = WayOut(None, by_tcp=("relay.example:3478",))


@pytest.mark.parametrize(
    ("way_out", "overrides", "grade", "words", "fix"),
    [
        (OUTSIDE, (), Grade.OK, "no NAT: this host is 198.51.100.7:20000 outside too", None),
        (REACHED, (), Grade.OK, "peers can reach it without a relay", None),
        (MAPPED, (), Grade.OK, "reached by a relay only", None),  # the file has one
        (MAPPED, ("link.turn=null",), Grade.ADVICE, "reached by a relay only", "link.turn"),
        (UNCLEAR, (), Grade.UNKNOWN, "a server with two addresses would tell more", "docs/relay.md"),
        (BLOCKED, (), Grade.PROBLEM, "UDP is blocked between here and relay.example:3478, which", "another network"),
        (WayOut(None), (), Grade.PROBLEM, "relay.example:3478 answers neither by UDP nor by TCP", "systemctl"),
        (WayOut(None, unresolved=("a.b",)), (), Grade.PROBLEM, "a.b cannot be resolved", "link.stun"),
    ],
)
def test_way_out_is_judged(
    way_out: WayOut, overrides: tuple[str, ...], grade: Grade, words: str, fix: str | None
) -> None:
    first, *others = judge_way_out(way_out, load(ANYWHERE, overrides, [MASTER]).system.link)
    assert first.grade is grade
    assert words in first.found
    assert first.fix is None if fix is None else fix in (first.fix or "")
    assert [(each.check, each.grade) for each in others] == [("filtering", Grade.OK)] * (way_out.nat is not None)


def test_servers_of_the_file_are_asked() -> None:
    assert stun_servers(load(LOOPBACK, (), [MASTER]).system.link) == []
    assert set(stun_servers(load(ANYWHERE, (), [MASTER]).system.link)) == {"relay.example:3478"}


@pytest.mark.parametrize(
    ("file", "peer", "added"),
    [
        (ANYWHERE, "robot", "link.peer=robot"),
        (LOOPBACK, "robot.example", "link.slave=robot.example:0"),
        (LOOPBACK, "robot.example:5", "link.slave=robot.example:5"),
        (LOOPBACK, "[::1]:5", "link.slave=[::1]:5"),
        (LOOPBACK, "::1", "link.slave=[::1]:0"),
    ],
)
def test_peer_is_a_label_or_an_address(file: Path, peer: str, added: str) -> None:
    assert towards(peer, load(file, (), [MASTER]).system.link, ["a=b"]) == ["a=b", added]


def test_blocked_udp_is_not_said_twice() -> None:
    trial = LinkTrial(failure="no path to robot: UDP is blocked between here and relay.example:3478")
    found = report(trial, BLOCKED, ANYWHERE)
    assert found.count(Grade.PROBLEM) == 1
    assert found.document["failure"] == trial.failure
