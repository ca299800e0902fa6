"""The report on the link to a waiting slave: way out of this host, path, link, and settings that suit them."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

from weberlink.cli.doctor.link_advice import recommend
from weberlink.cli.doctor.link_figures import LinkFigures, LinkTrial, Way, figures
from weberlink.cli.doctor.link_trial import build_probe, run_link_trial
from weberlink.cli.doctor.needs import Needs
from weberlink.cli.doctor.report import DoctorReport, Finding, ok, problem
from weberlink.config import MASTER, Configuration
from weberlink.config.finders import finder_of
from weberlink.config.model import LinkSettings, split_address

WayOut = tuple[Mapping[str, Any], Sequence[Finding]]
"""What a path finder says of the way out of this host: for JSON, and in words."""


def examine_link(configuration: Configuration, overrides: Iterable[str], seconds: float) -> DoctorReport:
    """Examine the way out of this host if the file has a path finder, then measure the link to the waiting slave.

    Raises:
        ConfigurationError: the key cannot be read, or the peer is not known.
    """
    assert configuration.path is not None
    build_probe(configuration, 0.0, finder_of(configuration, MASTER))  # for its errors, before anything takes time
    finder = configuration.finder
    way_out = ({}, []) if finder is None else finder.driver.examine(finder.options)
    return judge(configuration, way_out, run_link_trial(configuration.path, [*overrides], seconds))


def towards(peer: str, configuration: Configuration, overrides: Iterable[str]) -> list[str]:
    """The overrides, and one that calls this peer: a label where paths are found, else a host, perhaps with a port."""
    if configuration.finds_path:
        return [*overrides, f"link.finder.peer={peer}"]
    try:
        host, port = split_address(peer)
    except ValueError:
        host, port = peer.strip("[]"), split_address(configuration.system.link.slave)[1]
    return [*overrides, f"link.slave={f'[{host}]' if ':' in host else host}:{port}"]


def judge(configuration: Configuration, way_out: WayOut, trial: LinkTrial) -> DoctorReport:
    """The report on what was measured."""
    link, failure, measured = configuration.system.link, trial.failure, None
    if failure is None:
        try:
            measured = figures(trial)
        except ValueError as error:
            failure = str(error)
    found: dict[str, Iterable[Finding]] = {"way out": way_out[1]}
    if measured is not None:
        found["path"] = judge_paths(trial.paths, link)
        found["link"] = describe_link(measured, trial.priority)
        found["settings"] = recommend(measured, configuration)
    elif not (configuration.finds_path and any(each.check == "udp" for each in way_out[1])):  # it says why already
        ping = "" if configuration.finds_path else f"; from here: ping {split_address(link.slave)[0]}"
        found["link"] = [problem(failure or "", f"on the robot's host: weberlink slave FILE{ping}", "session")]
    document = {
        **way_out[0],
        "paths": trial.paths,
        "link": None if measured is None else measured.document,
        **({} if failure is None else {"failure": failure}),
    }
    findings = [replace(each, area=area) for area, group in found.items() for each in group]
    return DoctorReport(Needs.of(configuration, [MASTER]), findings, document)


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
