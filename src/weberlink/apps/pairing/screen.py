"""What a user sees while two hosts pair: on standard error, in 80 columns."""

import shlex

from rich.console import Console
from rich.text import Text

from weberlink.anywhere.invitation import Invitation
from weberlink.anywhere.pairing_order import PairingOrder

LINES_BELOW = 5
"""Rows of the terminal under the QR code: what to do, and the cursor."""


class Screen:
    """The screen of one pairing.

    Args:
        file: the configuration, as the user named it.
        order: of the pairing.
    """

    def __init__(self, file: str, order: PairingOrder) -> None:
        self._file, self._order = file, order
        self._console = Console(stderr=True)

    def begin(self) -> None:
        """Say what happens first."""
        verb = "joining by" if self._order.code else "asking for a code at"
        self.note(f"{verb} the mailbox {self._order.mailbox}")

    def show(self, event: dict[str, str]) -> None:
        """Show an event of the pairing process."""
        if "code" in event:
            self._invite(event["code"])
        else:
            self.note(event["note"])

    def note(self, text: str) -> None:
        self._write(f"weberlink: {text}")

    def _invite(self, code: str) -> None:
        self._draw(str(Invitation(code, self._order.mailbox)))
        self._write(f"Code: {code}")
        self._write("On the operator's host, with the same mailbox in its file:")
        self._write(f"  weberlink master {shlex.quote(self._file)} --join {code}")
        self.note(f"waiting for the operator, for {self._order.lifetime_s / 60:g} min; Ctrl-C ends it")

    def _draw(self, text: str) -> None:
        """The QR code, above the text so that a small screen keeps the text."""
        from weberlink.anywhere.qr import drawing  # noqa: PLC0415 - needs an extra

        if not self._console.is_terminal:
            return
        lines = drawing(text, self._console.width, self._console.height - LINES_BELOW)
        if lines is None:
            self.note("the QR code does not fit on this screen; make it larger, or type the code")
        for line in lines or ():
            self._console.print(Text(line, style="bright_white on black"), no_wrap=True, crop=False)

    def _write(self, text: str) -> None:
        self._console.print(Text(text), soft_wrap=True)
