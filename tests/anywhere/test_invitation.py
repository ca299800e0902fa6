"""The code of a pairing, typed and scanned."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from weberlink.anywhere.invitation import Invitation, read

MAILBOX = "ws://relay.example:4000/v1"
CODE = "7-confidence-ribcage"


@pytest.mark.parametrize("typed", [CODE, " 7-Confidence-RIBCAGE\n", "7 confidence - ribcage"])
def test_a_code_is_read_as_people_type_it(typed: str) -> None:
    assert read(typed, MAILBOX) == Invitation(CODE, MAILBOX)


@pytest.mark.parametrize("mailbox", [MAILBOX, None])
def test_the_text_of_the_qr_code_is_a_code(mailbox: str | None) -> None:
    assert read(str(Invitation(CODE, MAILBOX)), mailbox) == Invitation(CODE, MAILBOX)


def test_a_code_of_another_mailbox_is_refused() -> None:
    with pytest.raises(ValueError, match="and the file names"):
        read(f"weberlink:{CODE}@ws://other.example/v1", MAILBOX)


def test_a_code_needs_a_mailbox() -> None:
    with pytest.raises(ValueError, match="names no mailbox"):
        read(CODE, None)


@pytest.mark.parametrize("typed", ["", "7", "7-", "confidence-ribcage", "7-ribcage", "x-confidence-ribcage", "7-a-b-9"])
def test_what_is_no_code_is_refused(typed: str) -> None:
    with pytest.raises(ValueError, match="is no code"):
        read(typed, MAILBOX)


@given(st.text())
def test_any_text_is_a_code_or_is_refused_in_one_line(typed: str) -> None:
    try:
        code = read(typed, MAILBOX).code
    except ValueError as error:
        assert "\n" not in str(error)
    else:
        assert read(code, MAILBOX).code == code
