"""Two hosts meet: behind NATs of every kind, and by the three lines of the README."""

import re
import signal
from dataclasses import asdict, dataclass
from time import monotonic, sleep
from typing import Any

import numpy as np

from tests.anywhere.hosts import ENGAGED, FILE, Command, within
from tests.anywhere.scene import LISTEN_S, MEET_S, SCRIPT, Scene, last_line, scene, waits
from tests.anywhere.testbed import BLOCKED, CONE, NATS, NONE, SYMMETRIC
from tests.laws import Laws, write
from weberlink.system.configuration import MASTER, SLAVE

LOOK_S = 4.0
"""For how long a session is looked at [s]."""


@dataclass(frozen=True)
class Meeting:
    """Of two hosts.

    Attributes:
        route: "direct", "punched" or "relayed"; "" without a session.
        engaged_s: from the operator's command to the first tick of the session; None without one.
        started_s: part of it, until the daemon ticks: start of the program and of its daemon.
        rtt_ms, jitter_ms: median round trip, and its 99th percentile less that.
        line: the outcome that the operator's command reports.
        ended_s: from the command to its end, without a session.
    """

    route: str
    engaged_s: float | None
    rtt_ms: float
    jitter_ms: float
    line: str = ""
    started_s: float = np.nan
    ended_s: float | None = None


def meeting(operator: Command) -> Meeting:
    """Look at a session for `LOOK_S`, then end it."""
    at = operator.first_engaged(MEET_S)
    if at is None:
        ended = None if operator.status is None else monotonic() - operator.began
        line = operator.report.get("outcome") or last_line(operator.said)
        return Meeting("", None, np.nan, np.nan, line, ended_s=ended)
    sleep(LOOK_S)
    records = operator.records
    operator.send(signal.SIGTERM)
    operator.finish()
    trips = records["rtt_us"][(records["state"] == ENGAGED) & np.isfinite(records["rtt_us"])] * 1e-3
    p50, p99 = np.percentile(trips, [50, 99]) if len(trips) else (np.nan, np.nan)
    paths = operator.report.get("paths", {}).get(MASTER, [])
    route = ",".join(path["route"] for path in paths) or "?"
    line = operator.report.get("outcome", "")
    started = float(records["at"][0]) - operator.began
    return Meeting(route, at - operator.began, float(p50), float(p99 - p50), line, started)


def meet(place: Scene, *arguments: str) -> Meeting:
    """Start the robot's side, then the operator's."""
    with place.robot.command(SLAVE, *arguments) as robot:
        if not waits(robot):
            return Meeting("", None, np.nan, np.nan, f"slave: {last_line(robot.said)}")
        with place.operator.command(MASTER, *arguments, "--set", SCRIPT) as operator:
            return meeting(operator)


def expected_route(robot: str, operator: str) -> str:
    """By which way two hosts must meet; "" if they cannot."""
    if BLOCKED in (robot, operator):
        return ""
    if SYMMETRIC in (robot, operator) and NONE not in (robot, operator):
        return "relayed"
    return "direct" if robot == operator == NONE else "punched"


def nat_row(laws: Laws) -> dict[str, Any]:
    """Every kind of NAT with every other."""
    found = {}
    write(f"{'robot':10} {'operator':10} {'way':8} {'engaged s':>9} {'started':>7} {'rtt ms':>7} {'jitter ms':>9}")
    with scene(NONE, NONE) as place:
        host = place.robot.home.first.address
        address = ("--set", "link.path=direct", "--set", f"link.slave={host}:47000")
        found["direct"] = reference = meet(place, *address)
    tell("direct", "direct", reference)
    laws.check("a session by link.path direct", reference.engaged_s is not None, reference.line)
    for robot in NATS:
        for operator in NATS:
            with scene(robot, operator) as place:
                met = found[f"{robot}-{operator}"] = meet(place)
            tell(robot, operator, met)
            route = expected_route(robot, operator)
            if route:
                laws.check(f"{robot} and {operator} meet, {route}", met.route == route, met.route or met.line)
            else:
                laws.check(f"{robot} and {operator}: one line says why not", is_one_clear_line(met), met.line)
    return {pair: asdict(met) for pair, met in found.items()}


def is_one_clear_line(met: Meeting) -> bool:
    """Whether the command ended by itself, and named the reason."""
    return met.ended_s is not None and bool(
        re.fullmatch(r"failed: no path to robot: UDP is blocked between .+", met.line)
    )


def tell(robot: str, operator: str, met: Meeting) -> None:
    if met.engaged_s is None:
        write(f"{robot:10} {operator:10} {'none':8} {'-':>9}")
    else:
        figures = f"{met.engaged_s:9.2f} {met.started_s:7.2f} {met.rtt_ms:7.2f} {met.jitter_ms:9.2f}"
        write(f"{robot:10} {operator:10} {met.route:8} {figures}")


def readme_row(laws: Laws) -> dict[str, Any]:
    """Three lines, as somebody types them who has both hosts behind routers of their own."""
    found: dict[str, Any] = {}
    with scene(CONE, SYMMETRIC, known=False) as place:
        with place.robot.command(SLAVE, "--invite") as robot:
            code = within(LISTEN_S, lambda: re.search(r"\b\d+(-[a-z]+)+\b", robot.said) or robot.status is not None)
            laws.check(
                f"weberlink slave {FILE} --invite shows a code", isinstance(code, re.Match), last_line(robot.said)
            )
            if not isinstance(code, re.Match):
                return found
            with place.operator.command(MASTER, "--join", code[0]) as operator:
                found["join"] = asdict(met := meeting(operator))
            laws.check(f"weberlink master {FILE} --join {code[0]} engages", met.engaged_s is not None, told(met))
            with place.operator.command(MASTER) as operator:
                found["again"] = asdict(met := meeting(operator))
            laws.check(f"weberlink master {FILE} engages without a code", met.engaged_s is not None, told(met))
            robot.send(signal.SIGTERM)
            robot.finish()
        with place.robot.command(SLAVE) as robot:
            waits(robot)
            with place.operator.command(MASTER) as operator:
                found["later"] = asdict(met := meeting(operator))
            laws.check(f"weberlink slave {FILE} waits for who it knows", met.engaged_s is not None, told(met))
    return found


def told(met: Meeting) -> str:
    return met.line if met.engaged_s is None else f"{met.engaged_s:.2f} s, {met.route}, {met.rtt_ms:.2f} ms"
