"""Path finders: parts of other distributions that say whom a side meets, by which key, and over which path."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from socket import AF_UNIX, SOCK_SEQPACKET, socket, socketpair
from typing import TYPE_CHECKING, Any, ClassVar, Protocol

from pydantic import BaseModel

from weberlink.registry import Registry

if TYPE_CHECKING:
    from weberlink.config import Configuration
    from weberlink.protocol.aio.udp import MakePaths
    from weberlink.protocol.keys import HeldKey
    from weberlink.protocol.security import Security

ENDS_S = 2.0  # time that the process of a finder has to end, after which it is killed [s]


class PathFinder(Protocol):
    """How a side meets its peer, in place of a key file and the addresses of the file.

    A class of this kind is an entry point of the group `weberlink.path_finders`. `Options` are those of the section
    `link.finder`; `peer` among them names whom to meet. What it complains of is a `ConfigurationError`.

    Attributes:
        security: the suite with the key of the peer, or with those of several (`weberlink.protocol.psk.Keyring`).
        own: name of this side towards the peer.
        expects: name of the only peer; "" for several.
    """

    Options: ClassVar[type[BaseModel]]
    security: "Security"
    own: str
    expects: str

    def __init__(self, options: Any, configuration: "Configuration", side: str) -> None: ...

    def process(self, *, take_over: bool, stream: str = "") -> Sequence[str]:
        """Module and arguments of the process that finds paths.

        The number of its end of the socket to the daemon is added as the last argument. It ends when the other end is
        closed.

        Args:
            take_over: whether to replace a master that the slave serves.
            stream: what the paths are for, beside the session that moves the robot, such as pictures; both ends say
                the same.
        """

    def paths(self, end: socket) -> "MakePaths":
        """What makes the paths of the endpoint, where they are found: `end` is the socket to the process, which does
        not block and stays open."""

    def stored_keys(self) -> "tuple[Path, Callable[[], Sequence[HeldKey]]]":
        """Where the keys of a slave's peers are stored, and what reads those that are held now; asked of who has a
        `Keyring`."""

    @staticmethod
    def finds_path(options: Any) -> bool:
        """Whether paths are found; else the two meet at the addresses of the file."""

    @staticmethod
    def pair(
        configuration: "Configuration", side: str, code: str, label: str | None, *, accept: bool, right: str = "drive"
    ) -> str:
        """Make the two hosts known to each other by a code; returns what to call the peer as `peer`.

        Args:
            code: that the other host shows; "" to make one and show it.
            label: what to call the peer; None for its own name.
            accept: whether the robot's host keeps the key without asking a person.
            right: what the robot's host lets the key be good for (`weberlink.protocol.keys.Right`).
        """

    @staticmethod
    def examine(options: Any) -> tuple[Any, Sequence[Any]]:
        """What `weberlink doctor` says of the way out of this host: for JSON, and as findings of that command."""


FINDERS: Registry[type[PathFinder]] = Registry("path finder", {}, "weberlink.path_finders")


def finder_of(configuration: "Configuration", side: str) -> PathFinder | None:
    """The finder that the file asks for, if it does. As there are keys, no core is dumped any more. Raises
    ConfigurationError if whom to meet is not known."""
    part = configuration.finder
    if part is None:
        return None
    from weberlink.realtime.process import forbid_core_dumps  # noqa: PLC0415 - where a file asks for it

    forbid_core_dumps()
    made: PathFinder = part.driver(part.options, configuration, side)
    return made


@contextmanager
def finding(
    configuration: "Configuration", finder: PathFinder | None, *, take_over: bool, stream: str = ""
) -> "Iterator[MakePaths]":
    """What makes the paths of the endpoint; a process that finds them has ended when this is left."""
    from weberlink.protocol.aio.udp import Paths  # noqa: PLC0415 - for daemons alone

    if finder is None or not configuration.finds_path:
        yield Paths
    else:
        with running(finder.process(take_over=take_over, stream=stream)) as end:
            yield finder.paths(end)


@contextmanager
def running(module: Sequence[str]) -> Iterator[socket]:
    """Run a module with arguments of its own; the socket to it does not block."""
    from weberlink.child_process import Child, python  # noqa: PLC0415 - for daemons alone

    ours, theirs = socketpair(AF_UNIX, SOCK_SEQPACKET)
    with ours:
        with theirs:
            child = Child(python("-m", *module, str(theirs.fileno())), pass_fds=[theirs.fileno()])
        ours.setblocking(False)
        try:
            yield ours
        finally:
            ours.close()
            child.end(ENDS_S)
