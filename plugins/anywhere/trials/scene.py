"""Two hosts in the test bed with all that lies between them, and how they meet."""

import re
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from time import monotonic, sleep
from typing import Any

import numpy as np

from plugins.anywhere.tests import FILE as SHIPPED
from plugins.anywhere.tests.mailbox_server import MailboxServer
from plugins.anywhere.tests.testbed import (
    BLOCKED,
    CONE,
    MAILBOX_URL,
    NATS,
    NONE,
    SECRET,
    SYMMETRIC,
    Home,
    Internet,
    Relay,
)
from plugins.anywhere.trials.laws import Laws, write
from tests.program import ENGAGED
from trials.rig import Side, within
from weberlink.config import MASTER, SLAVE
from weberlink_anywhere.peers import KEY_BYTES, Peer, PeerStore

FILE = SHIPPED.name
LISTEN_S, MEET_S = 20.0, 40.0
"""Until a slave waits, and from a command until a session, or a line that says why there is none [s]."""
LOOK_S = 4.0  # for how long a session is looked at [s]
SCRIPT = 'master.device.script=[{"motion":"slide","points_m":[[-0.03,-0.02,0],[0.03,0.02,0]],"passes":1000}]'
"""The hand slides and presses all the time."""


class Host:
    """A user's host: a folder with the shipped file and the relay's secret, and commands typed there."""

    def __init__(self, home: Home, folder: Path) -> None:
        self.home, self.folder = home, folder
        folder.mkdir()
        # The mailbox of the test bed has no certificate.
        (folder / FILE).write_text(re.sub("wss://[^ ]*", MAILBOX_URL, SHIPPED.read_text()))
        (folder / "turn.secret").touch(mode=0o600)
        (folder / "turn.secret").write_text(SECRET)
        self.peers = PeerStore(folder / "data" / "weberlink" / "peers")

    def command(self, side: str, *arguments: str, given: str | None = None) -> Side:
        """Type `weberlink SIDE anywhere.yaml ARGUMENTS`, and what it asks for."""
        user = (f"HOME={self.folder}", f"XDG_DATA_HOME={self.folder / 'data'}")
        return Side(
            side, FILE, *arguments, prefix=(*self.home.prefix, "env", f"--chdir={self.folder}", *user), given=given
        )


@dataclass(frozen=True)
class Scene:
    """The test bed of a row, with all that can fail."""

    internet: Internet
    relay: Relay
    mailbox: MailboxServer
    robot: Host
    operator: Host


@contextmanager
def scene(robot: str = CONE, operator: str = CONE, *, second: str | None = None, known: bool = True) -> Iterator[Scene]:
    """Two hosts behind NATs of these kinds; `second` is that of another interface of the operator."""
    with Internet() as internet, TemporaryDirectory(prefix="wl-trial-") as folder:
        relay, mailbox = internet.start_relay(), internet.start_mailbox()
        one = Host(internet.home(robot), Path(folder) / "robot")
        other = Host(internet.home(operator, second), Path(folder) / "operator")
        if known:  # as after pairing
            key = bytes(range(KEY_BYTES))
            other.peers.add(Peer("robot", "robot", "operator", "slave", key, MAILBOX_URL))
            one.peers.add(Peer("operator", "operator", "robot", "master", key, MAILBOX_URL))
        yield Scene(internet, relay, mailbox, one, other)


def waits(slave: Side) -> bool:
    """Whether a slave has begun to tick; it then waits for its peer."""
    within(LISTEN_S, lambda: len(slave.records) > 0 or slave.status is not None)
    return slave.status is None and len(slave.records) > 0


@dataclass(frozen=True)
class Meeting:
    line: str  # the outcome that the operator's command reports
    route: str = ""  # "direct", "punched" or "relayed"; "" without a session
    engaged_s: float | None = None  # from the operator's command to the first tick of the session; None without one
    started_s: float = np.nan  # part of it, until the daemon ticks: start of the program and of its daemon
    rtt_ms: float = np.nan  # median round trip, and its 99th percentile less that
    jitter_ms: float = np.nan
    ended_s: float | None = None  # from the command to its end, without a session

    def __str__(self) -> str:
        return self.line if self.engaged_s is None else f"{self.engaged_s:.2f} s, {self.route}, {self.rtt_ms:.2f} ms"


def meeting(operator: Side) -> Meeting:
    """Look at a session for `LOOK_S`, then end it."""
    at = operator.first_engaged(MEET_S)
    if at is None:
        ended = None if operator.status is None else monotonic() - operator.began
        return Meeting(operator.outcome, ended_s=ended)
    sleep(LOOK_S)
    records = operator.records
    report = operator.end()
    trips = records["rtt_us"][(records["state"] == ENGAGED) & np.isfinite(records["rtt_us"])] * 1e-3
    p50, p99 = map(float, np.percentile(trips, [50, 99])) if len(trips) else (np.nan, np.nan)
    route = ",".join(path["route"] for path in report.get("paths", {}).get(MASTER, [])) or "?"
    started = float(records["at"][0]) - operator.began
    return Meeting(operator.outcome, route, at - operator.began, started, p50, p99 - p50)


def meet(place: Scene, *arguments: str) -> Meeting:
    with place.robot.command(SLAVE, *arguments) as robot:
        if not waits(robot):
            return Meeting(f"slave: {robot.last_line}")
        with place.operator.command(MASTER, *arguments, "--set", SCRIPT) as operator:
            return meeting(operator)


def expected_route(robot: str, operator: str) -> str:
    if BLOCKED in (robot, operator):
        return ""
    if SYMMETRIC in (robot, operator) and NONE not in (robot, operator):
        return "relayed"
    return "direct" if robot == operator == NONE else "punched"


def nat_row(laws: Laws, kinds: tuple[str, ...] = NATS) -> dict[str, Any]:
    found = {}
    write(f"{'robot':10} {'operator':10} {'way':8} {'engaged s':>9} {'started':>7} {'rtt ms':>7} {'jitter ms':>9}")
    for robot, operator in [("", ""), *((one, other) for one in kinds for other in kinds)]:
        with scene(robot or NONE, operator or NONE) as place:
            host = place.robot.home.first.address
            address = () if robot else ("--set", "link.finder.path=direct", "--set", f"link.slave={host}:47000")
            met = found[f"{robot}-{operator}" if robot else "direct"] = meet(place, *address)
        figures = f"{met.engaged_s or np.nan:9.2f} {met.started_s:7.2f} {met.rtt_ms:7.2f} {met.jitter_ms:9.2f}"
        write(f"{robot or 'no finder':10} {operator:10} {met.route or 'none':8} {figures}")
        route = expected_route(robot, operator)
        if not robot:
            laws.check("a session by address", met.engaged_s is not None, met.line)
        elif route:
            laws.check(f"{robot} and {operator} meet, {route}", met.route == route, met.route or met.line)
        else:
            is_clear = re.fullmatch(r"failed: no path to robot: UDP is blocked between .+", met.line)
            laws.check(f"{robot} and {operator}: one line says why not", bool(met.ended_s and is_clear), met.line)
    return {pair: asdict(met) for pair, met in found.items()}


def readme_row(laws: Laws) -> dict[str, Any]:
    """Three lines, as somebody types them who has both hosts behind routers of their own."""
    found = {}

    def check(name: str, law: str, *arguments: str, given: str | None = None) -> None:
        with place.operator.command(MASTER, *arguments, given=given) as operator:
            found[name] = meeting(operator)
        laws.check(law, found[name].engaged_s is not None, found[name])

    with scene(CONE, SYMMETRIC, known=False) as place:
        with place.robot.command(SLAVE, "--invite", "--accept") as robot:
            within(LISTEN_S, lambda: re.search(CODE, robot.said) or robot.status is not None)
            code = re.search(CODE, robot.said)
            laws.check(f"weberlink slave {FILE} --invite shows a code", code is not None, robot.last_line)
            if code is None:
                return {}
            check("join", f"weberlink master {FILE} --join engages", "--join", given=f"{code[0]}\n")
            check("again", f"weberlink master {FILE} engages without a code")
            robot.send(signal.SIGTERM)
            robot.finish()
        with place.robot.command(SLAVE) as robot:
            waits(robot)
            check("later", f"weberlink slave {FILE} waits for who it knows")
    return {name: asdict(met) for name, met in found.items()}


CODE = r"\b\d+(-[a-z]+)+\b"
