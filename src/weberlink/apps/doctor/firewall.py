"""Whether a packet filter lets datagrams reach the slave's port. Most of it only root may read, and it says so."""

import json
import re
from collections.abc import Iterator
from typing import Any

from weberlink.apps.doctor.finding import Check, Finding, advice, ok, problem, unknown
from weberlink.apps.doctor.host import Host, Unreadable
from weberlink.apps.doctor.needs import Needs


def firewall(host: Host, needs: Needs) -> Iterator[Finding]:
    """The first of the filters that is at work here."""
    if needs.listen is None:
        yield ok("firewall", "nothing listens here, so there is nothing to open")
        return
    number = needs.listen[1]
    if needs.listen[0].startswith("127.") or needs.listen[0] in ("localhost", "::1"):
        yield ok("firewall", "the slave listens on loopback, which filters rarely touch")
        return
    for ask in (_ufw, _firewalld):
        finding = ask(host, number)
        if finding is not None:
            yield finding
            return
    for tool, read in (("nft", _nftables), ("iptables", _iptables)):
        if host.which(tool) is None:
            continue
        if host.user != 0:
            again = f"sudo {host.program} doctor {needs.file}"
            yield unknown("firewall", f"the rules that {tool} shows cannot be read without root", again)
            return
        finding = read(host, number)
        if finding is not None:
            yield finding
            return
    yield ok("firewall", "no packet filter found (ufw, firewalld, nftables, iptables)")


def _ufw(host: Host, number: int) -> Finding | None:
    try:
        enabled = re.search(r"^ENABLED=yes", host.read("/etc/ufw/ufw.conf"), re.M)
    except Unreadable:
        return None
    if not enabled:
        return None
    open_it = f"sudo ufw allow {number}/udp"
    try:
        rules = host.read("/etc/ufw/user.rules")
    except Unreadable:
        return unknown("firewall", "ufw is on; its rules cannot be read without root", open_it)
    # "### tuple ### allow udp 47000 0.0.0.0/0 any 0.0.0.0/0 in"
    if re.search(rf"^### tuple ### (allow|limit) (any|udp) {number} ", rules, re.M):
        return ok("firewall", f"ufw is on and allows UDP port {number}")
    return problem("firewall", f"ufw is on, and no rule names UDP port {number}", open_it)


def _firewalld(host: Host, number: int) -> Finding | None:
    if host.which("firewall-cmd") is None or host.run("firewall-cmd", "--state")[0] != 0:
        return None
    if host.run("firewall-cmd", f"--query-port={number}/udp")[0] == 0:
        return ok("firewall", f"firewalld is on and allows UDP port {number}")
    return problem(
        "firewall",
        f"firewalld is on, and its default zone does not allow UDP port {number}",
        f"sudo firewall-cmd --permanent --add-port={number}/udp && sudo firewall-cmd --reload",
    )


def _nftables(host: Host, number: int) -> Finding | None:
    """Chains at the input hook that drop what no rule accepts, and whether a rule of theirs names the port."""
    status, output = host.run("nft", "--json", "list", "ruleset")
    if status != 0:
        return unknown("firewall", f"nft list ruleset ended with status {status}", "sudo nft list ruleset")
    entries: list[dict[str, Any]] = json.loads(output or "{}").get("nftables", [])
    chains = [entry["chain"] for entry in entries if entry.get("chain", {}).get("hook") == "input"]
    rules = [entry["rule"] for entry in entries if "rule" in entry]
    closed = [chain for chain in chains if _closes(chain, rules)]
    if not closed:
        return ok("firewall", "nftables: no chain at the input hook drops by default") if chains else None
    if any(_opens(rule, number) for rule in rules):
        return ok("firewall", f"nftables drops by default; a rule accepts UDP port {number}")
    chain = " ".join(closed[0][key] for key in ("family", "table", "name"))
    return problem(
        "firewall",
        f"nftables drops by default ({chain}); no rule accepts UDP port {number}",
        f"sudo nft insert rule {chain} udp dport {number} accept",
    )


def _closes(chain: dict[str, Any], rules: list[dict[str, Any]]) -> bool:
    """Whether a chain drops what no rule accepts: by its policy, or by a rule that holds for everything."""
    own = [rule for rule in rules if _place(rule, "chain") == _place(chain, "name")]
    return chain.get("policy") == "drop" or any(
        _refuses(rule) and not any("match" in expression for expression in rule["expr"]) for rule in own
    )


def _place(entry: dict[str, Any], name: str) -> tuple[str, str, str]:
    return entry["family"], entry["table"], entry[name]


def _refuses(rule: dict[str, Any]) -> bool:
    return any("drop" in expression or "reject" in expression for expression in rule.get("expr", []))


def _opens(rule: dict[str, Any], number: int) -> bool:
    """Whether a rule matches the destination port of UDP, alone, in a set or in a range, and does not refuse it."""
    port = {"payload": {"protocol": "udp", "field": "dport"}}
    matches = (expression["match"] for expression in rule.get("expr", []) if "match" in expression)
    return not _refuses(rule) and any(match["left"] == port and _covers(match["right"], number) for match in matches)


def _covers(right: Any, number: int) -> bool:
    if isinstance(right, dict):
        if "range" in right:
            low, high = right["range"]
            return bool(low <= number <= high)
        return any(_covers(each, number) for each in right.get("set", []))
    return bool(right == number)


def _iptables(host: Host, number: int) -> Finding:
    status, output = host.run("iptables", "-S", "INPUT")
    if status != 0:
        return unknown("firewall", f"iptables -S INPUT ended with status {status}", "sudo iptables -S INPUT")
    if "-P INPUT ACCEPT" in output and not re.search(r"-j (DROP|REJECT)", output):
        return ok("firewall", "iptables accepts by default")
    if re.search(rf"-p udp .*--dports? (\S*,)?{number}(,\S*)? -j ACCEPT", output):
        return ok("firewall", f"iptables accepts UDP port {number}")
    return advice(
        "firewall",
        f"iptables drops something, and no rule names UDP port {number}",
        f"sudo iptables -I INPUT -p udp --dport {number} -j ACCEPT",
    )


CHECKS: tuple[Check, ...] = (firewall,)
