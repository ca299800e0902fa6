"""The report on the link to a waiting slave: way out of this host, path, link, and settings that suit them."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any

from weberlink.anywhere.nat import ANY, Behaviour, Nat
from weberlink.anywhere.stun import WayOut, find_way_out
from weberlink.apps.doctor.link_advice import recommend
from weberlink.apps.doctor.link_figures import LinkFigures, LinkTrial, Way, figures
from weberlink.apps.doctor.link_trial import build_probe, run_link_trial
from weberlink.apps.doctor.needs import Needs
from weberlink.apps.doctor.report import DoctorReport, Finding, advice, ok, problem, unknown
from weberlink.system.configuration import MASTER, Configuration
from weberlink.system.configuration.extras import need
from weberlink.system.configuration.model import LinkSettings, split_address

RELAY_PAGE = "docs/relay.md"
LETS_IN = {
    Behaviour.INDEPENDENT: "everybody",
    Behaviour.ADDRESS: "hosts that were sent something",
    Behaviour.ADDRESS_AND_PORT: "ports that were sent something",
}


def examine_link(configuration: Configuration, overrides: Iterable[str], seconds: float) -> DoctorReport:
    """Ask the servers of the file, then measure the link to the waiting slave.

    Raises:
        ConfigurationError: the key cannot be read, the peer is not known, or a package is not installed.
    """
    assert configuration.path is not None
    build_probe(configuration, 0.0)  # for its errors, before anything takes time
    servers = [split_address(name) for name in stun_servers(configuration.system.link)]
    if servers:
        need("aioice", "anywhere", "link.stun")
    way_out = find_way_out(servers) if servers else None
    return judge(configuration, way_out, run_link_trial(configuration.path, [*overrides], seconds))


def stun_servers(link: LinkSettings) -> list[str]:
    """The servers of a file that tell a host its address outside; a relay does too."""
    relay = None if link.turn is None else link.turn.server
    return list(dict.fromkeys(name for name in (link.stun, relay) if name is not None))


def towards(peer: str, link: LinkSettings, overrides: Iterable[str]) -> list[str]:
    """The overrides, and one that calls this peer: a label where paths are found, else a host, perhaps with a port."""
    if link.path == "ice":
        return [*overrides, f"link.peer={peer}"]
    try:
        host, port = split_address(peer)
    except ValueError:
        host, port = peer.strip("[]"), split_address(link.slave)[1]
    return [*overrides, f"link.slave={f'[{host}]' if ':' in host else host}:{port}"]


def judge(configuration: Configuration, way_out: WayOut | None, trial: LinkTrial) -> DoctorReport:
    """The report on what was measured.

    Args:
        way_out: None if the file names no server to ask.
    """
    link, failure, measured = configuration.system.link, trial.failure, None
    if failure is None:
        try:
            measured = figures(trial)
        except ValueError as error:
            failure = str(error)
    found: dict[str, Iterable[Finding]] = {}
    if way_out is not None:
        found["way out"] = judge_way_out(way_out, link)
    if measured is not None:
        found["path"] = judge_paths(trial.paths, link)
        found["link"] = describe_link(measured, trial.priority)
        found["settings"] = recommend(measured, configuration)
    elif way_out is None or not way_out.by_tcp or link.path == "direct":  # else it says once more that UDP is blocked
        look = "then: weberlink peer" if link.path == "ice" else f"from here: ping {split_address(link.slave)[0]}"
        found["link"] = [problem(failure or "", f"on the robot's host: weberlink slave FILE; {look}", "session")]
    document = {
        "nat": None if way_out is None or way_out.nat is None else _nat_document(way_out.nat),
        "paths": trial.paths,
        "link": None if measured is None else measured.document,
        **({} if failure is None else {"failure": failure}),
    }
    findings = [replace(each, area=area) for area, group in found.items() for each in group]
    return DoctorReport(Needs.of(configuration, [MASTER]), findings, document)


def judge_way_out(way_out: WayOut, link: LinkSettings) -> Iterator[Finding]:
    """What the servers told of NAT and firewall."""
    for name in way_out.unresolved:
        yield problem(f"{name} cannot be resolved", "in the file: link.stun, link.turn.server", "server")
    if way_out.nat is not None:
        yield _nat(way_out.nat, link)
        whom = ", or ".join(f"{LETS_IN[each]} ({each} filtering)" for each in sorted(way_out.nat.filtering))
        whom = "not known; a server with two addresses would tell" if way_out.nat.filtering == ANY else whom
        yield ok(f"lets in: {whom}", "filtering")
    elif way_out.by_tcp:
        found = f"UDP is blocked between here and {' and '.join(way_out.by_tcp)}, which answers by TCP only"
        yield problem(found, "another network, or ask its administrator to let UDP pass", "udp")
    elif not way_out.unresolved:
        found = (
            f"{' and '.join(stun_servers(link))} answers neither by UDP nor by TCP: it is down, or this host is cut off"
        )
        yield problem(found, "on its host: systemctl status weberlink-relay", "server")


def _nat(nat: Nat, link: LinkSettings) -> Finding:
    host, port = nat.mapped
    if not nat.is_translated:
        return ok(f"no NAT: this host is {host}:{port} outside too", "nat")
    found = f"NAT with {' or '.join(sorted(nat.mapping))} mapping (RFC 4787); outside, this host is {host}"
    if nat.needs_relay is None:
        return unknown(f"{found}; a server with two addresses would tell more", RELAY_PAGE, "nat")
    if not nat.needs_relay:
        return ok(f"{found}; peers can reach it without a relay", "nat")
    found += "; a peer behind another such NAT is reached by a relay only"
    if link.turn is not None:
        return ok(found, "nat")
    return advice(found, f"in the file: link.turn, a relay of one's own ({RELAY_PAGE})", "nat")


def _nat_document(nat: Nat) -> dict[str, Any]:
    return {
        "server": "{}:{}".format(*nat.server),
        "mapped": "{}:{}".format(*nat.mapped),
        "translated": nat.is_translated,
        "mapping": sorted(nat.mapping),
        "filtering": sorted(nat.filtering),
        "needs_relay": nat.needs_relay,
    }


def judge_paths(paths: Iterable[Mapping[str, Any]], link: LinkSettings) -> Iterator[Finding]:
    """The paths that the session used, and the class of service that arrived."""
    for path in paths:
        by = f" by {path['via']}" if path["via"] else ""
        over = f" over {path['interface']}" if path["interface"] else ""
        yield ok(f"{path['route']}{by}{over}, to {path['remote']}", f"path {path['place']}")
        if (arrived := path.get("dscp")) is not None:
            asked = ", as asked" if arrived == link.dscp else f"; the file asks for {link.dscp}"
            yield ok(f"the slave's datagrams arrive with class of service {arrived}{asked}", "dscp")


def describe_link(link: LinkFigures, priority: str) -> Iterator[Finding]:
    """The figures of the link, in words."""
    least, median, late, most = (1e3 * value for value in link.rtt_s)
    yield ok(
        f"round trip {median:.1f} ms; at least {least:.1f}, 99 % below {late:.1f}, at most {most:.1f} "
        f"({link.answers} of {link.questions} questions in {link.seconds:.1f} s were answered; measured {priority})",
        "round trip",
    )
    for check, way in (("to the slave", link.to_slave), ("from the slave", link.to_master)):
        yield ok(f"{check} {_way(way)}", check)
    yield ok("each way is given half of the least round trip; only synchronous clocks could tell more", "clocks")


def _way(way: Way) -> str:
    delay = f"{1e3 * way.delay_s:.1f} ms, 1 % more than {1e3 * way.late_s:.1f} ms late; "
    if way.loss == 0.0:
        return delay + "no loss"
    return delay + f"loss {100 * way.loss:.1f} %, {way.burst:.1f} in a row on average, at most {way.longest_burst}"
