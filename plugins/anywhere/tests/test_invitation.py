"""The code of a pairing, typed, scanned and drawn; and what two hosts tell each other with its secret."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from weberlink_anywhere import key_confirmation as said
from weberlink_anywhere.invitation import Invitation, read
from weberlink_anywhere.key_confirmation import CONFIRM, HELLO, REFUSED, VERSION, Names, PairingError, RefusedThereError
from weberlink_anywhere.peers import KEY_BYTES
from weberlink_anywhere.qr import drawing

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


TEXT = str(Invitation("7-confidence-ribcage", "ws://relay.example:4000/v1"))
LONG = str(Invitation("123-microscope-yesteryear", "wss://relay.robotics.university.example/v1"))
HALVES = {" ": (0, 0), "▀": (1, 0), "▄": (0, 1), "█": (1, 1)}  # which halves of a cell are light


def qr_codes(lines: list[str], ground: int) -> list[str]:
    """Texts of the codes in lines of light characters, on a screen whose other cells are `ground` (0 dark to 255)."""
    zxingcpp = pytest.importorskip("zxingcpp")
    halves = np.array([[HALVES[letter][half] for letter in line] for line in lines for half in (0, 1)], np.uint8)
    picture = np.pad(255 * halves.repeat(6, axis=0).repeat(6, axis=1), 6, constant_values=ground)
    return [found.text for found in zxingcpp.read_barcodes(picture)]


@pytest.mark.parametrize("ground", [0, 255], ids=["dark", "light"])
@pytest.mark.parametrize("text", [TEXT, LONG], ids=["short", "long"])
def test_a_terminal_of_80_by_24_shows_a_readable_code(text: str, ground: int) -> None:
    lines = drawing(text, 80, 19)
    assert lines is not None and len(lines) <= 19
    assert all(len(line) == len(lines[0]) <= 80 for line in lines)
    assert qr_codes(lines, ground) == [text]


@pytest.mark.parametrize(("columns", "rows"), [(20, 50), (80, 10)])
def test_a_screen_too_small_has_none(columns: int, rows: int) -> None:
    assert drawing(TEXT, columns, rows) is None


SECRET = bytes(range(32))
NAMES = Names("anna@pc", "robot:47000")
names = st.builds(Names, *[st.text('ab,"[]\\é', max_size=3)] * 2)


@given(names, names)
def test_a_key_is_of_both_names_in_their_order(one: Names, other: Names) -> None:
    assert len(said.pair_key(SECRET, one)) == KEY_BYTES
    assert (said.pair_key(SECRET, one) == said.pair_key(SECRET, other)) is (one == other)
    assert said.pair_key(SECRET, one) != said.pair_key(SECRET[::-1], one)


@pytest.mark.parametrize(
    ("secret", "names_", "side"),
    [
        (SECRET[::-1], NAMES, "slave"),
        (SECRET, Names("anna@pc", "robot:47001"), "slave"),
        (SECRET, Names(*reversed(NAMES)), "slave"),
        (SECRET, NAMES, "master"),
    ],
    ids=["another secret", "another name", "names exchanged", "our own side"],
)
def test_a_confirmation_of_something_else_does_not_count(secret: bytes, names_: Names, side: str) -> None:
    assert said.is_confirmed(said.confirmation(SECRET, NAMES, "slave"), SECRET, NAMES, "slave")
    assert not said.is_confirmed(said.confirmation(secret, names_, side), SECRET, NAMES, "slave")


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        ({"version": VERSION + 1, "side": "slave", "name": "robot"}, "another version"),
        ({"version": VERSION, "side": "master", "name": "robot"}, "the same side"),
        ({"version": VERSION, "side": "slave", "name": ""}, "1 to 64 printable"),
        ({"version": VERSION, "side": "slave", "name": "a" * 65}, "1 to 64 printable"),
        ({"version": VERSION, "side": "slave", "name": "rob\x1b[2Jot"}, "1 to 64 printable"),
        ({"version": VERSION, "side": "slave"}, "1 to 64 printable"),
        (["slave", "robot"], "another version"),
    ],
)
def test_a_hello_that_cannot_be_used_is_refused(content: object, reason: str) -> None:
    assert said.name_in(said.read(said.hello("slave", "robot:47000"), HELLO), "master") == "robot:47000"
    with pytest.raises(PairingError, match=reason):
        said.name_in(content, "master")


@given(st.binary(min_size=16, max_size=16), st.binary(min_size=16, max_size=16), st.binary(min_size=16, max_size=16))
def test_a_nonce_is_the_one_that_was_committed_to(one: bytes, other: bytes, third: bytes) -> None:
    assert said.nonce_in(one.hex(), said.commitment(one)) == said.nonce_in(one.hex(), None) == one
    if one != other:
        with pytest.raises(PairingError, match="another nonce than it said"):
            said.nonce_in(one.hex(), said.commitment(other))
        words = {said.words_to_compare(SECRET, NAMES, *each) for each in ((one, third), (other, third), (third, one))}
        assert all(len(each) == 2 for each in words)


@pytest.mark.parametrize("content", [None, 3, "", "zz", "00" * 15, "00" * 17, ["00" * 16]])
def test_what_is_no_nonce_is_refused(content: object) -> None:
    with pytest.raises(PairingError, match="nonce"):
        said.nonce_in(content, None)


@pytest.mark.parametrize("text", [b"", b"{", b"[]", b"3", b"\xff", b'{"hello": 1}' + b" " * 3000, b'{"kept": true}'])
def test_what_is_no_such_message_is_refused(text: bytes) -> None:
    with pytest.raises(PairingError, match="no message of a pairing"):
        said.read(text, CONFIRM)


@given(st.text())
def test_a_refusal_arrives_as_one_printable_line(reason: str) -> None:
    with pytest.raises(RefusedThereError) as caught:
        said.read(said.message(REFUSED, reason), CONFIRM)
    assert str(caught.value).isprintable()
    assert len(str(caught.value)) < 400
