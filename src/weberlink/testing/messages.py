"""What every message on a wire keeps: it is read as it was sent, and what is no message is refused in one line.

Needs hypothesis.
"""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import pytest
from hypothesis import given, settings, strategies as st


@dataclass
class Message:
    """A kind of message.

    Args:
        refuses: with what `decode` refuses bytes that are no message.
        refused: bytes that look like one, besides every truncation.
        unsendable: values that `encode` refuses with ValueError.
        padded: bytes more behind it are refused too.
        lengths: of other messages, which a truncation may be.
    """

    values: st.SearchStrategy[Any]
    encode: Callable[[Any], bytes]
    decode: Callable[[bytes], Any]
    refuses: type[Exception] = ValueError
    refused: Collection[bytes] = ()
    unsendable: Collection[Any] = ()
    padded: bool = True
    lengths: Collection[int] = ()


class MessageContract:
    """A test class inherits from it, and names its messages."""

    MESSAGES: ClassVar[Mapping[str, Message]]

    def pytest_generate_tests(self, metafunc: pytest.Metafunc) -> None:
        if "message" in metafunc.fixturenames:
            metafunc.parametrize("message", self.MESSAGES.values(), ids=self.MESSAGES)

    @staticmethod
    @given(data=st.data(), noise=st.binary(max_size=90), at=st.integers(0, 90), flip=st.integers(1, 255))
    def test_what_is_sent_is_read_and_no_bytes_break_the_reader(
        message: Message, data: st.DataObject, noise: bytes, at: int, flip: int
    ) -> None:
        value = data.draw(message.values)
        whole = message.encode(value)
        assert message.decode(whole) == value
        torn = bytearray(whole)
        torn[at % len(torn)] ^= flip
        for each in (noise, bytes(torn)):
            try:
                found = message.decode(each)
            except message.refuses as refusal:
                assert "\n" not in str(refusal)
            else:
                assert message.decode(message.encode(found)) == found

    @staticmethod
    @settings(max_examples=5)
    @given(data=st.data())
    def test_a_part_of_a_message_and_what_looks_like_one_is_none(message: Message, data: st.DataObject) -> None:
        whole = message.encode(data.draw(message.values))
        body = whole if message.padded else whole.rstrip(b"\0\n")
        parts = [whole[:length] for length in range(len(body)) if length not in message.lengths]
        for each in (*parts, *([whole + b"x"] if message.padded else []), b"", *message.refused):
            with pytest.raises(message.refuses):
                message.decode(each)

    def test_what_cannot_be_said_is_refused(self, message: Message) -> None:
        for value in message.unsendable:
            with pytest.raises(ValueError, match=r"\S"):
                message.encode(value)
