"""Pair two hosts by a code: `weberlink slave --invite` and `weberlink master --join`."""

import json
import shlex
import sys
import termios
from dataclasses import replace
from select import select
from subprocess import PIPE

from rich.console import Console
from rich.text import Text

from weberlink.child_process import Child, python
from weberlink.config import SLAVE, Configuration, ConfigurationError
from weberlink.realtime.process import forbid_core_dumps
from weberlink.session.composition.link import default_name
from weberlink.text import one_line
from weberlink_anywhere.invitation import Invitation, read
from weberlink_anywhere.options import AnywhereOptions
from weberlink_anywhere.order import PairingOrder
from weberlink_anywhere.peers import PeerError, PeerStore
from weberlink_anywhere.qr import drawing

FAREWELL_S = 5.0
"""How long the pairing process may take to tell the other host that it ends."""
LOOK_S = 0.2
LINES_BELOW = 5
"""Rows of the terminal under the QR code: what to do, and the cursor."""


def pair(
    configuration: Configuration, side: str, code: str, label: str | None, *, accept: bool, right: str = "drive"
) -> str:
    """Pair this host with another one, and keep the peer; see `weberlink.config.finders.PathFinder`.

    Raises:
        ConfigurationError: there is no mailbox in the file, or the two did not pair; says why.
    """
    forbid_core_dumps()
    asked = "--join" if code else "--invite"
    order = replace(_order(configuration, side, code, label, asked), accept=accept, right=right)
    if side == SLAVE and not accept and not sys.stdin.isatty():
        raise ConfigurationError(
            f"{asked}: two words are to be compared and confirmed here, and standard input is no terminal; "
            "run it on one, or add --accept"
        )
    screen = Screen(str(configuration.path), order)
    child = start(order)
    is_asked = False
    try:
        while True:
            is_over = not child.running  # seen before its last words are read
            for line in child.lines(LOOK_S):
                event = json.loads(line)
                if "refused" in event:
                    raise ConfigurationError(f"{asked}: {event['refused']}")
                if "paired" in event:
                    screen.note(f"paired with {event['paired']}; no code is needed from now on")
                    return str(event["paired"])
                if "asks" in event:
                    is_asked = True
                    termios.tcflush(sys.stdin, termios.TCIFLUSH)  # what was typed before it is shown is no answer
                screen.show(event)
            if is_asked and select([sys.stdin], [], [], 0.0)[0]:
                is_asked = False
                child.write_line("yes" if sys.stdin.readline().strip().lower() in ("y", "yes") else "no")
            if is_over:
                raise ConfigurationError(f"{asked}: the pairing process {child.how_it_ended}")
    finally:
        child.end(FAREWELL_S)


def start(order: PairingOrder) -> Child:
    """The process, which ends with its standard input, and then tells the other host."""
    child = Child(python("-m", "weberlink_anywhere.pairing"), stdin=PIPE, stdout=PIPE)
    child.write_line(order.to_json())
    return child


def _order(configuration: Configuration, side: str, code: str, label: str | None, asked: str) -> PairingOrder:
    assert configuration.finder is not None
    link, options = configuration.system.link, configuration.finder.options
    assert isinstance(options, AnywhereOptions)
    mailbox, store = options.mailbox, PeerStore(options.peer_store)
    name = getattr(link.names, side) or default_name(side, link.listen)
    try:
        if code:
            code, mailbox = read(code, mailbox)
        known = list(store)
    except (ValueError, PeerError) as error:
        raise ConfigurationError(f"{asked}: {error}") from None
    if mailbox is None:
        raise ConfigurationError(
            f"{asked}: needs link.finder.mailbox, a mailbox server that both hosts reach (docs/relay.md)"
        )
    for peer in known:
        if peer.label == label:
            raise ConfigurationError(f"--peer: {label} is known already; leave {asked} out, or choose another name")
        if side == SLAVE != peer.role and peer.own != name:  # a slave that waits for both could not be both
            raise ConfigurationError(
                f"{asked}: {peer.label} knows this host as {peer.own}, and not as {name}; "
                f"add --set link.names.slave={json.dumps(peer.own)}"
            )
    return PairingOrder(side, name, str(store.folder), mailbox, code, label or "")


class Screen:
    """What a user sees while two hosts pair: on standard error, in 80 columns.

    Args:
        file: the configuration, as the user named it.
        order: of the pairing.
    """

    def __init__(self, file: str, order: PairingOrder) -> None:
        self._file, self._order = file, order
        self._console = Console(stderr=True)
        self.note(f"{'joining by' if order.code else 'asking for a code at'} the mailbox {order.mailbox}")

    def show(self, event: dict[str, str]) -> None:
        """Show an event of the pairing process."""
        if "note" in event:
            self.note(event["note"])
            return
        if "words" in event:
            self.note(f"both hosts must show the same two words; this one shows: {event['words']}")
            return
        if "asks" in event:
            asks = f"{one_line(event['asks'])} asks to {self._order.right} this robot"
            self._write(f"{asks}. Does its screen show these words? [y/N]")
            return
        code = event["code"]
        self._draw(str(Invitation(code, self._order.mailbox)))
        self._write(f"Code: {code}")
        self._write("On the operator's host, with the same mailbox in its file:")
        self._write(f"  weberlink master {shlex.quote(self._file)} --join")
        self.note(f"waiting for the operator, for {self._order.lifetime_s / 60:g} min; Ctrl-C ends it")

    def note(self, text: str) -> None:
        self._write(f"weberlink: {text}")

    def _draw(self, text: str) -> None:
        """The QR code, above the text so that a small screen keeps the text."""
        if not self._console.is_terminal:
            return
        lines = drawing(text, self._console.width, self._console.height - LINES_BELOW)
        if lines is None:
            self.note("the QR code does not fit on this screen; make it larger, or type the code")
        for line in lines or ():
            self._console.print(Text(line, style="bright_white on black"), no_wrap=True, crop=False)

    def _write(self, text: str) -> None:
        self._console.print(Text(text), soft_wrap=True)
