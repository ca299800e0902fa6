"""What the doctor says of the way out of this host: NAT and firewall, by the servers of the file."""

from collections.abc import Iterator, Sequence
from typing import Any
from urllib.parse import urlsplit

from weberlink.config.model import split_address
from weberlink_anywhere.nat import ANY, Behaviour, Nat
from weberlink_anywhere.options import AnywhereOptions
from weberlink_anywhere.stun import WayOut, find_way_out
from weberlink_doctor.report import Finding, advice, ok, problem, unknown

RELAY_PAGE = "docs/relay.md"
LETS_IN = {
    Behaviour.INDEPENDENT: "everybody",
    Behaviour.ADDRESS: "hosts that were sent something",
    Behaviour.ADDRESS_AND_PORT: "ports that were sent something",
}


def mailbox(options: AnywhereOptions) -> Iterator[Finding]:
    """Whether the way to the mailbox is encrypted."""
    url = urlsplit(options.mailbox or "")
    if url.scheme == "ws" and url.hostname not in ("localhost", "127.0.0.1", "::1"):
        found = (
            f"the mailbox {options.mailbox} is not encrypted: a listener learns which hosts meet, and can disturb it"
        )
        yield advice(found, f"wss:// in both files, with a certificate on the relay ({RELAY_PAGE})", "mailbox")


def examine(options: AnywhereOptions) -> tuple[dict[str, Any], Sequence[Finding]]:
    """Ask the servers of the file."""
    servers = [split_address(name) for name in stun_servers(options)]
    if not servers:
        return {"nat": None}, list(mailbox(options))
    way_out = find_way_out(servers)
    found = [*judge(way_out, options), *mailbox(options)]
    return {"nat": None if way_out.nat is None else _nat_document(way_out.nat)}, found


def stun_servers(options: AnywhereOptions) -> list[str]:
    """The servers of a file that tell a host its address outside; a relay does too."""
    relay = None if options.turn is None else options.turn.server
    return list(dict.fromkeys(name for name in (options.stun, relay) if name is not None))


def judge(way_out: WayOut, options: AnywhereOptions) -> Iterator[Finding]:
    """What the servers told of NAT and firewall."""
    for name in way_out.unresolved:
        yield problem(f"{name} cannot be resolved", "in the file: link.finder.stun, link.finder.turn.server", "server")
    if way_out.nat is not None:
        yield _nat(way_out.nat, options)
        whom = ", or ".join(f"{LETS_IN[each]} ({each} filtering)" for each in sorted(way_out.nat.filtering))
        whom = "not known; a server with two addresses would tell" if way_out.nat.filtering == ANY else whom
        yield ok(f"lets in: {whom}", "filtering")
    elif way_out.by_tcp:
        found = f"UDP is blocked between here and {' and '.join(way_out.by_tcp)}, which answers by TCP only"
        yield problem(found, "another network, or ask its administrator to let UDP pass", "udp")
    elif not way_out.unresolved:
        silent = " and ".join(stun_servers(options))
        found = f"{silent} answers neither by UDP nor by TCP: it is down, or this host is cut off"
        yield problem(found, "on its host: systemctl status weberlink-relay", "server")


def _nat(nat: Nat, options: AnywhereOptions) -> Finding:
    host, port = nat.mapped
    if not nat.is_translated:
        return ok(f"no NAT: this host is {host}:{port} outside too", "nat")
    found = f"NAT with {' or '.join(sorted(nat.mapping))} mapping (RFC 4787); outside, this host is {host}"
    if nat.needs_relay is None:
        return unknown(f"{found}; a server with two addresses would tell more", RELAY_PAGE, "nat")
    if not nat.needs_relay:
        return ok(f"{found}; peers can reach it without a relay", "nat")
    found += "; a peer behind another such NAT is reached by a relay only"
    if options.turn is not None:
        return ok(found, "nat")
    return advice(found, f"in the file: link.finder.turn, a relay of one's own ({RELAY_PAGE})", "nat")


def _nat_document(nat: Nat) -> dict[str, Any]:
    return {
        "server": "{}:{}".format(*nat.server),
        "mapped": "{}:{}".format(*nat.mapped),
        "translated": nat.is_translated,
        "mapping": sorted(nat.mapping),
        "filtering": sorted(nat.filtering),
        "needs_relay": nat.needs_relay,
    }
