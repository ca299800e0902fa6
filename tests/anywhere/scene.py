"""Two hosts in the test bed with all that lies between them."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.anywhere.hosts import Command, Host, acquaint, within
from tests.anywhere.mailbox_server import MailboxServer
from tests.anywhere.testbed import CONE, Internet, Relay

LISTEN_S = 20.0
"""Until a slave waits [s]."""
MEET_S = 40.0
"""From a command until a session, or a line that says why there is none [s]."""
SCRIPT = 'master.device.script=[{"motion":"slide","points_m":[[-0.03,-0.02,0],[0.03,0.02,0]],"passes":1000}]'
"""The hand slides and presses all the time."""


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
        hosts = (
            Host(internet.home(robot), Path(folder) / "robot"),
            Host(internet.home(operator, second), Path(folder) / "operator"),
        )
        if known:
            acquaint(*hosts)
        yield Scene(internet, relay, mailbox, *hosts)


def last_line(said: str) -> str:
    lines = [line.strip() for line in said.splitlines() if line.strip()]
    return lines[-1] if lines else ""


def waits(command: Command) -> bool:
    """Whether a slave has begun to tick; it then waits for its peer."""
    return bool(within(LISTEN_S, lambda: len(command.records) > 0 or command.status is not None)) and (
        command.status is None
    )
