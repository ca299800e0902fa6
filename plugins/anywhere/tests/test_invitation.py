"""The code of a pairing, typed and scanned."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from weberlink_anywhere.invitation import Invitation, read

MAILBOX = "ws://relay.example:4000/v1"
CODE = "7-confidence-ribcage"


SCANNED = str(Invitation(CODE, MAILBOX))


@pytest.mark.parametrize(
    ("typed", "mailbox"),
    [(CODE, MAILBOX), (" 7-Confidence-RIBCAGE\n", MAILBOX), ("7 confidence - ribcage", MAILBOX), (SCANNED, None)],
)
def test_a_code_is_read_as_people_type_or_scan_it(typed: str, mailbox: str | None) -> None:
    assert read(typed, mailbox) == Invitation(CODE, MAILBOX)


@pytest.mark.parametrize(
    ("typed", "mailbox", "reason"),
    [
        *((typed, MAILBOX, "is no code") for typed in ("", "7-", "confidence-ribcage", "7-ribcage", "7-a-b-9")),
        (f"weberlink:{CODE}@ws://other.example/v1", MAILBOX, "and the file names"),
        (CODE, None, "names no mailbox"),
    ],
)
def test_what_is_no_code_of_this_mailbox_is_refused(typed: str, mailbox: str | None, reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        read(typed, mailbox)


@given(st.text())
def test_any_text_is_a_code_or_is_refused_in_one_line(typed: str) -> None:
    try:
        code = read(typed, MAILBOX).code
    except ValueError as error:
        assert "\n" not in str(error)
    else:
        assert read(code, MAILBOX).code == code
