"""The code by which two hosts pair, as it is shown, typed and scanned."""

import re
from typing import NamedTuple

_SCHEME = "weberlink:"
_CODE = re.compile(r"[0-9]{1,6}(-[a-z]+){2,}")


class Invitation(NamedTuple):
    """A code, such as 7-confidence-ribcage, and the URL of the mailbox server at which it is valid."""

    code: str
    mailbox: str

    def __str__(self) -> str:
        """The text of the QR code."""
        return f"{_SCHEME}{self.code}@{self.mailbox}"


def read(text: str, mailbox: str | None) -> Invitation:
    """Read what a user typed or scanned: a code, in either case and with spaces or dashes, or the text of a QR code.

    Args:
        mailbox: of the user's file; needed where the text names none.

    Raises:
        ValueError: it is no code, or of another mailbox than the file's; the message says what to do.
    """
    typed, at, named = text.strip().removeprefix(_SCHEME).partition("@")
    code = "-".join(re.split(r"[\s-]+", typed.strip().lower()))
    if not _CODE.fullmatch(code):
        raise ValueError(f"{text!r} is no code; it is a number and words, such as 7-confidence-ribcage")
    if not at:
        if mailbox is None:
            raise ValueError("the file names no mailbox; add link.finder.mailbox, as in configs/anywhere.yaml")
        return Invitation(code, mailbox)
    if mailbox not in (None, named):
        raise ValueError(
            f"the code is of the mailbox {named}, and the file names {mailbox}; set link.finder.mailbox to one"
        )
    return Invitation(code, named)
