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
SERVER, HERE = ("203.0.113.1", 3478), ("198.51.100.7", 20_000)
INDEPENDENT, BOTH = frozenset({Behaviour.INDEPENDENT}), frozenset({Behaviour.ADDRESS_AND_PORT})
MAPPED, UNCLEAR = WayOut(Nat(SERVER, HERE, True, BOTH, BOTH)), WayOut(Nat(SERVER, HERE, True, ANY, ANY))
REACHED = WayOut(Nat(SERVER, HERE, True, INDEPENDENT, INDEPENDENT))
OUTSIDE = WayOut(Nat(SERVER, HERE, False, INDEPENDENT, INDEPENDENT))
BLOCKED = WayOut(None, by_tcp=("relay.example:3478",))


def report(
    trial: LinkTrial, way_out: WayOut | None = None, file: Path = LOOPBACK, overrides: tuple[str, ...] = ()
) -> DoctorReport:
    return judge(load(file, overrides, [MASTER]), way_out, trial)


def test_report_fits_a_terminal_and_its_document_is_json() -> None:
    faults = Emulation(delay_s=0.02, jitter_s=0.005, loss=0.45, burst=3.0)
    path = PathFacts(route="relayed", via="lab", interface="wifi", remote="a:1", dscp=0)
    result = MeasuredLink(faults, faults, seconds=2.0).run().measurement.result((path,), "in real time: yes")
    trial = received(**json.loads(json.dumps(asdict(result))))  # as it comes from its process
    found, stream = report(trial, overrides=("control.scheme=none", "link.playout_ms=5")), io.StringIO()
    found.show(Console(file=stream, width=80))
    text = stream.getvalue()
    assert max(map(len, text.splitlines())) <= 80
    lines = {line.strip() for line in text.splitlines() if "->" in line}
    assert {"-> --set control.scheme=bounded", "-> --set link.playout_ms=0"} <= lines
    assert any(line.startswith("-> --set link.silence_ms=") for line in lines)
    assert "relayed by lab over wifi" in text
    assert "46" in next(each.found for each in found.findings if "class of service" in each.found)
    document = json.loads(json.dumps(report(trial, MAPPED, ANYWHERE).document, allow_nan=False))
    assert (document["nat"]["mapping"], document["nat"]["needs_relay"]) == (["address-and-port-dependent"], True)
    assert document["link"]["rtt_ms"]["min"] == pytest.approx(41.0, abs=4.0)
    assert document["paths"][0]["route"] == "relayed"


@pytest.mark.parametrize(
    ("failure", "way_out", "file"),
    [
        ("no path to robot: UDP is blocked", None, LOOPBACK),
        (None, None, LOOPBACK),
        ("no path to robot: UDP is blocked between here and relay.example:3478", BLOCKED, ANYWHERE),  # said once
    ],
)
def test_failed_measurement_is_one_problem(failure: str | None, way_out: WayOut | None, file: Path) -> None:
    found = report(LinkTrial(failure=failure), way_out, file)
    assert (found.count(Grade.PROBLEM), found.document["link"]) == (1, None)
    assert failure is None or found.document["failure"] == failure


@pytest.mark.parametrize(
    ("way_out", "overrides", "grade", "fix"),
    [
        (OUTSIDE, (), Grade.OK, None),
        (REACHED, (), Grade.OK, None),
        (MAPPED, (), Grade.OK, None),  # the file has a relay
        (MAPPED, ("link.turn=null",), Grade.ADVICE, "link.turn"),
        (UNCLEAR, (), Grade.UNKNOWN, "docs/relay.md"),
        (BLOCKED, (), Grade.PROBLEM, "another network"),
        (WayOut(None), (), Grade.PROBLEM, "systemctl"),
        (WayOut(None, unresolved=("a.b",)), (), Grade.PROBLEM, "link.stun"),
    ],
)
def test_way_out_is_judged(way_out: WayOut, overrides: tuple[str, ...], grade: Grade, fix: str | None) -> None:
    first, *others = judge_way_out(way_out, load(ANYWHERE, overrides, [MASTER]).system.link)
    assert first.grade is grade
    assert first.fix is None if fix is None else fix in (first.fix or "")
    assert [(each.check, each.grade) for each in others] == [("filtering", Grade.OK)] * (way_out.nat is not None)


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
def test_peer_is_a_label_or_an_address_and_the_servers_are_those_of_the_file(file: Path, peer: str, added: str) -> None:
    link = load(file, (), [MASTER]).system.link
    assert towards(peer, link, ["a=b"]) == ["a=b", added]
    assert set(stun_servers(link)) == ({"relay.example:3478"} if file == ANYWHERE else set())
