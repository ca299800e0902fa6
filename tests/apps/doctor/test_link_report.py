"""The report of doctor --link: one line for each thing that is wrong, and lines that can be copied."""

import io
import json
from dataclasses import asdict
from pathlib import Path

import pytest
from rich.console import Console
from typer.testing import CliRunner

from tests.apps.doctor.links import MeasuredLink
from tests.system.systems import CONFIGS
from weberlink.anywhere.nat import ANY, Behaviour, Nat
from weberlink.anywhere.stun import WayOut
from weberlink.apps.doctor import DoctorReport, Grade
from weberlink.apps.doctor.link_figures import LinkTrial
from weberlink.apps.doctor.link_report import judge, judge_way_out, stun_servers, towards
from weberlink.apps.doctor.link_trial import received
from weberlink.cli import app
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
    nat = Nat(SERVER, ("198.51.100.7", 20_000), True, BOTH, BOTH)
    found = report(measured(Emulation(delay_s=0.01), PathFacts(remote="a:1")), WayOut(nat), ANYWHERE)
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


def way_out_lines(way_out: WayOut, *overrides: str) -> list[tuple[Grade, str, str | None]]:
    link = load(ANYWHERE, overrides, [MASTER]).system.link
    return [(each.grade, each.found, each.fix) for each in judge_way_out(way_out, link)]


def test_blocked_udp_is_one_line() -> None:
    ((grade, found, _),) = way_out_lines(WayOut(None, by_tcp=("relay.example:3478",)))
    assert grade is Grade.PROBLEM
    assert found == "UDP is blocked between here and relay.example:3478, which answers by TCP only"


def test_server_that_is_down_is_one_line() -> None:
    ((grade, found, _),) = way_out_lines(WayOut(None))
    assert grade is Grade.PROBLEM
    assert found.startswith("relay.example:3478 answers neither by UDP nor by TCP")


def test_unknown_name_is_one_line() -> None:
    ((grade, found, _),) = way_out_lines(WayOut(None, unresolved=("relay.example",)))
    assert (grade, found) == (Grade.PROBLEM, "relay.example cannot be resolved")


def test_dependent_mapping_asks_for_a_relay_where_the_file_has_none() -> None:
    nat = WayOut(Nat(SERVER, ("198.51.100.7", 20_000), True, BOTH, BOTH))
    assert [grade for grade, _, _ in way_out_lines(nat)] == [Grade.OK, Grade.OK]
    ((grade, found, fix), _) = way_out_lines(nat, "link.turn=null")
    assert grade is Grade.ADVICE
    assert "reached by a relay only" in found
    assert fix is not None and "link.turn" in fix


def test_mapping_that_is_not_known_is_said() -> None:
    lines = way_out_lines(WayOut(Nat(SERVER, ("198.51.100.7", 20_000), True, ANY, ANY)))
    assert [grade for grade, _, _ in lines] == [Grade.UNKNOWN, Grade.OK]


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


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["--link", "robot"], "--link: needs a FILE"),
        ([str(ANYWHERE), "--link", "nobody", "--set", "link.peer_store=EMPTY"], "nobody"),
        ([str(CONFIGS / "lan.yaml"), "--link", "robot", "--set", "link.key_file=EMPTY/key"], "link.key_file"),
    ],
)
def test_wrong_use_is_one_line(arguments: list[str], complaint: str, tmp_path: Path) -> None:
    given = [each.replace("EMPTY", str(tmp_path)) for each in arguments]
    result = CliRunner().invoke(app, ["doctor", *given])
    assert result.exit_code == 2, result.output
    assert complaint in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1


def test_blocked_udp_is_not_said_twice() -> None:
    trial = LinkTrial(failure="no path to robot: UDP is blocked between here and relay.example:3478")
    found = report(trial, WayOut(None, by_tcp=("relay.example:3478",)), ANYWHERE)
    assert found.count(Grade.PROBLEM) == 1
    assert found.document["failure"] == trial.failure
