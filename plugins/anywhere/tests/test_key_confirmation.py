"""What two hosts tell each other once a code has given them a secret."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from weberlink_anywhere import key_confirmation as said
from weberlink_anywhere.key_confirmation import CONFIRM, HELLO, REFUSED, VERSION, Names, PairingError, RefusedThereError
from weberlink_anywhere.peers import KEY_BYTES

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
