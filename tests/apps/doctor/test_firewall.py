"""Packet filters, by their own words."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.apps.doctor.machine import machine, only
from weberlink.apps.doctor import Finding, Grade, Needs
from weberlink.apps.doctor.firewall import firewall

LISTENING = Needs(file=Path("lan.yaml"), listen=("0.0.0.0", 47000))
UFW = {"etc/ufw/ufw.conf": "# on\nENABLED=yes\nLOGLEVEL=low\n"}
CHAIN = {"chain": {"family": "inet", "table": "filter", "name": "input", "hook": "input", "policy": "drop"}}


def with_tool(tmp_path: Path, tool: str, answers: dict[str, tuple[int, str]], user: int = 0) -> Finding:
    def run(*command: str) -> tuple[int, str]:
        return answers[" ".join(command[1:])]

    return only(
        firewall, machine(tmp_path, which=lambda name: name if name == tool else None, run=run, user=user), LISTENING
    )


def nft(tmp_path: Path, *entries: dict[str, Any]) -> Finding:
    document = json.dumps({"nftables": [{"metainfo": {"version": "1.0.6"}}, *entries]})
    return with_tool(tmp_path, "nft", {"--json list ruleset": (0, document)})


def rule(right: Any) -> dict[str, Any]:
    match = {"op": "==", "left": {"payload": {"protocol": "udp", "field": "dport"}}, "right": right}
    return {
        "rule": {"family": "inet", "table": "filter", "chain": "input", "expr": [{"match": match}, {"accept": None}]}
    }


def test_nothing_to_open_where_nothing_listens_or_only_on_loopback(tmp_path: Path) -> None:
    assert only(firewall, machine(tmp_path, UFW), Needs()).grade is Grade.OK
    assert only(firewall, machine(tmp_path, UFW), Needs(listen=("127.0.0.1", 47000))).grade is Grade.OK


def test_a_machine_without_a_filter_is_fine(tmp_path: Path) -> None:
    assert only(firewall, machine(tmp_path), LISTENING).grade is Grade.OK


def test_ufw_without_its_rules_is_honestly_unknown(tmp_path: Path) -> None:
    off = machine(tmp_path, {"etc/ufw/ufw.conf": "ENABLED=no\n"})
    assert only(firewall, off, LISTENING).grade is Grade.OK
    found = only(firewall, machine(tmp_path, UFW), LISTENING)
    assert (found.grade, found.fix) == (Grade.UNKNOWN, "sudo ufw allow 47000/udp")
    assert "without root" in found.found


@pytest.mark.parametrize(
    ("line", "grade"),
    [
        ("### tuple ### allow udp 47000 0.0.0.0/0 any 0.0.0.0/0 in", Grade.OK),
        ("### tuple ### allow any 47000 0.0.0.0/0 any 0.0.0.0/0 in", Grade.OK),
        ("### tuple ### deny udp 47000 0.0.0.0/0 any 0.0.0.0/0 in", Grade.PROBLEM),
        ("### tuple ### allow tcp 47000 0.0.0.0/0 any 0.0.0.0/0 in", Grade.PROBLEM),
        ("### tuple ### allow udp 470001 0.0.0.0/0 any 0.0.0.0/0 in", Grade.PROBLEM),
    ],
)
def test_ufw_with_its_rules_is_read(tmp_path: Path, line: str, grade: Grade) -> None:
    found = only(firewall, machine(tmp_path, UFW | {"etc/ufw/user.rules": f"*filter\n{line}\n"}), LISTENING)
    assert found.grade is grade


@pytest.mark.parametrize("tool", ["nft", "iptables"])
def test_without_root_rules_are_honestly_unknown(tmp_path: Path, tool: str) -> None:
    found = with_tool(tmp_path, tool, {}, user=1000)
    assert found.grade is Grade.UNKNOWN
    assert "cannot be read without root" in found.found
    assert (found.fix or "").endswith(" doctor lan.yaml")


@pytest.mark.parametrize(
    "right", [47000, {"set": [22, 47000]}, {"range": [47000, 47010]}, {"set": [{"range": [1, 65000]}]}]
)
def test_nftables_with_a_rule_for_the_port_is_fine(tmp_path: Path, right: Any) -> None:
    assert nft(tmp_path, CHAIN, rule(right)).grade is Grade.OK


def test_nftables_that_drops_what_nobody_names_is_a_problem(tmp_path: Path) -> None:
    for entries in ([CHAIN], [CHAIN, rule(22)], [CHAIN, rule({"range": [1, 100]})]):
        found = nft(tmp_path, *entries)
        assert (found.grade, found.fix) == (
            Grade.PROBLEM,
            "sudo nft insert rule inet filter input udp dport 47000 accept",
        )


def test_nftables_is_closed_by_a_last_rule_too_and_a_rule_that_drops_opens_nothing(tmp_path: Path) -> None:
    open_chain = {"chain": {**CHAIN["chain"], "policy": "accept"}}
    last = {
        "rule": {"family": "inet", "table": "filter", "chain": "input", "expr": [{"counter": {}}, {"reject": None}]}
    }
    assert nft(tmp_path, open_chain, last).grade is Grade.PROBLEM
    assert nft(tmp_path, open_chain, rule(47000), last).grade is Grade.OK
    elsewhere = {"rule": {**last["rule"], "chain": "forward"}}
    assert nft(tmp_path, open_chain, elsewhere).grade is Grade.OK
    dropped = rule(47000)
    dropped["rule"]["expr"][1] = {"drop": None}
    assert nft(tmp_path, CHAIN, dropped).grade is Grade.PROBLEM


def test_the_fix_for_real_nftables_is_right() -> None:
    """In a network namespace of its own, where it may be made: a chain that drops, then the line that is told."""
    inside = (
        "import subprocess\n"
        "from weberlink.doctor import Grade, Host, Needs\n"
        "from weberlink.doctor.firewall import firewall\n"
        "def look(): return next(firewall(Host(), Needs(listen=('0.0.0.0', 47000))))\n"
        "assert look().grade is Grade.OK, look()\n"
        "script = 'table inet own { chain entry { type filter hook input priority 0; policy drop; }; }'\n"
        "subprocess.run(['nft', script], check=True)\n"
        "found = look()\n"
        "assert found.grade is Grade.PROBLEM, found\n"
        "subprocess.run(found.fix.removeprefix('sudo ').split(), check=True)\n"
        "assert look().grade is Grade.OK, look()\n"
    )
    if os.geteuid() != 0 or shutil.which("nft") is None or shutil.which("unshare") is None:
        pytest.skip("takes root, nft and unshare")
    if subprocess.run(["unshare", "--net", "nft", "list", "ruleset"], capture_output=True, check=False).returncode != 0:
        pytest.skip("no network namespace with nftables can be made here")
    done = subprocess.run(
        ["unshare", "--net", sys.executable, "-c", inside], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")


def test_nftables_that_accepts_by_default_is_fine(tmp_path: Path) -> None:
    open_chain = {"chain": {**CHAIN["chain"], "policy": "accept"}}
    assert nft(tmp_path, open_chain).grade is Grade.OK


@pytest.mark.parametrize(
    ("rules", "grade"),
    [
        ("-P INPUT ACCEPT", Grade.OK),
        ("-P INPUT DROP\n-A INPUT -p udp -m udp --dport 47000 -j ACCEPT", Grade.OK),
        ("-P INPUT DROP\n-A INPUT -p udp -m multiport --dports 22,47000 -j ACCEPT", Grade.OK),
        ("-P INPUT DROP\n-A INPUT -p udp -m udp --dport 4700 -j ACCEPT", Grade.ADVICE),
        ("-P INPUT ACCEPT\n-A INPUT -j REJECT", Grade.ADVICE),
    ],
)
def test_iptables_is_read(tmp_path: Path, rules: str, grade: Grade) -> None:
    assert with_tool(tmp_path, "iptables", {"-S INPUT": (0, rules)}).grade is grade


def test_firewalld_is_asked(tmp_path: Path) -> None:
    def found(state: int, port: int) -> Finding:
        answers = {"--state": (state, ""), "--query-port=47000/udp": (port, "")}
        return with_tool(tmp_path, "firewall-cmd", answers)

    assert found(0, 0).grade is Grade.OK
    assert found(0, 1).grade is Grade.PROBLEM
    assert found(252, 1).grade is Grade.OK  # it is not running
