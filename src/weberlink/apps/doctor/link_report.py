"""The report on the network between the two hosts: way out of this one, path, link, and settings that suit them."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any

from weberlink.anywhere.nat import ANY, Behaviour, Nat
from weberlink.anywhere.stun import WayOut, find_way_out
from weberlink.apps.doctor.link_advice import recommend
from weberlink.apps.doctor.link_figures import LinkFigures, Way, figures
from weberlink.apps.doctor.link_trial import LinkRequest, LinkTrial, build_probe, run_link_trial
from weberlink.apps.doctor.needs import Needs
from weberlink.apps.doctor.report import DoctorReport, Finding, advice, ok, problem, unknown
from weberlink.system.configuration import MASTER, Configuration
from weberlink.system.configuration.extras import need
from weberlink.system.configuration.model import LinkSettings, split_address

RELAY_PAGE = "docs/relay.md"


def examine_network(configuration: Configuration, overrides: Iterable[str], seconds: float) -> DoctorReport:
    """Ask the servers of the file, then measure the link to the waiting slave.

    Raises:
        ConfigurationError: the key cannot be read, the peer is not known, or a package is not installed.
    """
    link = configuration.system.link
    build_probe(configuration, 0.0)  # for its errors, before anything takes time
    servers = stun_servers(link)
    if servers:
        need("aioice", "anywhere", "link.stun")
    way_out = find_way_out(servers) if servers else None
    trial = run_link_trial(LinkRequest(str(configuration.path), tuple(overrides), seconds))
    return judge(configuration, way_out, trial)


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
    system = configuration.system
    found: dict[str, tuple[Finding, ...]] = {}
    measured: dict[str, Any] = {"nat": None, "paths": trial.paths, "link": None}
    if way_out is not None:
        found["way out"] = tuple(judge_way_out(way_out, system.link))
        measured["nat"] = _nat_document(way_out.nat)
    if trial.failure is not None and way_out is not None and way_out.by_tcp and system.link.path == "ice":
        measured["failure"] = trial.failure  # it says once more that UDP is blocked
    elif trial.failure is not None:
        measured["failure"] = trial.failure
        found["link"] = (problem(trial.failure, _next_step(system.link), "session"),)
    else:
        samples = trial.samples
        try:
            link = figures(samples)
        except ValueError as error:
            found["link"] = (problem(str(error), _next_step(system.link), "session"),)
        else:
            measured["link"] = link.document
            if trial.paths:
                found["path"] = tuple(judge_paths(trial.paths, system.link))
            found["link"] = tuple(describe_link(link, trial.priority))
            found["settings"] = tuple(recommend(link, configuration))
    findings = [replace(each, area=area) for area, group in found.items() for each in group]
    return DoctorReport(Needs.of(configuration, [MASTER]), findings, measured)


def stun_servers(link: LinkSettings) -> list[tuple[str, int]]:
    """The servers of a file that tell a host its address outside; a relay does too."""
    named = [link.stun, None if link.turn is None else link.turn.server]
    return [split_address(name) for name in named if name is not None]


def _next_step(link: LinkSettings) -> str:
    if link.path == "ice":
        return "on the robot's host: weberlink slave FILE; then: weberlink peers"
    return f"on the robot's host: weberlink slave FILE; from here: ping {split_address(link.slave)[0]}"


# --- way out


def judge_way_out(way_out: WayOut, link: LinkSettings) -> Iterator[Finding]:
    """What the servers told of NAT and firewall."""
    for name in way_out.unresolved:
        yield problem(f"{name} cannot be resolved", "in the file: link.stun, link.turn.server", "server")
    nat = way_out.nat
    if nat is None:
        yield from _silent(way_out, link)
        return
    yield _nat(nat, link)
    yield ok(f"lets in: {_filtered(nat)}", "filtering")


def _silent(way_out: WayOut, link: LinkSettings) -> Iterator[Finding]:
    servers = " and ".join(dict.fromkeys(name for name in (link.stun, link.turn and link.turn.server) if name))
    if way_out.by_tcp:
        where = " and ".join(way_out.by_tcp)
        found = f"UDP is blocked between here and {where}, which answers by TCP only"
        yield problem(found, "another network, or ask its administrator to let UDP pass", "udp")
    elif not way_out.unresolved:
        found = f"{servers} answers neither by UDP nor by TCP: it is down, or this host is cut off"
        yield problem(found, "on its host: systemctl status weberlink-relay", "server")


def _nat(nat: Nat, link: LinkSettings) -> Finding:
    host, port = nat.mapped
    if not nat.is_translated:
        return ok(f"no NAT: this host is {host}:{port} outside too", "nat")
    found = f"NAT with {_named(nat.mapping)} mapping (RFC 4787); outside, this host is {host}"
    if nat.needs_relay is None:
        return unknown(f"{found}; a server with two addresses would tell more", RELAY_PAGE, "nat")
    if not nat.needs_relay:
        return ok(f"{found}; peers can reach it without a relay", "nat")
    found += "; a peer behind another such NAT is reached by a relay only"
    if link.turn is not None:
        return ok(found, "nat")
    return advice(found, f"in the file: link.turn, a relay of one's own ({RELAY_PAGE})", "nat")


def _named(possible: Iterable[Behaviour]) -> str:
    return " or ".join(sorted(possible))


def _filtered(nat: Nat) -> str:
    whom = {
        Behaviour.INDEPENDENT: "everybody",
        Behaviour.ADDRESS: "hosts that were sent something",
        Behaviour.ADDRESS_AND_PORT: "ports that were sent something",
    }
    if nat.filtering == ANY:
        return "not known; a server with two addresses would tell"
    return ", or ".join(f"{whom[each]} ({each} filtering)" for each in sorted(nat.filtering))


def _nat_document(nat: Nat | None) -> dict[str, Any] | None:
    if nat is None:
        return None
    return {
        "server": "{}:{}".format(*nat.server),
        "mapped": "{}:{}".format(*nat.mapped),
        "translated": nat.is_translated,
        "mapping": sorted(nat.mapping),
        "filtering": sorted(nat.filtering),
        "needs_relay": nat.needs_relay,
    }


# --- path and link


def judge_paths(paths: Iterable[Mapping[str, Any]], link: LinkSettings) -> Iterator[Finding]:
    """The paths that the session used, and the class of service that arrived."""
    for path in paths:
        route, via = path["route"], path["via"]
        by = f" by {via}" if via else ""
        over = f" over {path['interface']}" if path["interface"] else ""
        yield ok(f"{route}{by}{over}, to {path['remote']}", f"path {path['place']}")
        if (dscp := path.get("dscp")) is not None:
            yield _dscp(dscp, link.dscp)


def _dscp(arrived: int, asked: int) -> Finding:
    if arrived == asked:
        return ok(f"the slave's datagrams arrive with class of service {arrived}, as asked", "dscp")
    return ok(f"the slave's datagrams arrive with class of service {arrived}; the file asks for {asked}", "dscp")


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
